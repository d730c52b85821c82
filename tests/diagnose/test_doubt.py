"""What fails on test recordings is said, unless it holds there for nearly all that was missing."""

from __future__ import annotations

import pytest

from firmloop.diagnose.finding import Finding, Named, Ratio
from firmloop.diagnose.sentences import with_doubt

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
