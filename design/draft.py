"""A Draft: what a linear controller kind computes before its outputs are limited."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca


@dataclass(frozen=True, slots=True)
class Element:
    """One state variable, and what it is at the next sample; `low` and `high` limit it, infinite where nothing does."""

    name: str
    unit: str
    symbol: ca.SX
    next: ca.SX
    low: float = -math.inf
    high: float = math.inf


# What limits a state where the kind itself has no key that does.
REMEDY = (
    'an integral has a limit in kind = "pid" with anti_windup = "clamping" or "back_calculation", and any state in '
    'kind = "state_space" with x_min and x_max'
)


@dataclass(frozen=True, slots=True)
class Draft:
    """What a controller kind computes before its outputs are limited, linear in state and inputs.

    `named`: name -> (unit, value) of the intermediates that deserve a name in the C. `applied` stand for the limited
    outputs where the next state follows from them. `step`: what an integral, added to the output, moves by. `states`:
    inputs that carry the plant's states. `remedy`: what the user can do about a state of no finite range.
    """

    says: str
    inputs: tuple[ca.SX, ...]
    state: tuple[Element, ...]
    outputs: tuple[ca.SX, ...]
    named: Mapping[str, tuple[str, ca.SX]]
    figures: Mapping[str, float] = field(default_factory=dict)
    applied: tuple[ca.SX, ...] = ()
    step: ca.SX | None = None
    states: tuple[int, ...] = ()
    remedy: str = REMEDY
