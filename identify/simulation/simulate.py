"""Simulate a plant over a recording by compiled C, with exact sensitivities.

CasADi writes the plant's equations and their derivatives as C; `driver/` holds the loop over the rows and two
integrators. A plant whose equations are linear in state and input (all kinds without further effects) is moved by
matrix exponentials, anything else by Runge-Kutta of order five. One library per set of equations is built and kept;
values of parameters are arguments, so that a fit builds nothing.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import site_of, values_of
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.hold import knots
from firmloop.identify.recordings.recording import Recording, column
from firmloop.identify.simulation.compiler import shared_library
from firmloop.identify.simulation.course import Course, Engine
from firmloop.identify.simulation.engine import effect_simulator

Array = NDArray[np.float64]

# -ffp-contract=off: the same sums on every machine, so that a fit can be repeated to the last digit.
_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-Wl,-Bsymbolic")


@dataclass(frozen=True, slots=True)
class Simulator:
    """The compiled equations of a plant. Arrays in and out are in the units of the plant's signals."""

    library: ctypes.CDLL
    states: int
    outputs: int
    constants: int
    delay: int  # index among the constants, -1 for none
    linear: bool

    @property
    def sticking(self) -> Sequence[int]:
        """None: there are no effects."""
        return ()

    def run(self, course: Course, constants: Array, start: Array) -> Array:
        """Return the outputs (q, r) from state `start` in the first row; rows after a divergence are NaN."""
        return self._call(course, constants, start, (), False)[0]

    def run_with_slopes(
        self, course: Course, constants: Array, start: Array, which: Sequence[int]
    ) -> tuple[Array, Array]:
        """Also return dy/d(constants[which], start): (q, r, len(which) + number of states)."""
        return self._call(course, constants, start, which, True)[:2]

    def usual_state(self, course: Course, constants: Array, start: Array) -> Array:
        """Return where the plant is on average (n,); `start` where it is linear: there any guess leads to the best."""
        return start if self.linear else self._call(course, constants, start, (), False)[2]

    def steps_of(self, course: Course, constants: Array, start: Array) -> float:
        """Return the rows: a step each, or as many as the rows' distances ask for, whatever the constants."""
        return float(course.end - course.first)

    def _call(
        self, course: Course, constants: Array, start: Array, which: Sequence[int], from_start: bool
    ) -> tuple[Array, Array, Array]:
        """Return outputs, slopes, and the mean of the states (n,) over the rows."""
        rows = course.end - course.first
        directions = len(which) + (self.states if from_start else 0)
        outputs = np.empty((rows, self.outputs))
        slopes = np.empty((rows, self.outputs, directions))
        usual = np.zeros(self.states)
        chosen = np.asarray(which, dtype=np.int32)
        fixed = np.ascontiguousarray(constants)
        begin = np.ascontiguousarray(start)
        done = self.library.run_rows(
            course.first,
            course.end,
            course.time.ctypes.data,
            course.drive.ctypes.data,
            fixed.ctypes.data,
            begin.ctypes.data,
            float(fixed[self.delay]) if self.delay >= 0 else 0.0,
            course.step,
            course.longest,
            len(which),
            chosen.ctypes.data,
            int(from_start),
            outputs.ctypes.data,
            slopes.ctypes.data,
            usual.ctypes.data,
        )
        if done < 0:
            raise MemoryError("the simulator ran out of memory")
        outputs[done:] = math.nan
        slopes[done:] = math.nan
        return outputs, slopes, usual


def simulate(plant: Plant, recording: Recording, start: Array | None) -> Array:
    """Predict every output (n, r) from the recorded inputs alone; row k is read before input k acts.

    `start` is the initial state (n,); None starts at the first recorded position and otherwise at rest. Before the
    first row the input is zero, or where the plant says that it rests; a plant without memory has no rest, and its
    input is before the first row what it is there.
    """
    constants = constants_of(plant)
    begin = rest_start(plant, recording) if start is None else np.asarray(start, dtype=np.float64)
    outputs = simulator(plant, recording.hold).run(course_of(plant, recording), constants, begin)
    if not np.all(np.isfinite(outputs)):
        row = int(np.argmin(np.all(np.isfinite(outputs), axis=1)))
        raise IdentifyError(
            f"{recording.source}: the simulated {plant.kind} grows without bound at {recording.time[row]:g} s; "
            f"check the parameters and their units"
        )
    return outputs


