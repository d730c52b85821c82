"""Hand an assembly to the compiled simulator: C structures, generated terms, equations of `ode` plants."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.assembly import ADD, LEVEL, LIMIT, OUTPUT, Assembly, Timing
from firmloop.identify.plants.effect import turning
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.linear_forms import FormWriter
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.compiler import shared_library
from firmloop.identify.simulation.course import Course
from firmloop.identify.simulation.segments import Segments

Array = NDArray[np.float64]

_FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno", "-Wl,-Bsymbolic")
_DRIVER = ("memo.h", "problem.h", "fastest.h", "stick.c", "propagate.c", "glide.c", "pace.c", "segments.c")
_LOOKS = {1: "v->i", 2: "v->effort"}  # as in driver/problem.h
_TURN, _TOUCH = 4, 8  # the same
_MOST_FLANKS = 1 << 3  # as bits, the same; more of them are no part of what is exact
_USUAL_STATES = 6


class _Term(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("what", "code", "target", "constants", "flank", "speed", "position")),
        ("per", ctypes.c_double),
        ("rate", ctypes.c_double * 6),
    )


class _Coordinate(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("what", "row", "to")),
        *((name, ctypes.c_double) for name in ("per", "limit", "share")),
    )


class _Problem(ctypes.Structure):
    _fields_ = (
        *(
            (name, ctypes.c_int)
            for name in (
                "n",
                "m",
                "r",
                "terms",
                "coordinates",
                "segments",
                "simple",
                "speed",
                "position",
                "lags",
                "settling",
                "asked",
            )
        ),
        *((name, ctypes.c_void_p) for name in ("a", "b", "c", "read_x", "read_u", "read_c")),
        *((name, ctypes.c_void_p) for name in ("current", "effort", "term")),
        *((name, ctypes.c_void_p) for name in ("flanks", "q")),
        *((name, ctypes.c_void_p) for name in ("coordinate", "lag", "lag_rate", "begin", "length", "input", "ramp")),
        *((name, ctypes.c_void_p) for name in ("before", "reads", "read_row", "read_output")),
        ("step", ctypes.c_double),
        *((name, ctypes.c_void_p) for name in ("rate", "reading", "bent", "slope", "p")),
        ("longest", ctypes.c_double),
        ("most_steps", ctypes.c_double),
        ("turns", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("turn_time", "turn")),
        ("lost", ctypes.c_double),
        ("taken", ctypes.c_void_p),
    )


@dataclass(frozen=True, slots=True)
class Equations:
    """Compiled equations of a plant that is not linear; what is linear is null.

    `bent` is the effort of the first balance that has one; `texts` are their C, of which `plant.c` takes in the others.
    """

    library: ctypes.CDLL
    texts: Mapping[str, str]
    rate: int
    reading: int
    bent: int
    slope: int


@dataclass(slots=True)
class Job:
    """An assembly in the form the simulator takes; what is in it keeps the arrays alive that `problem` points to."""

    assembly: Assembly
    problem: _Problem
    timing: Timing
    delay: float  # s, the plant's own
    rest: float  # the first input before a recording begins
    arrays: Mapping[str, Array]  # what `problem` holds under their names, one after the other in `room`
    room: Array
    term: ctypes.Array[_Term]
    coordinate: ctypes.Array[_Coordinate]
    lag: NDArray[np.int32]
    equations: Equations | None


@cache
def codes() -> dict[str, int]:
    """Return the number of every C function of the library of effects."""
    names = [name for effect in effects().values() for name, _ in effect.codes]
    assert len(set(names)) == len(names), "two effects share a function"
    return {name: number for number, name in enumerate(names)}


@cache
def _pushed() -> frozenset[str]:
    """Return the functions of the library that ask for the effort, which costs time where it is not linear."""
    return frozenset(name for effect in effects().values() for name, body in effect.codes if "v->effort" in body)


@cache
def _asked(code: str) -> int:
    """Return what a function of the library looks at, as bits: current, effort, angle of waves, bodies that touch."""
    effect, body = next((each, body) for each in effects().values() for name, body in each.codes if name == code)
    looks = sum(bit for bit, word in _LOOKS.items() if word in body)
    return looks | (_TURN if turning(body) else 0) | (_TOUCH if effect.touches else 0)


def library(states: int = 0, inputs: int = 0) -> ctypes.CDLL:
    """Build the simulator with the functions of all effects; once per version of their text.

    Plants of a usual size have a build of their own, in which the compiler knows how long loops are.
    """
    usual = 0 < states <= _USUAL_STATES and inputs == 1
    return _library(states, inputs) if usual else _library(0, 0)


@cache
def driver_texts() -> dict[str, str]:
    """Return the C of the simulator with the functions of all effects; `segments.c` takes in the others."""
    lines = [
        "typedef struct {",
        "    const double *x, *m; /* states; force and place where the motion last turned round */",
        "    const double *u; /* inputs */",
        "    double t, begin, w, th, turn, lost, i, effort, s, y;",
        "    memo_t *memo;",
        "} view_t;",
        "static double sine(const view_t *v, double angle) { return remembered_sine(v->memo, angle); }",
        "/* What a wave follows: the recorded angle where the simulated one is off by a quarter of its period. */",
        "static double angle(const view_t *v, double periods) {",
        "    return fabs(periods) * v->lost < 1.5707963267948966 ? v->th : v->turn;",
        "}",
    ]
    cases, memory, touching = [], "-1", ["0"]
    for effect in effects().values():
        for name, body in effect.codes:
            lines.append(f"static double {name}(const view_t *v, const double *q) {{\n{body}\n}}")
            cases.append(f"    case {codes()[name]}: return {name}(v, q);")
            memory = str(codes()[name]) if name == effect.remembers else memory
            touching += [f"code == {codes()[name]}"] if effect.touches else []
    lines += [
        "static double term(int code, const view_t *v, const double *q) {",
        "    switch (code) {",
        *cases,
        "    default: return 0.0;",
        "    }",
        "}",
        f"static int is_memory(int code) {{ return code == {memory}; }}",
        f"static int touches(int code) {{ return {' || '.join(touching)}; }}",
        "",
    ]
    folder = files("firmloop.identify.simulation").joinpath("integrator")
    driver = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in _DRIVER}
    return {"terms.c": "\n".join(['#include "memo.h"', *lines]), **driver}


@cache
def _library(states: int, inputs: int) -> ctypes.CDLL:
    texts = driver_texts()
    sizes = (f"-DSTATES={states}", f"-DINPUTS={inputs}") if states else ()
    loaded = ctypes.CDLL(str(shared_library(texts, ["segments.c"], (*_FLAGS, *sizes))))
    loaded.at_point.restype = None
    loaded.at_point.argtypes = [ctypes.c_void_p] * 5
    loaded.run_segments.restype = ctypes.c_int
    loaded.run_segments.argtypes = [ctypes.c_void_p] * 3
    loaded.begin_run.restype = ctypes.c_void_p
    loaded.begin_run.argtypes = [ctypes.c_void_p] * 2
    loaded.go_on.restype = ctypes.c_int
    loaded.go_on.argtypes = [ctypes.c_void_p] * 2
    loaded.end_run.restype = None
    loaded.end_run.argtypes = [ctypes.c_void_p]
    return loaded


def equations_of(plant: Plant, writer: FormWriter) -> Equations:
    """Compile what is not linear of a plant's rate and reading."""
    x, u, p = (ca.SX.sym(name, plant.rate.numel_in(k)) for k, name in enumerate("xup"))
    rate, reading = ca.densify(plant.rate(x, u, p)), ca.densify(plant.reading(x, u, p))
    slope = ca.densify(ca.jacobian(rate, x)).T
    effort = plant.balances[plant.driven].effort if plant.driven >= 0 else None
    bent = ca.SX(0.0) if effort is None else ca.densify(effort(x, u, p))
    functions = {"rate": [rate], "reading": [reading], "bent": [bent], "slope": [rate, slope]}
    generator = ca.CodeGenerator("equations.c")
    wrappers = ['#include "equations.c"']
    for name, results in functions.items():
        generator.add(ca.Function(f"equations_{name}", [x, u, p], results))
        given = ", ".join(f"double *r{k}" for k in range(len(results)))
        taken = ", ".join(f"r{k}" for k in range(len(results)))
        wrappers.append(
            f"void plant_{name}(const double *x, const double *u, const double *p, {given}) {{\n"
            f"    const double *arg[] = {{x, u, p}};\n"
            f"    double *res[] = {{{taken}}};\n"
            f"    equations_{name}(arg, res, 0, 0, 0);\n"
            f"}}"
        )
    texts = {"equations.c": generator.dump(), "plant.c": "\n".join([*wrappers, ""])}
    loaded = ctypes.CDLL(str(shared_library(texts, ["plant.c"], _FLAGS)))
    place = {name: ctypes.cast(getattr(loaded, f"plant_{name}"), ctypes.c_void_p).value or 0 for name in functions}
    straight = writer.linear_rate
    return Equations(
        loaded,
        texts,
        0 if straight else place["rate"],
        0 if writer.linear_reading else place["reading"],
        0 if writer.linear_effort else place["bent"],
        0 if straight else place["slope"],
    )


