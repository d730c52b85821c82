"""Find bounds that a closed loop keeps for ever, and write them with what shows them: the loop.json of a project.

In floating point, and as wide as the limits of the program allow: the reference may go as far from its rest as it can
before one of them acts. Whether it holds is for the judge `for_ever` to say.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from firmloop.design.design import Design
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.linearize import linearize
from firmloop.project.project import Project
from firmloop.quantize.program import Program
from firmloop.stages.forever.equations import NoCertificateError, equations
from firmloop.stages.forever.rest import settled
from firmloop.stages.loops import loop_of
from firmloop.verify.proofs.claims import Claims, ProofError
from firmloop.verify.proofs.closed_loop import PlantLoop
from firmloop.verify.proofs.forever.check import Followed, follow, plant_of_part
from firmloop.verify.proofs.forever.ring import Ring, close
from firmloop.verify.proofs.forever.stated import Box, Matrix, ShownPart, Stated, read_stated
from firmloop.verify.proofs.forever.sums import MOST_STEPS

Array = NDArray[np.float64]

SPARE = 1e-6  # by which stated bounds are wider than those found, for what is rounded when they are written
WHOLE_REACH = 0.98  # of what the nearest limit allows
TAIL = 1e-4  # of what is bounded: what no sample is followed for
WORST_MODES = 1e8  # condition number of modes that are as good as not independent
WIDEST = 0.3  # of what widths add to the levels that they stand on; a part above it is cut in two
MOST_PARTS = 64
LONGEST = 60.0  # s of a search
NOTHING = Fraction(0)


@dataclass(frozen=True, slots=True)
class _Found:
    """One part without its levels, how far lines of its loop move, and how far the reference may go in it."""

    part: ShownPart
    followed: Followed
    still: Array  # levels without a reference
    along: Array  # what each unit of it adds
    reach: float  # infinite where no limit is near


def certificate(project: Project, designed: Design, plant: Plant | None, program: Program, claims: Claims) -> Any:
    """Return the document loop.json; where nothing is found, it says why."""
    try:
        if not claims.fixed:
            raise NoCertificateError(f"a certificate is of fixed point, and the program is in {program.arithmetic}")
        loop = loop_of(project, designed, plant)
        if loop is None or loop.plant is None:
            raise NoCertificateError("the project has no plant whose loop this controller closes")
        return _certified(program, claims, loop, loop.plant)
    except (NoCertificateError, ProofError) as error:
        return {"schema": 1, "program_id": program.id, "found": False, "why": str(error)}


def _certified(program: Program, claims: Claims, loop: PlantLoop, plant: Plant) -> dict[str, object]:
    draft = _draft(program, loop, plant)
    whole = tuple((Fraction(row["low"]), Fraction(row["high"])) for row in draft["plant"]["parameters"])
    modes = _modes(plant)
    size = len(modes)
    box_texts = [[row["low"], row["high"]] for row in draft["plant"]["parameters"]]
    first = {
        "box": box_texts,
        "rest": [],
        "modes": _texts(modes),
        "lyapunov": [],
        "rate": "0.5",
        "steps": 0,
        "levels": ["0"] * (size + len(draft["wires"]["drives"])),
    }
    stated = read_stated(draft | {"parts": [first]})
    waiting = _at_periods(stated, whole, Fraction(repr(claims.period)))
    found: list[_Found] = []
    begin = time.monotonic()
    while waiting:
        if time.monotonic() - begin > LONGEST:
            raise NoCertificateError(
                f"the search ended after {LONGEST:.0f} s, with {len(waiting)} parts of the box left"
            )
        box = waiting.pop()
        one = _part(program, claims, stated, box, stated.parts[0].modes)
        if one is not None:
            found.append(one)
        elif len(found) + len(waiting) >= MOST_PARTS:
            raise NoCertificateError(f"the plant's intervals are too wide for a certificate of {MOST_PARTS} parts")
        else:
            waiting += _halves(box)
    return draft | _bounded(stated, found)


def _bounded(stated: Stated, found: Sequence[_Found]) -> dict[str, object]:
    """Return reach, error and parts: the reference goes as far as every part allows."""
    reach = min(one.reach for one in found) * WHOLE_REACH
    far = Fraction(repr(reach)) if stated.reference is not None and np.isfinite(reach) else NOTHING
    parts, errors = [], []
    for one in found:
        levels = tuple(Fraction(repr(float(x))) for x in (one.still + one.along * float(far)) * (1.0 + SPARE))
        parts.append(replace(one.part, levels=levels))
        errors.append(one.followed.ring.error_at_rest + one.followed.error.at(far, levels))
    return {
        "reach": _text(far),
        "error": repr(float(max(errors)) * (1.0 + SPARE)),
        "parts": [_written(part) for part in parts],
    }


def _written(part: ShownPart) -> dict[str, object]:
    return {
        "box": [[_text(end) for end in interval] for interval in part.box],
        "rest": [_text(x) for x in part.rest],
        "modes": [[_text(x) for x in row] for row in part.modes],
        "lyapunov": [[_text(x) for x in row] for row in part.lyapunov],
        "rate": _text(part.rate),
        "steps": part.steps,
        "levels": [_text(x) for x in part.levels],
    }


def _draft(program: Program, loop: PlantLoop, plant: Plant) -> dict[str, Any]:
    """Return the document without bounds and parts."""
    told, measured = loop.roles
    wires = {**({measured: 0} if measured else {}), **dict(loop.others)}
    wire = next((value for value in program.inputs if value.name == told), None)
    at_rest = NOTHING
    if wire is not None:
        low, high = (Fraction(int(end), 1 << wire.number.fraction) for end in (wire.low, wire.high))
        at_rest = NOTHING if low < 0 < high else Fraction(round((low + high) / 2 * 1024), 1024)
    return {
        "schema": 1,
        "program_id": program.id,
        "found": True,
        "plant": equations(plant),
        "wires": {
            "reference": told or None,
            "measured": wires,
            "drives": [value.name for value in loop.driven_by(program)],
        },
        "rest_reference": _text(at_rest),
        "reach": "0",
        "error": "0",
    }


# -- parts of the box --------------------------------------------------------------------------------------------------


def _at_periods(stated: Stated, box: Box, period: Fraction) -> list[Box]:
    """Cut the box where the delay is a number of whole periods."""
    delay = stated.equations.delay
    if delay is None:
        return [box]
    low, high = box[delay]
    ends = [low, *(k * period for k in range(int(low // period) + 1, int(-(-high // period)))), high]
    ends = [Fraction(repr(float(end))) for end in ends]
    if len(ends) > MOST_PARTS:
        raise NoCertificateError(f"the interval of the delay is {len(ends) - 1} periods wide")
    return [(*box[:delay], (ends[k], ends[k + 1]), *box[delay + 1 :]) for k in range(len(ends) - 1)]


def _halves(box: Box) -> list[Box]:
    """Cut the parameter in two that is known least."""
    least = max(range(len(box)), key=lambda k: (box[k][1] - box[k][0]) / (abs(box[k][0] + box[k][1]) or 1))
    low, high = box[least]
    middle = Fraction(repr(float((low + high) / 2)))
    return [(*box[:least], part, *box[least + 1 :]) for part in ((low, middle), (middle, high))]


def _part(program: Program, claims: Claims, stated: Stated, box: Box, modes: Matrix) -> _Found | None:
    """Return what is found of one part of the box, None where it is too wide."""
    plant = plant_of_part(claims, stated, box, modes)
    rest = settled(program, stated, plant)
    exact = tuple(Fraction(repr(float(x))) for x in rest)
    ring = close(claims, stated, exact, plant)
    moved = np.linalg.solve(np.eye(len(ring.matrix)) - _array(ring.matrix), np.array([float(x) for x in ring.drift]))
    if np.any(moved):
        exact = tuple(Fraction(repr(float(x + y))) for x, y in zip(rest, moved, strict=True))
        ring = close(claims, stated, exact, plant)
    lyapunov, rate, steps = _falling(ring)
    followed = follow(ring, lyapunov, rate, steps)
    widths = np.array([[float(x) for x in one.by_level] for one in followed.levels])
    if len(widths) and max(abs(np.linalg.eigvals(widths))) > WIDEST:
        return None
    back = np.linalg.inv(np.eye(len(widths)) - widths)
    known = [float(rest + one.known) for rest, one in zip(ring.at_rest, followed.levels, strict=True)]
    still, along = back @ np.array(known), back @ np.array([float(one.by_reference) for one in followed.levels])
    part = ShownPart(box, exact, modes, lyapunov, rate, steps, ())
    return _Found(part, followed, still, along, _reach(followed, still, along))


def _reach(followed: Followed, still: Array, along: Array) -> float:
    """Return how far the reference may go before a limit acts."""
    reach = np.inf
    for limit, one in zip(followed.ring.limits, followed.limits, strict=True):
        levels = np.array([float(x) for x in one.by_level])
        room = float(limit.margin) - float(one.known) - float(levels @ still)
        slope = float(one.by_reference) + float(levels @ along)
        if room <= 0:
            raise NoCertificateError(f"{limit.says}: the plant's intervals and roundings alone reach another line")
        reach = min(reach, room / slope if slope > 0 else np.inf)
    return float(reach)


def _modes(plant: Plant) -> Array:
    """Return columns that take the middle plant apart into its modes, pairs side by side."""
    a = linearize(plant).a
    values, vectors = np.linalg.eig(a)
    columns = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag == 0.0:
            columns.append(vector.real)
        elif value.imag > 0.0:
            columns += [vector.real, vector.imag]
    modes = np.array(columns).T.reshape(len(a), -1)
    return modes if len(a) and np.linalg.cond(modes) < WORST_MODES else np.eye(len(a))


def _falling(ring: Ring) -> tuple[Matrix, Fraction, int]:
    """Return a quadratic function that falls with the loop, by which factor, and the samples to follow."""
    a = _array(ring.matrix)
    radius = float(max(abs(np.linalg.eigvals(a)), default=0.0))
    if radius >= 1.0:
        raise NoCertificateError(
            f"the loop of the quantized controller and a plant of the intervals is not stable near rest: "
            f"a mode grows by {radius:.6g} a sample"
        )
    rate = (1.0 + radius) / 2.0
    scale = _scale(ring, a)
    turned = a * scale[None, :] / scale[:, None]
    p = scipy.linalg.solve_discrete_lyapunov((turned / rate).T, np.eye(len(a)))
    spread = np.linalg.cond(p)
    p = (p + p.T) / 2.0 / (scale[:, None] * scale[None, :])
    p = np.maximum(p, p.T) / np.max(np.abs(p))
    steps = int(np.log(TAIL * (1.0 - rate) / np.sqrt(spread)) / np.log(max(radius, 1e-3))) + 2
    if steps > MOST_STEPS:
        raise NoCertificateError(f"the loop takes {steps} samples to rest; at most {MOST_STEPS} are followed")
    return tuple(tuple(Fraction(float(x)) for x in row) for row in p), Fraction(rate), steps


def _scale(ring: Ring, a: Array) -> Array:
    """Return a usual size of each value of the vector, powers of two: how far unit inputs move it."""
    part = np.abs(np.array([[float(x) for x in column] for column in ring.columns.values()]).T)
    reached = np.sum(part, axis=1)
    for _ in range(len(a) + 1):
        part = np.abs(a) @ part
        reached = np.maximum(reached, np.sum(part, axis=1))
    return np.asarray(2.0 ** np.round(np.log2(np.where(reached > 0, reached, 1.0))))


def _text(value: Fraction) -> str:
    """Write a number that a float holds, or that is the shortest text of one."""
    written = repr(float(value))
    assert Fraction(written) == value or Fraction(float(value)) == value, "no float"
    return written


def _texts(matrix: Array) -> list[list[str]]:
    return [[repr(float(x)) for x in row] for row in matrix]


def _array(matrix: Sequence[Sequence[Fraction]]) -> Array:
    return np.array([[float(x) for x in row] for row in matrix]).reshape(len(matrix), -1)