def drive_of(plant: Plant, recording: Recording) -> Array:
    """Return the recorded inputs of the plant, (n, m)."""
    undriven = "; where nothing drives the plant, as in a free decay, write the column with zeros"
    return np.column_stack([column(recording, signal.name, undriven) for signal in plant.inputs])


def driven_by(plant: Plant, recording: Recording) -> Array:
    """Return by how much the recorded inputs differ from where the plant rests, (n, m)."""
    return drive_of(plant, recording) - plant.resting_input


def course_of(plant: Plant, recording: Recording) -> Course:
    """Take the plant's inputs and the time stamps out of a recording."""
    drive = drive_of(plant, recording)
    time = evened(recording.time)
    distances = np.diff(time)
    step = float(np.median(distances))
    if np.all(np.abs(distances - step) < 1e-6 * step):
        # Even sampling: the mean distance carries less of the rounding of the time stamps than any single one.
        step = float((time[-1] - time[0]) / len(distances))
    return Course(
        np.ascontiguousarray(time),
        np.ascontiguousarray(drive),
        step,
        float(distances.max()),
        0,
        len(time),
        None if recording.hold == "zero_order" else knots(recording.hold, time, drive, recording.source),
    )


def measured(plant: Plant, recording: Recording) -> Array:
    """Return the recorded outputs of the plant, (n, r)."""
    return np.column_stack([column(recording, signal.name) for signal in plant.outputs])


def rest_start(plant: Plant, recording: Recording) -> Array:
    """Return the initial state (n,) at rest, at the position of the first row where a position is recorded."""
    start = np.zeros(len(plant.states))
    for index, output in seen_places(plant):
        if output in recording.columns:
            start[index] = _undone(plant, output, float(recording.columns[output][0]))
    return start


def _undone(plant: Plant, output: str, reading: float) -> float:
    """Return what an output reads without what its sensor is known to do to it."""
    for use in reversed(plant.effects):
        effect = find_effect(use.name)
        if effect.undo is not None and plant.outputs[site_of(plant, effect, use.output).output].name == output:
            reading = effect.undo(values_of(plant, use), reading)
    return reading


def seen_places(plant: Plant) -> list[tuple[int, str]]:
    """Return positions, and levels of an `ode` plant, with the column that shows them as they are: (state, column)."""
    named = [(k, signal.name) for k, signal in enumerate(plant.states) if signal.name.startswith("position_")]
    if plant.kind != "ode":
        return named
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    reading = ca.vertsplit(plant.reading(x, u, p))
    places = [b.state if b.kind == "flow" else b.position for b in plant.balances]
    return named + [
        (place, signal.name)
        for place in places
        for signal, shown in zip(plant.outputs, reading, strict=True)
        if place >= 0 and ca.is_equal(shown, x[place])
    ]


def constants_of(plant: Plant) -> Array:
    """Parameter values (k,) in the plant's order; IdentifyError where one has none yet."""
    for parameter in plant.parameters:
        if math.isnan(parameter.value):
            raise IdentifyError(
                f"plant.parameters.{parameter.name} has no value; give one, or identify the plant from recordings first"
            )
    return np.array([parameter.value for parameter in plant.parameters])


def simulator(plant: Plant, hold: str = "zero_order") -> Engine:
    """Return the compiled equations of a plant; built once per set of equations, whatever the parameter values."""
    if plant.effects or plant.varying or hold != "zero_order" or not plant.states or plant.input_at_rest is not None:
        return effect_simulator(plant)
    names = [parameter.name for parameter in plant.parameters]
    delay = names.index(plant.delay) if plant.delay is not None else -1
    return _compiled(plant.rate.serialize(), plant.reading.serialize(), delay)


