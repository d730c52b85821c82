"""Print a plant with all its effects as C that moves period by period, as SteppedPlant does, without Python."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.assembly import Timing
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.course import LONGEST_CHANGE
from firmloop.identify.simulation.engine import effect_simulator
from firmloop.identify.simulation.marshal import Job, driver_texts, job
from firmloop.identify.simulation.segments import mapped, still
from firmloop.identify.simulation.simulate import constants_of
from firmloop.identify.simulation.stepped import SteppedPlant

Array = NDArray[np.float64]

_SAME = 1e-9  # of the period, as in stepped.c
_MATRICES = ("a", "b", "c", "read_x", "read_u", "read_c", "current", "effort", "flanks", "q", "lag_rate", "p")
_SIZES = (
    *("n", "m", "r", "terms", "coordinates", "simple", "speed", "position", "lags", "settling"),
    "asked",
)
_EQUATIONS = ("rate", "reading", "bent", "slope")


@dataclass(frozen=True, slots=True)
class PortablePlant:
    """C99 with libm: `files` by name, of which `sources` are compiled; `stepped.h` is what a caller needs.

    `first` is what the outputs read at rest.
    """

    files: Mapping[str, str]
    sources: tuple[str, ...]
    first: Array


def portable(plant: Plant, period: float) -> PortablePlant:
    """Return the C of a plant that takes its inputs every `period`, s.

    Raises
    ------
    IdentifyError
        when one of its parameters has no value.
    """
    constants = constants_of(plant)
    engine = effect_simulator(plant)
    made = job(engine.assemble(constants), engine.equations_at(constants), constants)
    folder = files("firmloop.identify.simulation").joinpath("integrator")
    own = {name: folder.joinpath(name).read_text(encoding="utf-8") for name in ("stepped.c", "stepped.h")}
    equations = dict(made.equations.texts) if made.equations is not None else {}
    texts = {**driver_texts(), **own, "plant_data.h": _data(made, plant, period), **equations}
    return PortablePlant(texts, ("stepped.c", *(("plant.c",) if equations else ())), SteppedPlant(plant, period).read())


def _data(made: Job, plant: Plant, period: float) -> str:
    """Print plant_data.h."""
    problem, timing = made.problem, made.timing
    waits = [timing.output_delay.get(k, 0.0) for k in range(problem.r)]
    whole = [int(wait / period + _SAME) for wait in waits]
    after = [(count + 1) * period - wait for count, wait in zip(whole, waits, strict=True)]
    late = made.delay + timing.input_delay
    before = mapped(still(problem.m, made.rest), timing)[0]
    pieces = 2 * (math.ceil(late / period) + 3)
    lines = [
        "/* plant_data.h -- the plant: its matrices, its terms, when its inputs act and its outputs are read. */",
        *(
            f"#define {name} {value}"
            for name, value in (
                ("INPUTS_OF", problem.m),
                ("OUTPUTS_OF", problem.r),
                ("PIECES", pieces),
                ("QUEUE", max(whole) + 1),
                ("CUTS", 2 + problem.r + pieces + len(timing.breaks)),
                ("N_BREAKS", len(timing.breaks)),
                ("PERIOD", _number(period)),
                ("LATE", _number(late)),
                ("SLEW", _number(timing.slew)),
            )
        ),
        _vector("BREAKS", timing.breaks),
        _vector("AFTER", after),
        f"static const int WHOLE[] = {{{', '.join(map(str, whole))}}};",
        _vector("REST", before),
        _vector("START", made.assembly.start(np.zeros(len(plant.states)), before)),
        *_mapping(timing),
        *(_vector(f"M_{name}", np.ravel(made.arrays[name])) for name in _MATRICES),
        f"static const int LAG[] = {{{', '.join(map(str, np.ravel(made.lag).tolist()))}}};",
        *_terms(made),
        *_problem(made, period),
    ]
    return "\n".join([*lines, ""])


def _mapping(timing: Timing) -> Iterable[str]:
    """Yield what static effects of the actuator do to the first input."""
    yield "static double map_input(double u) {"
    for _, size, c, centre in timing.maps:
        yield f"    {{ const double size = {_number(size)}; u -= {_number(centre)}; u = {_number(centre)} + ({c}); }}"
    yield "    return u;"
    yield "}"


def _terms(made: Job) -> Iterable[str]:
    yield "static const term_t TERM[] = {"
    for t in made.term:
        whole = (t.what, t.code, t.target, t.constants, t.flank, t.speed, t.position)
        rates = ", ".join(_number(rate) for rate in t.rate)
        yield f"    {{{', '.join(map(str, whole))}, {_number(t.per)}, {{{rates}}}}},"
    yield "};"
    yield "static const coordinate_t COORDINATE[] = {"
    for c in made.coordinate:
        shown = ", ".join(_number(each) for each in (c.per, c.limit, c.share))
        yield f"    {{{c.what}, {c.row}, {c.to}, {shown}}},"
    yield "};"


def _problem(made: Job, period: float) -> Iterable[str]:
    """Yield the whole of it; what changes from period to period is filled in there."""
    problem = made.problem
    there = [name for name in _EQUATIONS if getattr(problem, name)]
    for name in there:
        results = "double *dx, double *by_x" if name == "slope" else "double *result"
        yield f"extern void plant_{name}(const double *x, const double *u, const double *p, {results});"
    yield "static const problem_t PLANT = {"
    for name in _SIZES:
        yield f"    .{name} = {getattr(problem, name)},"
    for name in _MATRICES:
        yield f"    .{name} = M_{name},"
    for name in there:
        yield f"    .{name} = plant_{name},"
    yield "    .term = TERM, .coordinate = COORDINATE, .lag = LAG,"
    yield f"    .step = PERIOD, .longest = {_number(LONGEST_CHANGE)},"
    yield "};"


def _vector(name: str, values: Iterable[float]) -> str:
    numbers = [_number(float(value)) for value in values]
    return f"static const double {name}[] = {{{', '.join(numbers or ['0.0'])}}};"


def _number(value: float) -> str:
    if math.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    shown = f"{value:.17g}"
    return shown if any(mark in shown for mark in ".en") else f"{shown}.0"
