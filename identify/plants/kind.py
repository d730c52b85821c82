"""A PlantKind: how one family of plants is described by a user and turned into equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from firmloop.identify.plants.plant import Balance, Parameter, Plant
from firmloop.identify.signal import Signal

# Columns that a recording may have; a lag whose output is none of them may well be a machine that moves.
_QUANTITIES = ("voltage", "current", "speed", "position", "torque", "force", "temperature", "reference")


@dataclass(frozen=True, slots=True)
class PlantConstant:
    """One parameter of a kind: physical range `low`..`high` in `unit`.

    `guessable`: may be left out of a project, because `Kind.shapes` proposes values for it. `open_low`: the value
    `low` itself is impossible (a time constant of zero), so that the fit works with the logarithm. `counted`: a whole
    number, which no fit may change.
    """

    name: str
    unit: str
    low: float
    high: float
    open_low: bool
    guessable: bool
    counted: bool = False


@dataclass(frozen=True, slots=True)
class PlantKind:
    """`build(inputs, outputs, parameters)` writes the equations.

    `shapes(step, span)` proposes starting values of every guessable constant but `scale`, for a recording of typical
    sample time `step` and length `span`, both in s; `scale` names the constant the output is proportional to, `level`
    one that is added to it: both then follow from the data by linear least squares. `optional(inputs, outputs)` are the
    constants that are there only where the project gives them; they stand behind the others.
    """

    name: str
    constants: tuple[PlantConstant, ...]
    inputs: tuple[tuple[str, ...], ...]  # what may drive it, names that go together; empty: any one
    outputs: tuple[str, ...]  # names it insists on, empty: any one
    build: Callable[[tuple[Signal, ...], tuple[Signal, ...], tuple[Parameter, ...]], Plant]
    scale: str | None
    shapes: Callable[[float, float], tuple[Mapping[str, float], ...]] = lambda step, span: ()
    per_unit: str | None = None  # the constant that turns a named drive signal into the input it insists on
    optional: Callable[[Sequence[str], Sequence[str]], tuple[PlantConstant, ...]] = lambda inputs, outputs: ()
    level: str | None = None


def equations(name: str, state: ca.SX, drive: ca.SX, constants: ca.SX, result: ca.SX) -> ca.Function:
    """Wrap expressions as the `rate` or `reading` of a Plant."""
    return ca.Function(name, [state, drive, constants], [ca.densify(result)], ["x", "u", "p"], ["result"])


def moving_balance(output: Signal, state: int, position: int, per: ca.Function, effort: ca.Function) -> Balance:
    """Return the torque or force balance of a lag, in which what drives it and what opposes it are in output units."""
    linear = output.unit in ("m", "m/s")
    return Balance("force" if linear else "torque", state, per, position=position, effort=effort)


def may_be(output: Signal, quantity: str) -> bool:
    """Tell whether an output may be of a quantity: it is called so, or by no quantity that a recording knows."""
    own = output.name.partition("_")[0]
    return own == quantity or own not in _QUANTITIES
