"""Tell references that the actuator cannot hold the plant at, by where the plant rests with its input at either end."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from firmloop.design.analysis.small_signal import NeverFreeError
from firmloop.design.law import DesignError
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import Linear
from firmloop.identify.simulation.simulate import constants_of

ROUNDS, NEAR = 50, 1e-9  # of Newton's method: one is enough for what is linear; a share at which a state rests
ROOM = 0.1  # of what can be held: a range may be as much wider, for overshoot and for what the plant is off


@dataclass(frozen=True, slots=True)
class Beyond:
    """`reference` asks for more than `low` to `high` (its unit), where `output` at its ends holds the plant."""

    reference: Signal
    output: Signal
    low: float
    high: float


def beyond_reach(
    inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], plant: Plant, linear: Linear
) -> Beyond | None:
    """Compare the reference's range with the plant at rest at either end of the output's; None where it can follow.

    None also where nothing can be told: an integrator goes anywhere, and an unstable plant rests nowhere.
    """
    held = held_levels(outputs, plant, linear)
    if held is None:
        return None
    reference, (low, high) = inputs[reference_and_measurement(inputs)[0]], held
    room = ROOM * (high - low)
    if not np.isfinite(room) or (reference.low >= low - room and reference.high <= high + room):
        return None
    return Beyond(reference, outputs[0], low, high)


def explained(
    error: NeverFreeError, inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], plant: Plant, linear: Linear
) -> DesignError:
    """Add to it where the output's ends hold the plant: gains that were tuned to it are off as the plant is."""
    held = held_levels(outputs, plant, linear)
    if held is None:
        return error
    wire, asked = outputs[0], inputs[reference_and_measurement(inputs)[0]]
    return DesignError(
        f"{error}; or is it the plant? {wire.name} from {wire.low:.4g} to {wire.high:.4g} {wire.unit} holds it at "
        f"{held[0]:.4g} to {held[1]:.4g} {asked.unit} at rest, and {asked.name} may be {asked.low:.4g} to "
        f"{asked.high:.4g} {asked.unit}: check its gain, and the units of both"
    )


def held_levels(outputs: tuple[Signal, ...], plant: Plant, linear: Linear) -> tuple[float, float] | None:
    """Return between which levels the output's ends hold the plant's first output; None where it rests nowhere."""
    a = np.atleast_2d(linear.a)
    if linear.b.shape[1] != 1 or len(outputs) != 1 or np.any(np.linalg.eigvals(a).real >= 0.0):
        return None
    levels = [level for end in (outputs[0].low, outputs[0].high) if (level := _level(plant, linear, end)) is not None]
    return (min(levels), max(levels)) if len(levels) == 2 else None


def _level(plant: Plant, linear: Linear, held: float) -> float | None:
    """Return where the first output rests with the input held; None where it does nowhere that is found.

    What effects do to the gain is in `linear`; the level that they move is not known here.
    """
    bare = _rest(plant, 0.0 if plant.effects else held)
    if bare is None or not plant.effects:
        return bare
    inner = linear.c[0] @ np.linalg.solve(linear.a, linear.b[:, 0]) if len(linear.a) else 0.0
    return bare + float(linear.d[0, 0] - inner) * held


def _rest(plant: Plant, held: float) -> float | None:
    """Solve the plant's own equations for no rate of any state."""
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    rate = plant.rate(x, u, p)
    slopes = ca.Function("slopes", [x, u, p], [rate, ca.jacobian(rate, x)])
    constants = constants_of(plant)[: plant.rate.numel_in(2)]  # those of effects come after the plant's
    state = np.zeros(plant.rate.numel_in(0))
    for _ in range(ROUNDS if len(state) else 0):
        moves, slope = (np.array(part) for part in slopes(state, held, constants))
        if not np.all(np.isfinite(slope)) or np.any(np.linalg.eigvals(slope).real >= 0.0):
            return None
        step = np.linalg.solve(slope, moves.ravel())
        state = state - step
        if np.all(np.abs(step) <= NEAR * (1.0 + np.abs(state))):
            break
    else:
        if len(state):
            return None
    return float(plant.reading(state, held, constants)[0])
