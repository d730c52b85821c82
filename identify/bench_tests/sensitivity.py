"""How far does each parameter move the step response: one at a time, and all together (Sobol).

One at a time: the change of a figure in percent per percent of the parameter, by a central difference of 1 %.

Sobol: every parameter varies uniformly over its range; the first-order index is the share of a figure's variance that
one parameter makes alone, the total index the share that it has a part in (I. M. Sobol, Math. and Computers in
Simulation 55 (2001) 271-280; estimator of A. Saltelli et al., Computer Physics Communications 181 (2010) 259-270, as
scipy.stats.sobol_indices has it).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.bench_tests.step_response import reach
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import constants_of, course_of, rest_start, simulator

Array = NDArray[np.float64]

FIGURES = ("final", "rise_s", "settling_2_s", "overshoot_percent")
ROWS = 1500  # of a simulated response
TOLERANCE = 0.1  # share that a parameter without an interval may be off
SAMPLES = 128  # of Sobol's sequence, a power of 2; every figure is simulated (parameters + 2) times as often
NUDGE = 0.01


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """`ranges` of each parameter in its unit; indices by figure, then by parameter."""

    ranges: Mapping[str, tuple[float, float]]
    local: Mapping[str, Mapping[str, float]]  # % per %; overshoot in points per %
    first: Mapping[str, Mapping[str, float]]
    total: Mapping[str, Mapping[str, float]]


def sensitivity(plant: Plant, level: float, seed: int) -> Sensitivity:
    """Vary the free parameters of `plant` over their 95 % intervals, or 10 % where there is none.

    The first output answers a step of the first input to `level`. Raises IdentifyError where it never comes to rest.
    """
    names = [p.name for p in plant.parameters if p.free and p.value != 0.0]
    if not names:
        raise IdentifyError("plant.parameters has no free parameter whose influence could be told; set free = true")
    response = _Response(plant, level)
    base = constants_of(plant)
    where = {p.name: k for k, p in enumerate(plant.parameters)}
    middle = response.figures(base)
    ranges = {name: _range(plant, name) for name in names}
    local: dict[str, dict[str, float]] = {figure: {} for figure in FIGURES}
    for name in names:
        ends = []
        for sign in (1.0, -1.0):
            moved = base.copy()
            moved[where[name]] *= 1.0 + sign * NUDGE
            ends.append(response.figures(moved))
        for k, figure in enumerate(FIGURES):
            scale = 1.0 if figure == "overshoot_percent" else middle[k] / 100.0
            change = (ends[0][k] - ends[1][k]) / (200.0 * NUDGE)
            local[figure][name] = float(change / scale) if scale else math.nan

    def figures(points: Array) -> Array:
        made = []
        for point in points.T:
            constants = base.copy()
            for name, value in zip(names, point, strict=True):
                constants[where[name]] = value
            made.append(response.figures(constants))
        return np.array(made).T

    widths = [scipy.stats.uniform(low, high - low) for low, high in ranges.values()]
    found = scipy.stats.sobol_indices(func=figures, n=SAMPLES, dists=widths, rng=np.random.default_rng(seed))
    first, total = np.atleast_2d(found.first_order), np.atleast_2d(found.total_order)
    return Sensitivity(
        ranges,
        local,
        {figure: dict(zip(names, _shares(first[k]), strict=True)) for k, figure in enumerate(FIGURES)},
        {figure: dict(zip(names, _shares(total[k]), strict=True)) for k, figure in enumerate(FIGURES)},
    )


def _shares(indices: Array) -> list[float]:
    """NaN where a figure never varies."""
    return [float(value) if math.isfinite(value) else math.nan for value in indices]


def _range(plant: Plant, name: str) -> tuple[float, float]:
    parameter = next(p for p in plant.parameters if p.name == name)
    if parameter.deviation and parameter.interval_95:
        return parameter.interval_95
    half = TOLERANCE * abs(parameter.value)
    return max(parameter.value - half, parameter.low), min(parameter.value + half, parameter.high)


class _Response:
    """Step responses of one plant with changing constants."""

    def __init__(self, plant: Plant, level: float) -> None:
        linear = linearize(plant)
        poles = np.linalg.eigvals(linear.a)
        slow = -float(np.max(poles.real, initial=-math.inf))
        if slow <= 1e-9 * float(np.max(np.abs(poles), initial=0.0)):
            raise IdentifyError(
                f"plant {plant.kind}: its first output never comes to rest after a step, so that there is no step "
                "response to vary; choose an output that settles, such as a speed"
            )
        time = np.linspace(0.0, linear.delay + 9.0 / slow, ROWS)
        columns = {signal.name: np.full(ROWS, level) for signal in plant.inputs}
        bare = replace(plant, parameters=plant.parameters)
        recording = make_recording(time, columns, "step", "")
        self._time, self._engine = time, simulator(bare)
        self._course, self._start = course_of(bare, recording), rest_start(bare, recording)

    def figures(self, constants: Array) -> Array:
        """Return the figures (4,), in the order of FIGURES."""
        output = self._engine.run(self._course, constants, self._start)[:, 0]
        change = output[-1] - output[0]
        if change == 0.0 or not np.all(np.isfinite(output)):
            raise IdentifyError("plant: the first output does not answer the step; check the parameters")
        share = (output - output[0]) / change
        outside = np.flatnonzero(np.abs(share - 1.0) > 0.02)
        k = int(outside[-1])
        # Between rows, where the band is crossed: a time that jumps from row to row would have no slope.
        step = (abs(share[k] - 1.0) - 0.02) / max(abs(share[k] - share[min(k + 1, ROWS - 1)]), 1e-12)
        settled = self._time[k] + min(step, 1.0) * (self._time[1] - self._time[0])
        rise = reach(self._time, share, 0.9) - reach(self._time, share, 0.1)
        return np.array([output[-1], rise, settled, 100.0 * max(float(share.max()) - 1.0, 0.0)])
