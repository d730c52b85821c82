"""Push the linear nominal plant with any torque over time, and see it in the outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.per_recording import without_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.simulation.engine import effect_simulator
from firmloop.identify.simulation.linear_filter import filtered
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import course_of, rest_start
from firmloop.identify.simulation.superset import efforts

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Response:
    """The linear plant from a torque to its outputs, as a filter of rows: numerators (r, d), one denominator (d,)."""

    top: Array
    bottom: Array

    def to(self, push: Array, rows: int) -> Array:
        """Return what torques `push` (n, b) do to the outputs (rows, r, b)."""
        full = np.zeros((rows, push.shape[1]))
        full[: len(push)] = push
        return np.stack([filtered(row, self.bottom, full) for row in self.top], axis=1)


def response(plant: Plant, values: Mapping[str, float], recording: Recording, number: int = 0) -> Response:
    """Return the response to a torque in the balance `number` (of those with a state)."""
    plant = without_varying(plant).valued(values)
    bare = linearize(plant)
    balance = [each for each in plant.balances if each.state >= 0][number]
    constants = np.array([p.value for p in plant.parameters])[: plant.rate.numel_in(2)]
    states = len(bare.a)
    whole = np.zeros((states + 1, states + 1))
    whole[:states, :states] = bare.a
    whole[balance.state, states] = float(balance.per(constants))
    moved = scipy.linalg.expm(whole * course_of(plant, recording).step)
    a, b = moved[:states, :states], moved[:states, states:]
    bottom = np.asarray(np.poly(a), dtype=np.float64)  # det(z - a); det(z - a + b c) - det(z - a) = c adj(z - a) b
    return Response(np.stack([np.poly(a - b * row) - bottom for row in bare.c]), bottom)


def disturbed(plant: Plant, values: Mapping[str, float], recording: Recording, push: Array, number: int = 0) -> Array:
    """Return what torques `push` (n, b) in the balance `number` (of those with a state) do to the outputs (n, r, b)."""
    return response(plant, values, recording, number).to(push, len(recording.time))


def effort_of(plant: Plant, values: Mapping[str, float], recording: Recording) -> Array:
    """Return what the drive gives (n,), N m or N, by the recorded current or else the simulated one."""
    bare = with_effects(plant, ())
    constants = np.array([values.get(p.name, p.value) for p in bare.parameters])
    engine = effect_simulator(bare)
    assembly, course = engine.assemble(constants), course_of(bare, recording)
    states = engine.run_states(course, constants, rest_start(bare, recording))
    for index, signal in enumerate(bare.states):
        if signal.name in recording.columns:
            states[:, index] = recording.columns[signal.name]
    return np.nan_to_num(efforts(bare, engine, assembly, states, course.drive, constants))
