"""Every measurement tells what it measures when it is asked for help, and starts nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__")
    for path in (ROOT / "bench").rglob("*.py")
    if '__name__ == "__main__"' in path.read_text(encoding="utf-8")
)


def asked(module: str, flag: str = "--help") -> str:
    """Return what is wrong with the help of a module; nothing where it is sound."""
    words = [sys.executable, "-m", module, flag]
    done = subprocess.run(words, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    sound = done.returncode == 0 and not done.stderr and len(done.stdout) > 40
    return "" if sound else f"{module} {flag}: {done.returncode} {done.stdout[:80]} {done.stderr[-300:]}"


def test_every_measurement_answers_for_help() -> None:
    assert len(MODULES) > 50
    with ThreadPoolExecutor(2) as pool:
        assert not [*filter(None, pool.map(asked, MODULES))]


def test_the_short_flag_asks_for_help_too() -> None:
    assert not asked("bench.host.power_loss", "-h")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bench.host.fuzz", "1", "1", "window"], "'window' is no door; there are expression, frame"),
        (["bench.host.power_loss", "fly"], "'fly' is no verb that is swept; there are simulate"),
        (["bench.host.kills", "fly"], "'fly' is no verb that is killed; there are simulate"),
    ],
)
def test_a_name_that_a_bench_does_not_know_is_told_with_those_it_does(words: list[str], said: str) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith(said), done.stderr
