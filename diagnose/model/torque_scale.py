"""Put all torques of a motor on the scale that is given: what it measures tells them but for a common factor.

Speed, angle, current and voltage stay the same where the torque constant, inertias, frictions, loads and stiffnesses
all grow alike. Beside a precise encoder what is known beforehand is too weak for a descent to see.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import scipy

from firmloop.diagnose.model.descent import Place, SumOfSquares
from firmloop.diagnose.model.hypothesis import Point, Unknown
from firmloop.diagnose.policy import FARTHEST_TORQUE_SCALE

_CONSTANT = "kt_N_m_A"
_TORQUE = re.compile(r"_(N|kg)(_|$)")  # in a name: its unit has a force in it
_INERTIA = re.compile(r"_kg(_|$)")  # in a name: its unit is that of a mass or an inertia


def on_scale_of_torques(name: str) -> bool:
    """Tell whether a parameter is a torque or a force, or so much per something."""
    return _TORQUE.search(name) is not None


def inertia_of(unknowns: Iterable[Unknown]) -> tuple[str, ...]:
    """Return the plant's first inertia or mass that is fitted: all torques are on its scale; nothing where none is."""
    return tuple(each.name for each in unknowns if _INERTIA.search(each.name) and "." not in each.name)[:1]


def near_given(squares: SumOfSquares, place: Place) -> Place:
    """Return the place with all torques by the one factor that is most likely beforehand, where that costs less."""
    values = place.point.values
    keys = [each.name for each in squares.unknowns if each.name in values and on_scale_of_torques(each.name)]
    if _CONSTANT not in keys:
        return place

    def scaled(logarithm: float) -> Point:
        factor = math.exp(logarithm)
        return Point({**values, **{key: factor * values[key] for key in keys}}, place.point.starts)

    likely = scipy.optimize.minimize_scalar(
        lambda each: squares.pull(scaled(each)),
        bounds=(-FARTHEST_TORQUE_SCALE, FARTHEST_TORQUE_SCALE),
        method="bounded",
    )
    trial = squares.at(scaled(float(likely.x)))
    return trial if trial.whole < place.whole else place