def job(made: Assembly, equations: Equations | None, constants: Array) -> Job:
    """Lay an assembly out in memory."""
    n, m, r = len(made.a), made.inputs, len(made.read_x)
    q: list[float] = []
    terms = (_Term * max(len(made.terms), 1))()
    flanks, bit = np.zeros((len(made.terms), n)), 1
    for place, term in enumerate(made.terms):
        own = bit if term.flank and bit < _MOST_FLANKS else 0
        terms[place] = _Term(
            term.what,
            codes()[term.code],
            term.target,
            len(q),
            own,
            term.speed,
            term.position,
            term.per,
            (ctypes.c_double * 6)(*term.rate),
        )
        q.extend(term.constants)
        bit <<= own > 0
        for state, slope in term.flank:
            flanks[place, state] = slope
    coordinates = (_Coordinate * max(len(made.coordinates), 1))()
    for place, c in enumerate(made.coordinates):
        coordinates[place] = _Coordinate(c.what, c.row, c.to, c.per, c.limit, c.share)
    # Levels that depend on nothing leave N constant along a segment, and one exact step does; flanks are in A.
    simple = (
        all(
            t.what == OUTPUT or own.flank or (t.what in (ADD, LEVEL) and not any(t.rate))
            for t, own in zip(made.terms, terms, strict=False)
        )
        and not any(c.what == LIMIT for c in made.coordinates)
        and (equations is None or not equations.rate)
        and not (made.lags and equations is not None)
    )
    nonlinear_lags = made.lags if equations is not None and equations.reading else []
    arrays = {
        "a": made.a, "b": made.b, "c": made.c, "read_x": made.read_x, "read_u": made.read_u, "read_c": made.read_c,
        "current": np.concatenate([made.current_x, made.current_u]),
        "effort": np.concatenate([made.effort_x, made.effort_u]),
        "flanks": flanks, "q": np.array(q),
        "lag_rate": np.array([rate for _, _, rate in nonlinear_lags]),
        "p": constants,
    }  # fmt: skip
    room = np.concatenate([*arrays.values()], axis=None, dtype=np.float64)  # one after the other, row by row
    lag = np.array([*((o, row) for o, row, _ in nonlinear_lags), (0, 0)], dtype=np.int32)
    asked = 0
    for term in made.terms:
        asked |= _asked(term.code)
    problem = _Problem(
        n=n, m=m, r=r, terms=len(made.terms), coordinates=len(made.coordinates), simple=int(simple),
        speed=made.speed, position=made.position, lags=len(nonlinear_lags),
        settling=int(any(t.rate[5] for t in made.terms)), asked=asked,
        term=ctypes.addressof(terms), coordinate=ctypes.addressof(coordinates), lag=lag.ctypes.data,
    )  # fmt: skip
    place = room.ctypes.data
    for name, value in arrays.items():
        setattr(problem, name, place)
        place += value.size * room.itemsize
    if equations is not None:
        problem.rate, problem.reading = equations.rate, equations.reading
        problem.slope = equations.slope
        problem.bent = equations.bent if any(term.code in _pushed() for term in made.terms) else 0
    delay = 0.0 if made.plant.delay is None else made.value(made.plant.delay)
    rest = made.resting_input()
    return Job(made, problem, made.timing, delay, rest, arrays, room, terms, coordinates, lag, equations)


