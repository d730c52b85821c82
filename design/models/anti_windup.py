"""Anti-windup of a PID: every way to keep the integral near what the limits allow, `anti_windup` in [controller].

This file alone knows their names. The controller (`kinds/pid`), its proven ranges and the tuning rules that simulate it
ask a mode for what they need, so that a new one is one more entry of MODES.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca

from firmloop.design.table import choice


@dataclass(frozen=True, slots=True)
class Sample:
    """What moves the integral I in one sample, with e the error, v the unlimited output and u what it tracks."""

    integral: ca.SX
    step: ca.SX  # ki h e
    back: ca.SX  # (h/tt) (u - v)
    above: ca.SX  # v is above its limit
    below: ca.SX
    upward: ca.SX  # ki e > 0
    downward: ca.SX


@dataclass(frozen=True, slots=True)
class AntiWindup:
    """One mode; `moved` returns I of the next sample.

    `why` is why I stays in its range, blank where nothing bounds it. `tracks`: it follows u by the tracking term, whose
    time is `tt_s`. `one_sign`: it asks which way ki e points, so ki must keep its sign.
    """

    name: str
    says: str  # in the head of the generated C
    why: str
    tracks: bool
    one_sign: bool
    moved: Callable[[Sample], ca.SX]

    def __str__(self) -> str:
        """Return the name, as messages write it."""
        return self.name


def _conditional(sample: Sample) -> ca.SX:
    outward = ca.logic_or(ca.logic_and(sample.above, sample.upward), ca.logic_and(sample.below, sample.downward))
    return sample.integral + ca.if_else(ca.logic_not(outward), sample.step, 0)


BACK_CALCULATION = AntiWindup(
    name="back_calculation",
    says=", back-calculation",
    why="tracking pulls it to where the unlimited output meets a limit, plus ki tt times the error",
    tracks=True,
    one_sign=False,
    moved=lambda sample: sample.integral + sample.step + sample.back,
)
CLAMPING = AntiWindup(
    name="clamping",
    says=", clamping",
    why="it moves outward only while the unlimited output is within its limits, at most one step beyond",
    tracks=False,
    one_sign=True,
    moved=_conditional,
)
NONE = AntiWindup(
    name="none",
    says="",
    why="",
    tracks=False,
    one_sign=False,
    moved=lambda sample: sample.integral + sample.step,
)
MODES: Mapping[str, AntiWindup] = {mode.name: mode for mode in (BACK_CALCULATION, CLAMPING, NONE)}


def anti_windup_of(table: Mapping[str, object]) -> AntiWindup:
    """Read `anti_windup` of a controller's table; by default back-calculation."""
    return MODES[choice(table, "anti_windup", BACK_CALCULATION.name, tuple(MODES))]


def tracking_modes() -> str:
    """Name the modes that track, for a message."""
    return " or ".join(f"'{mode.name}'" for mode in MODES.values() if mode.tracks)
