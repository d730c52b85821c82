"""Refuse, before a fit that could only go astray, a log of three bridges that no machine was driven by.

The voltages are made of these columns: a supply of 0 gives none, duties in percent a hundred times as much, and an
angle that is not the electrical one in rad turns them anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, column

Array = NDArray[np.float64]

DUTIES = ("duty_a", "duty_b", "duty_c")
_BEYOND = 0.02  # of a duty: what a logger's rounding may pass 0 and 1 by
_PERCENT = 100.0
_NEAR = 0.25  # of a factor
_LEAST = 1.0  # rad that a log must turn by
_UNITS = (("degrees", 180.0 / math.pi, "deg"), ("turns", 0.5 / math.pi, "turn"))


def pace(moved: Array, turned: Array) -> float | None:
    """Return how many times as far a column moves from row to row as the speed turns; None where nothing turns.

    Jumps, as of an angle that wraps, are left out.
    """
    if float(np.sum(np.abs(turned))) < _LEAST:
        return None
    apart = np.abs(moved - np.median(moved))
    steps = apart < 10.0 * np.median(apart) + 1e-12
    size = float(turned[steps] @ turned[steps])
    return float(moved[steps] @ turned[steps]) / size if size > 0.0 else None


def check_bridges(plant: Plant, recordings: Sequence[Recording]) -> None:
    """Ask the columns of each recording.

    Raises
    ------
    IdentifyError
        when supply, duties or angle cannot be what their names say.
    """
    if plant.kind != "pmsm" or plant.inputs[0].name != DUTIES[0]:
        return
    pairs = next(parameter.value for parameter in plant.parameters if parameter.name == "pole_pairs")
    for recording in recordings:
        _check_supply(recording)
        _check_duties(recording)
        if "speed_rad_s" in recording.columns:
            _check_angle(recording, pairs)


def _check_supply(recording: Recording) -> None:
    dead = np.flatnonzero(column(recording, "supply_V") <= 0.0)
    if len(dead):
        raise IdentifyError(
            f"{recording.source}: supply_V is {recording.columns['supply_V'][dead[0]]:g} V in {len(dead)} of "
            f"{len(recording.time)} rows, first at {recording.time[dead[0]]:g} s: the duties give no voltage there; "
            "cut these rows, or write the supply that the bridges had"
        )


def _check_duties(recording: Recording) -> None:
    for name in DUTIES:
        low, high = (float(end(column(recording, name))) for end in (np.min, np.max))
        if -_BEYOND <= low and high <= 1.0 + _BEYOND:
            continue
        looks, way = "counts of a timer", "as scale 1 over what the timer counts up to"
        if high <= 1.0:
            looks, way = "one around 0", "offset = 0.5"
        elif high <= _PERCENT * (1.0 + _BEYOND):
            looks, way = "percent", "scale = 0.01"
        raise IdentifyError(
            f"{recording.source}: {name} goes from {low:.4g} to {high:.4g}, and a duty from 0 to 1: it looks like "
            f"{looks}; give the column {way} in [recordings.rename]"
        )


def _check_angle(recording: Recording, pairs: float) -> None:
    speed = recording.columns["speed_rad_s"]
    turned = pairs * (speed[1:] + speed[:-1]) / 2.0 * np.diff(recording.time)
    found = pace(np.diff(column(recording, "angle_rad")), turned)
    if found is None or abs(math.log(max(found, 1e-300))) < math.log1p(_NEAR):
        return
    said = f"{recording.source}: angle_rad moves {found:.4g} times as fast as pole_pairs times speed_rad_s"
    for name, times, unit in _UNITS:
        if abs(found / times - 1.0) < _NEAR:
            raise IdentifyError(
                f'{said}: it looks like {name}; write angle = {{ name = "angle_rad", unit = "{unit}" }} in '
                "[recordings.rename]"
            )
    if found < 0.0:
        raise IdentifyError(
            f"{said}: backwards; change the sign of one of the two by scale = -1 in [recordings.rename]"
        )
    if pairs > 1.0 and abs(found * pairs - 1.0) < _NEAR:
        raise IdentifyError(f"{said}: it looks like the angle of the shaft; give the column scale = {pairs:g}")
    if found > 2.0 * _UNITS[0][1]:
        raise IdentifyError(
            f"{said}: it looks like counts, {2.0 * math.pi * found:.0f} an electrical turn; give the column the scale "
            "6.283185307 / counts in [recordings.rename], with the exact counts an electrical turn"
        )
    raise IdentifyError(
        f"{said}: correct pole_pairs, which would be {pairs * found:.3g}, or the unit of one of the columns"
    )