def run_job(made: Job, cut: Segments, start: Array, course: Course) -> Array:
    """Run over the segments of a course and return the outputs (q, r); NaN where the simulation did not get to."""
    problem = made.problem
    load_segments(problem, cut)
    problem.longest, problem.most_steps = course.longest_change, course.most_steps
    problem.turns = 0 if course.turn is None else len(course.turn)
    if course.turn is not None:
        problem.turn_time, problem.turn = course.time.ctypes.data, course.turn.ctypes.data
        problem.lost = course.lost
    outputs = np.full((course.end - course.first, problem.r), np.nan)
    begin = np.ascontiguousarray(made.assembly.start(start, cut.before))
    done = library(problem.n, problem.m).run_segments(ctypes.addressof(problem), begin.ctypes.data, outputs.ctypes.data)
    if done < 0:
        raise MemoryError("the simulator ran out of memory")
    finite = np.isfinite(outputs)
    if not finite.all():
        outputs[int(np.argmin(finite.all(axis=1))) :] = np.nan
    return outputs


def load_segments(problem: _Problem, cut: Segments) -> None:
    """Give the simulator the segments it is to run through; they must live as long as it does."""
    problem.segments = len(cut.begin)
    problem.step = cut.step
    for name, address in cut.addresses.items():
        setattr(problem, name, address)


def at_point(made: Job, x: Array, u: Array) -> tuple[Array, Array]:
    """Return dx/dt (n,) and the outputs (r,) at state `x` (n,) and input `u` (m,)."""
    problem = made.problem
    rate, outputs = np.zeros(problem.n), np.zeros(problem.r)
    reads, row, output = (np.array(v, dtype=np.int32) for v in ([0, 1], [0], [-1]))
    problem.reads, problem.read_row, problem.read_output = (v.ctypes.data for v in (reads, row, output))
    state, drive = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(u, dtype=np.float64)
    library().at_point(
        ctypes.addressof(problem), state.ctypes.data, drive.ctypes.data, rate.ctypes.data, outputs.ctypes.data
    )
    return rate, outputs
