"""The comparison of machines: false names are as rare as promised, true ones are found, many cannot hide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from firmloop.presentation.fleet.words import different_rows
from firmloop.stages.fleet.compare import FAMILY, Compared, compare
from firmloop.stages.fleet.member import Estimated, Key, Member

KEY = Key("", "", "")


def members(values: Sequence[Mapping[str, float]], deviation: float = 0.005) -> list[Member]:
    return [
        Member(
            f"m{k}",
            f"m{k}.csv",
            KEY,
            {name: Estimated(value, deviation * value, "1", True) for name, value in row.items()},
        )
        for k, row in enumerate(values)
    ]


def drawn(random: np.random.Generator, machines: int) -> list[dict[str, float]]:
    return [{name: float(np.exp(random.normal(0, 0.02))) for name in ("R", "J", "k")} for _ in range(machines)]


def names(found: Compared) -> list[str]:
    return [one.machine for one in found.different]


@pytest.mark.parametrize("machines", [5, 8, 20, 200])
def test_a_fleet_that_is_alike_is_blamed_no_more_often_than_promised(machines: int) -> None:
    random, fleets = np.random.default_rng(machines), 300
    blamed = sum(bool(compare(members(drawn(random, machines))).different) for _ in range(fleets))
    most = FAMILY * fleets + 3.0 * np.sqrt(FAMILY * (1 - FAMILY) * fleets)
    assert blamed <= most


def test_a_third_of_a_fleet_cannot_hide_behind_itself() -> None:
    values = drawn(np.random.default_rng(1), 30)
    for row in values[:9]:
        row["J"] *= 1.5
    found = compare(members(values))
    assert names(found) == [f"m{k}" for k in range(9)]
    assert {each.figure for one in found.different for each in one.departures} == {"J"}


def test_a_wide_interval_excuses_a_value() -> None:
    values = drawn(np.random.default_rng(2), 20)
    values[3]["R"] *= 1.4
    known = members(values)
    assert names(compare(known)) == ["m3"]
    vague = Estimated(values[3]["R"], 0.3, "1", True)
    unsure = [*known[:3], Member("m3", "m3.csv", KEY, {**known[3].parameters, "R": vague}), *known[4:]]
    assert not compare(unsure).different


def test_one_machine_with_many_recordings_weighs_as_one() -> None:
    values = drawn(np.random.default_rng(3), 8)
    fleet = members(values)
    odd = {name: Estimated(1.6, 0.005, "1", True) for name in ("R", "J", "k")}
    found = compare([*fleet, *(Member("odd", f"odd/{k}.csv", KEY, odd) for k in range(40))])
    assert names(found) == ["odd"] and found.different[0].since == "odd/0.csv"
    assert found.typical[0].centre == pytest.approx(1.0, abs=0.03)


def test_a_machine_that_departed_for_a_while_and_then_for_good() -> None:
    fleet = members(drawn(np.random.default_rng(6), 12))
    moved = [1.0, 1.5, 1.0, 1.5, 1.5]
    history = [{"R": value, "J": 1.0, "k": 1.0} for value in moved]
    own = [Member("old", f"old/{k}.csv", KEY, one.parameters) for k, one in enumerate(members(history, 0.001))]
    (found,) = compare([*fleet, *own]).different
    assert (found.since, found.departing) == ("old/3.csv", ("old/1.csv", "old/3.csv", "old/4.csv"))
    assert different_rows(found)[0][1] == "3.csv (the last 2 of 5)"
    (gone,) = compare([*fleet, *own[:3]]).different
    assert gone.since is None and different_rows(gone)[0][1] == "only 1.csv"


def test_an_effect_that_most_machines_show_belongs_to_the_type() -> None:
    shown = {"effects": [{"name": "coulomb_friction", "probability": 1.0, "parameters": {}}], "verdict": "explained"}
    fleet = members(drawn(np.random.default_rng(4), 12))
    fleet = [Member(one.machine, one.name, KEY, one.parameters, diagnosis=shown) for one in fleet]
    found = compare(fleet)
    assert found.shared == ("coulomb_friction",) and not found.different


def test_what_stood_for_a_missing_effect_is_not_listed_beside_it() -> None:
    values = drawn(np.random.default_rng(5), 20)
    fleet = members(values)
    effect = {"name": "coulomb_friction", "probability": 1.0, "parameters": {}}
    moved = {**fleet[4].parameters, "k": Estimated(2.0, 0.01, "1", True), "R": Estimated(1.3, 0.006, "1", True)}
    beside = {**fleet[4].parameters, "R": Estimated(1.3, 0.006, "1", True)}
    shown = {"effects": [effect], "verdict": "explained"}
    fleet[4] = Member("m4", "m4.csv", KEY, moved, beside, diagnosis=shown)
    (found,) = compare(fleet).different
    assert list(found.effects) == ["coulomb_friction"] and [each.figure for each in found.departures] == ["R"]