@lru_cache(maxsize=64)
def _compiled(rate_text: str, reading_text: str, delay: int) -> Simulator:
    rate, reading = ca.Function.deserialize(rate_text), ca.Function.deserialize(reading_text)
    states, inputs, constants = (rate.numel_in(k) for k in range(3))
    x, u, p = ca.SX.sym("x", states), ca.SX.sym("u", inputs), ca.SX.sym("p", constants)
    moved, read = rate(x, u, p), reading(x, u, p)
    driven = ca.jacobian(moved, ca.vertcat(x, u))
    linear = not ca.depends_on(driven, ca.vertcat(x, u))
    functions = [
        _dense("equations_rate", [x, u, p], [moved]),
        _dense("equations_reading", [x, u, p], [read]),
        _dense("equations_reading_slopes", [x, u, p], [read, ca.jacobian(read, x), ca.jacobian(read, p)]),
    ]
    if linear:
        still = ca.substitute(moved, ca.vertcat(x, u), ca.SX.zeros(states + inputs))
        matrix = ca.densify(ca.horzcat(driven, still))
        functions.append(_dense("equations_linear", [p], [matrix, ca.jacobian(ca.vec(matrix), p)]))
    else:
        by_state = ca.jacobian(moved, x)
        functions.append(_dense("equations_rate_by_state", [x, u, p], [by_state]))
        functions.append(_dense("equations_rate_slopes", [x, u, p], [moved, by_state, ca.jacobian(moved, p)]))
    sizes = {
        "N_STATE": states,
        "N_INPUT": inputs,
        "N_OUTPUT": reading.numel_out(0),
        "N_CONSTANT": constants,
        "DELAY": delay,
    }
    library = ctypes.CDLL(str(_build(functions, sizes, "exact.c" if linear else "runge_kutta.c")))
    whole, real, array = ctypes.c_int, ctypes.c_double, ctypes.c_void_p
    library.run_rows.restype = whole
    library.run_rows.argtypes = [whole, whole, *[array] * 4, *[real] * 3, whole, array, whole, array, array, array]
    return Simulator(library, states, sizes["N_OUTPUT"], constants, delay, linear)


def _dense(name: str, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> ca.Function:
    """Functions whose matrices are full, so that the C of `driver/` can index them."""
    names = ["p"] if len(inputs) == 1 else ["x", "u", "p"]
    return ca.Function(name, inputs, [ca.densify(o) for o in outputs], names, [f"o{k}" for k in range(len(outputs))])


def _build(functions: Sequence[ca.Function], sizes: Mapping[str, int], integrator: str) -> object:
    generator = ca.CodeGenerator("equations.c")
    header = ["#ifndef PLANT_H", "#define PLANT_H", *(f"#define {name} ({value})" for name, value in sizes.items())]
    wrappers = ['#include "equations.c"', '#include "plant.h"']
    for function in functions:
        generator.add(function)
        count_in, count_out = function.n_in(), function.n_out()
        taken = ", ".join(f"const double *a{k}" for k in range(count_in))
        given = ", ".join(f"double *r{k}" for k in range(count_out))
        name = function.name().replace("equations_", "plant_")
        # CasADi's own calling convention passes arrays of pointers and work space; the driver should not have to.
        header.append(f"static void {name}({taken}, {given});")
        wrappers.append(
            f"static void {name}({taken}, {given}) {{\n"
            f"    const double *arg[] = {{{', '.join(f'a{k}' for k in range(count_in))}}};\n"
            f"    double *res[] = {{{', '.join(f'r{k}' for k in range(count_out))}}};\n"
            f"    {function.name()}(arg, res, 0, 0, 0);\n"
            f"}}"
        )
    header.append("#endif")
    folder = files("firmloop.identify.simulation").joinpath("integrator")
    names = ("advance.h", "fastest.h", "rows.c", integrator)
    driver = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}
    everything = "\n".join(['#include "plant.c"', f'#include "{integrator}"', '#include "rows.c"', ""])
    texts = {
        "equations.c": generator.dump(),
        "plant.h": "\n".join([*header, ""]),
        "plant.c": "\n".join([*wrappers, ""]),
        "simulator.c": everything,
        **driver,
    }
    return shared_library(texts, ["simulator.c"], _FLAGS)
