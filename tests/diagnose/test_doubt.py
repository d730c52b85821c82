"""What fails on unseen recordings is taken back, unless it holds there for nearly all of what was missing."""

from __future__ import annotations

import pytest

from firmloop.diagnose.doubt import with_doubt
from firmloop.diagnose.finding import Finding, Named, Ratio

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
    ("test", "verdict"),
    [
        pytest.param(Ratio(300.0, 90.0, 25.0), "unknown_physics", id="another machine"),
        pytest.param(Ratio(4000.0, 900.0, 25.0), "explained", id="a precise sensor, and all but a fortieth explained"),
        pytest.param(Ratio(4000.0, 900.0, 15.0), "explained", id="near enough"),
        pytest.param(Ratio(4000.0, None, 25.0), "unknown_physics", id="nothing to hold it against"),
        pytest.param(None, "explained", id="nothing unseen"),
    ],
)
def test_what_fails_on_unseen_recordings_is_taken_back(test: Ratio | None, verdict: str) -> None:
    said = with_doubt(_found(test))
    assert (said.verdict, len(said.effects)) == (verdict, verdict == "explained")
