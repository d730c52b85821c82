"""What fails on test recordings is said, unless it holds there for nearly all that was missing."""

from __future__ import annotations

from typing import cast

import pytest

from firmloop.diagnose.finding import Finding, Named, Ratio, Shift
from firmloop.diagnose.search.found import Search
from firmloop.diagnose.sentences import paragraph, with_doubt

FRICTION = Named("coulomb_friction", None, "torque", 0.99, {}, "dry friction opposes motion.")


def _found(test: Ratio | None) -> Finding:
    return Finding(
        verdict="explained",
        half="plant",
        location=None,
        effects=(FRICTION,),
        alternatives=(),
        train=Ratio(900.0, 600.0, 1.0),
        test=test,
        whiteness=(0.9, 0.0),
        noise={"speed_rad_s": 1.0},
        shifts=(),
        untestable={},
        notes=(),
        says=(),
    )


@pytest.mark.parametrize(
    ("test", "told"),
    [
        pytest.param(Ratio(300.0, 90.0, 25.0), True, id="another machine"),
        pytest.param(Ratio(4000.0, 900.0, 25.0), False, id="a precise sensor, and all but a fortieth explained"),
        pytest.param(Ratio(4000.0, 900.0, 15.0), False, id="near enough"),
        pytest.param(Ratio(4000.0, None, 25.0), True, id="nothing to hold it against"),
        pytest.param(None, False, id="nothing unseen"),
    ],
)
def test_what_fails_on_test_recordings_is_said_and_changes_no_verdict(test: Ratio | None, told: bool) -> None:
    said = with_doubt(_found(test))
    assert (said.verdict, said.effects) == ("explained", (FRICTION,))
    assert any("do not follow" in note for note in said.notes) == told


@pytest.mark.parametrize(
    ("refit", "after", "unit", "says"),
    [
        (0.1661, 0.115, "", "at 1.44 times its value (0.1661 instead of 0.115)."),
        (698.34, 1.0, "s", "at 698 times its value (698.3 instead of 1 s)."),
        (4e5, 2.0, "s", "at more than 1000 times its value (4e+05 instead of 2 s)."),
    ],
)
def test_how_far_a_refit_moves_a_parameter_is_told_with_digits_that_mean_something(refit, after, unit, says):
    moved = Shift("gain", unit, 1.0, refit, after)
    named, ratio = Named("sensor_lag", None, "sensor", 0.9, {}, "it lags"), Ratio(3.0, 2.0, 1.0)
    whole = (ratio, None, (0.0, 0.5), {}, (moved,), {}, (), ())
    said = paragraph(Finding("explained", "plant", None, (named,), (), *whole), cast(Search, None), None)
    assert f"A refit without it would put gain {says}" in said
