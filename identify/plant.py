"""A Plant: the equations of a machine, its parameters, and what is uncertain about them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from identify.signal import Signal


class IdentifyError(Exception):
    """A recording or a plant is wrong; the message names the file, row, column or key, the rule and the way out."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One physical constant; `deviation` is one standard deviation in `unit`, None where it was not estimated."""

    name: str
    unit: str
    value: float
    free: bool
    low: float
    high: float
    deviation: float | None


@dataclass(frozen=True, slots=True)
class Plant:
    """Equations x' = rate(x, u, p), y = reading(x, u, p); the input acts `delay` later where a parameter says so."""

    kind: str
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Parameter, ...]
    rate: ca.Function  # (x (n,), u (m,), p (k,)) -> dx/dt (n,)
    reading: ca.Function  # (x (n,), u (m,), p (k,)) -> y (r,)
    delay: str | None  # name of the parameter that delays every input, s
