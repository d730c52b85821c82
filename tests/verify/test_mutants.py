"""Faults planted in the generated C are called `differs`."""

import re

import pytest

from bench.mutants import bench, example_law, mutants, planted

# Lines whose faults cannot reach an output: the state's own limits lie outside what the state can reach
# (design/kinds/pid_range.py), so that moving or removing them changes nothing.
WITHOUT_EFFECT = re.compile(r"const \w+ (integral_next|filtered_next|t\d+) = fl_clamp_i32\((integral_new|filtered_new)")


@pytest.mark.parametrize("arithmetic", ["fixed32", "float32"])
def test_planted_faults_are_found(arithmetic: str) -> None:
    judge = bench(example_law(), arithmetic, 60_000, 1)
    found = [m for m in mutants(judge.bundle) if not WITHOUT_EFFECT.search(m.before)]
    chosen = found[::2]
    assert len(chosen) >= 30
    missed = [f"{m.what}: {m.before.strip()}" for m in chosen if judge.outcome(planted(judge.bundle, m)) == "agrees"]
    assert missed == []


def test_the_unplanted_code_agrees() -> None:
    judge = bench(example_law(), "fixed16", 60_000, 1)
    assert judge.outcome(judge.bundle) == "agrees"
