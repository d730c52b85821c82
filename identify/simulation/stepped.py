"""Move a plant with all its effects period by period, as a controller drives it: each input is known only then."""

from __future__ import annotations

import ctypes
import math
import weakref
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import LONGEST_CHANGE
from firmloop.identify.simulation.engine import effect_simulator
from firmloop.identify.simulation.marshal import job, library, load_segments
from firmloop.identify.simulation.segments import Segments, mapped, snapped, still
from firmloop.identify.simulation.simulate import constants_of

Array = NDArray[np.float64]
Piece = tuple[float, Array, Array]  # moment in s, inputs (m,), their slopes (m,)

_SAME = 1e-9  # of the period: moments closer than this are one


def with_place(plant: Plant) -> tuple[Plant, int]:
    """Return the plant with its position among its outputs, and which of them that is."""
    moved = next((balance for balance in plant.balances if balance.kind in ("torque", "force")), None)
    if moved is None or moved.position < 0:
        raise IdentifyError(f"plant {plant.kind}: it has no position that an input of the controller could carry")
    return _showing(plant, [moved.position]), len(plant.outputs)


def with_states(plant: Plant) -> Plant:
    """Return the plant with its states behind its outputs, in their order."""
    return _showing(plant, range(len(plant.states)))


def _showing(plant: Plant, states: Sequence[int]) -> Plant:
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    reading = ca.vertcat(plant.reading(x, u, p), *(x[k] for k in states))
    wider = ca.Function("reading", [x, u, p], [ca.densify(reading)], ["x", "u", "p"], ["result"])
    inside = plant.inside
    if inside is not None:
        z = ca.SX.sym("z", len(inside.neutral))
        shown = ca.vertcat(inside.reading(x, u, p, z), *(x[k] for k in states))
        inside = replace(inside, reading=ca.Function("reading", [x, u, p, z], [ca.densify(shown)]))
    outputs = (*plant.outputs, *(plant.states[k] for k in states))
    return replace(plant, outputs=outputs, reading=wider, inside=inside)


class SteppedPlant:
    """A plant from rest that takes its inputs once a period and tells its outputs; the equations are the simulator's.

    Delays of inputs and outputs, a limit of the input's slope and moments within a period are kept as they are. A
    skewed clock is that of whoever recorded the outputs: a controller reads by its own, so that it changes nothing.
    """

    def __init__(self, plant: Plant, period: float) -> None:
        self._kind, self._period = plant.kind, period
        constants = constants_of(plant)
        engine = effect_simulator(plant)
        self._job = job(engine.assemble(constants), engine.equations_at(constants), constants)
        problem, timing = self._job.problem, self._job.timing
        problem.step, problem.longest, problem.turns = period, LONGEST_CHANGE, 0
        self._late = self._job.delay + timing.input_delay
        waits = [timing.output_delay.get(k, 0.0) for k in range(problem.r)]
        whole = [int(wait / period + _SAME) for wait in waits]
        self._reads = [(count + 1) * period - wait for count, wait in zip(whole, waits, strict=True)]  # in each period
        self._now = mapped(still(problem.m, self._job.rest), timing)[0]  # what the actuator gives, before its delay
        self._pieces: list[Piece] = [(-math.inf, self._now.copy(), np.zeros(problem.m))]  # oldest first
        self._count = 0
        begin = np.ascontiguousarray(self._job.assembly.start(np.zeros(len(plant.states)), self._now))
        run = library().begin_run(ctypes.addressof(problem), begin.ctypes.data)
        if not run:
            raise MemoryError("the simulator ran out of memory")
        self._run = run
        weakref.finalize(self, library().end_run, run)
        first = self._move([], np.zeros(0), np.zeros((0, problem.m)), np.zeros((0, problem.m)))
        self._seen = [deque([value] * (count + 1)) for value, count in zip(first, whole, strict=True)]

    def read(self) -> Array:
        """Return the outputs (r,) of this period, before the next input acts."""
        return np.array([queue[0] for queue in self._seen])

    def apply(self, values: Array) -> None:
        """Hold the inputs (m,) for one period, from their delay on."""
        begin, end = self._count * self._period, (self._count + 1) * self._period
        self._follow(mapped(np.array(values, dtype=np.float64)[None, :], self._job.timing)[0], begin)
        self._count += 1
        inner = [*(moment for moment, _, _ in self._pieces), *self._job.timing.breaks]
        cuts = np.sort([begin, end, *(begin + after for after in self._reads), *inner])
        cuts = cuts[(cuts >= begin) & (cuts <= end)]
        same = _SAME * self._period
        moments = cuts[np.concatenate([[True], np.diff(cuts) > same])]
        if end - moments[-1] > 0.0:
            moments[-1] = end  # the one before it was within rounding of the end
        starts, ramps = [], []
        for moment in moments[:-1]:
            since, value, ramp = next(piece for piece in reversed(self._pieces) if piece[0] <= moment + same)
            starts.append(value if math.isinf(since) else value + ramp * (moment - since))
            ramps.append(ramp)
        while len(self._pieces) > 1 and self._pieces[1][0] <= end + same:
            self._pieces.pop(0)
        read = self._move(
            [int(np.argmin(np.abs(moments - (begin + after)))) for after in self._reads],
            moments, np.array(starts), np.array(ramps),
        )  # fmt: skip
        for queue, value in zip(self._seen, read, strict=True):
            queue.popleft()
            queue.append(value)

    def _follow(self, target: Array, begin: float) -> None:
        """Note what the actuator does from `begin` on: it jumps, or its first input moves at the fastest slope."""
        moment, rate = begin + self._late, self._job.timing.slew
        gap = float(target[0] - self._now[0])
        if not math.isfinite(rate) or gap == 0.0:
            self._pieces.append((moment, target, np.zeros(len(target))))
            self._now = target
            return
        slope = np.zeros(len(target))
        slope[0] = math.copysign(rate, gap)
        from_here = np.concatenate([self._now[:1], target[1:]])
        self._pieces.append((moment, from_here, slope))
        needed = abs(gap) / rate
        if needed < self._period:
            self._pieces.append((moment + needed, target, np.zeros(len(target))))
            self._now = target
        else:
            self._now = from_here + slope * self._period

    def _move(self, nodes: list[int], moments: Array, starts: Array, ramps: Array) -> Array:
        """Run from moment to moment and read each output at its node of them, (r,); without moments, at once."""
        problem = self._job.problem
        count, outputs = max(len(moments) - 1, 0), np.full((1, problem.r), np.nan)
        at = np.array(nodes or [0] * problem.r)
        order = np.argsort(at, kind="stable").astype(np.int32)
        before = starts[0] if count else self._pieces[0][1]
        cut = Segments(
            np.ascontiguousarray(moments[:count]),
            snapped(np.diff(moments), self._period),
            np.ascontiguousarray(starts),
            np.ascontiguousarray(ramps),
            np.ascontiguousarray(before),
            np.searchsorted(at[order], np.arange(count + 2)).astype(np.int32),
            np.zeros(problem.r, dtype=np.int32),
            order,
            self._period,
        )
        load_segments(problem, cut)
        done = library().go_on(self._run, outputs.ctypes.data)
        if done < 0:
            raise MemoryError("the simulator ran out of memory")
        if done < count or not np.all(np.isfinite(outputs)):
            raise IdentifyError(
                f"plant {self._kind}: it grows without bound at {self._count * self._period:g} s of the closed loop; "
                "check its parameters and their units, and the controller's gains"
            )
        return np.asarray(outputs[0])
