"""The table of the diagnosis benchmark counts what a reader means by its words."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.diagnose import nulls
from bench.diagnose.confusion import column_of, interval, kind_of, table
from bench.diagnose.hidden import Hidden, Truth
from bench.diagnose.scored import Scored, as_line, failure, holds, of_line, scored

DELAY = Hidden("input_delay", None, {"delay_s": 0.01}, (("sensor_delay",),), 5.0)
FRICTION = Hidden("coulomb_friction", None, {"torque_N_m": 0.1}, (), 2.0)
EITHER_WAY = Hidden("asymmetric_friction", None, {}, (("coulomb_friction", "load_torque"),), 2.0)


def case(hidden: tuple[Hidden, ...], verdict: str, *names: str) -> Scored:
    truth = Truth("simulated", 1, hidden, "", 0.0, {}, {}, {"colored": False})
    return Scored("000001", truth, verdict, names, (True, False), 1.0, 2.0, "")


@pytest.mark.parametrize(
    ("column", "hidden", "verdict", "names"),
    [
        ("exact", (FRICTION,), "explained", ("coulomb_friction",)),
        ("exact", (FRICTION, DELAY), "explained", ("input_delay", "coulomb_friction")),
        ("one function", (DELAY,), "ambiguous", ("input_delay", "sensor_delay")),
        ("one function", (EITHER_WAY,), "explained", ("coulomb_friction", "load_torque")),
        ("holds it", (FRICTION,), "ambiguous", ("coulomb_friction", "dead_zone")),
        ("holds it", (FRICTION, DELAY), "ambiguous", ("coulomb_friction", "input_delay")),
        ("wrong", (FRICTION,), "ambiguous", ("dead_zone", "slew_rate_limit")),
        ("wrong", (FRICTION,), "explained", ("coulomb_friction", "dead_zone")),
        ("wrong", (DELAY,), "explained", ("sensor_delay",)),
        ("part", (FRICTION, DELAY), "explained", ("input_delay",)),
        ("silent", (FRICTION,), "no_mismatch", ()),
        ("unknown", (FRICTION,), "unknown_physics", ()),
        ("crash", (FRICTION,), "crash", ()),
    ],
)
def test_a_case_falls_into_one_column(column: str, hidden: tuple[Hidden, ...], verdict: str, names: list[str]) -> None:
    assert column_of(case(hidden, verdict, *names)) == column


def test_a_row_tells_what_shows() -> None:
    assert kind_of(case((FRICTION, DELAY), "explained")) == "pair"
    faint = Hidden("input_delay", None, {}, (), 0.3)
    assert kind_of(case((FRICTION, faint), "explained")) == "pair, below the noise"
    assert kind_of(case((), "no_mismatch")) == "nothing, white noise"


def test_a_phase_comes_round_and_a_null_needs_no_interval() -> None:
    wave = Hidden("cogging_torque", None, {"phase_rad": 3.1, "amplitude_N_m": 1.0}, (), 1.0)
    told = {"phase_rad": {"ci95": [-3.3, -3.1]}, "amplitude_N_m": {"ci95": None}}
    assert holds(wave, {"name": "cogging_torque", "parameters": told}) == [True]
    assert holds(wave, {"name": "torque_ripple", "parameters": told}) == []


def test_no_alarm_in_299_cases_leaves_a_rate_of_about_one_percent() -> None:
    assert interval(0, 299)[1] == pytest.approx(0.0123, abs=1e-4)
    assert interval(3, 300)[0] == pytest.approx(0.00207, abs=1e-4)


def test_an_end_without_a_verdict_is_told_by_how_it_ended() -> None:
    assert [failure(2, "error: a sentence"), failure(2, "Traceback"), failure(-11, ""), failure(-24, "")] == [
        "refused", "crash", "crash", "cut",
    ]  # fmt: skip


def test_lines_are_read_back_and_one_null_is_diagnosed(tmp_path: Path) -> None:
    folder = tmp_path / "000000"
    nulls.write(7, folder)  # a small one
    one = scored(folder)
    assert of_line(as_line(one)) == one
    assert one.verdict == "no_mismatch"
    assert one.worse <= 1.01
    assert any("false alarms: 0 of 1" in line for line in table([one]))
