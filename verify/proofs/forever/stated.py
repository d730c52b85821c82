"""Read loop.json: a plant with intervals, how a controller drives it, and the bounds claimed of both for all time.

Every number is written as text and read as the fraction it is; nothing is rounded on the way.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from typing import Any

from firmloop.verify.proofs.claims import ProofError

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]
Interval = tuple[Fraction, Fraction]
Box = tuple[Interval, ...]
MOST_STATES = 100  # of plant, past inputs and program
MOST_PARTS = 400
_NUMBER = re.compile(r"-?\d{1,400}(\.\d{1,400})?(e[+-]?\d{1,3})?")


@dataclass(frozen=True, slots=True)
class PlantEquations:
    """x' = a x + b u + c, y = read_x x + read_u u + read_c: every entry is the number of one of the operations.

    An operation is its function and what it takes: numbers of earlier ones, of a parameter, or a constant.
    """

    parameters: tuple[tuple[str, Fraction, Fraction], ...]  # name, low, high
    operations: tuple[tuple[str, tuple[Fraction, ...]], ...]
    entries: Mapping[str, tuple[tuple[int, ...], ...]]  # a, b, c, read_x, read_u, read_c
    delay: int | None  # number of the parameter that delays every input, s


@dataclass(frozen=True, slots=True)
class ShownPart:
    """A part of the box of parameters, and what shows the bounds for every plant in it."""

    box: Box
    rest: Row  # plant, past inputs newest first, program in units of its last place
    modes: Matrix  # columns that take the plant's states apart; any that are independent do
    lyapunov: Matrix
    rate: Fraction
    steps: int
    levels: Row  # claimed bounds of |plant states|, then |plant inputs|


@dataclass(frozen=True, slots=True)
class Stated:
    """Everything that a loop.json states."""

    program_id: str
    equations: PlantEquations
    units: tuple[str, ...]  # of the states, then the outputs of the plant
    reference: str | None  # the controller's input that carries it
    measured: Mapping[str, int]  # input of the controller: output of the plant
    drives: tuple[str, ...]  # outputs of the controller, in the order of the plant's inputs
    rest_reference: Fraction
    reach: Fraction  # how far the reference goes from its rest, either way
    error: Fraction  # claimed bound of |reference - first output|
    parts: tuple[ShownPart, ...]


def read_stated(document: Mapping[str, Any]) -> Stated:
    """Read it.

    Raises
    ------
    ProofError
        when something is missing or of another kind.
    """
    plant = _part(document, "plant")
    lists = {name: _whole_rows(plant, name) for name in ("a", "b", "c", "read_x", "read_u", "read_c")}
    delay = plant.get("delay")
    parameters = []
    for row in _list(plant, "parameters"):
        if not isinstance(row, Mapping) or not isinstance(row.get("name"), str):
            raise ProofError("loop.json: a parameter of the plant has no name")
        low, high = _number(row.get("low"), "low"), _number(row.get("high"), "high")
        if low > high:
            raise ProofError(f"loop.json: the interval of {row['name']} ends before it begins")
        parameters.append((row["name"], low, high))
    operations = tuple(_operation(row) for row in _list(plant, "operations"))
    wires = _part(document, "wires")
    measured = _part(wires, "measured")
    reference = wires.get("reference")
    if not (reference is None or isinstance(reference, str)):
        raise ProofError("loop.json: wires.reference is no name")
    stated = Stated(
        program_id=_text(document, "program_id"),
        equations=PlantEquations(
            tuple(parameters), operations, lists, None if delay is None else _count(plant, "delay")
        ),
        units=tuple(str(unit) for unit in _list(plant, "units")),
        reference=reference,
        measured={str(name): _count(measured, name) for name in measured},
        drives=tuple(str(name) for name in _list(wires, "drives")),
        rest_reference=_number(document.get("rest_reference"), "rest_reference"),
        reach=_number(document.get("reach"), "reach"),
        error=_number(document.get("error"), "error"),
        parts=tuple(_read_part(row) for row in _list(document, "parts")),
    )
    _check_shapes(stated)
    return stated


def _check_shapes(stated: Stated) -> None:
    held, count = stated.equations, len(stated.equations.operations)
    states, inputs = len(held.entries["a"]), len(stated.drives)
    outputs = len(held.entries["read_x"])
    shapes = {"a": (states, states), "b": (states, inputs), "c": (states, 1)}
    shapes |= {"read_x": (outputs, states), "read_u": (outputs, inputs), "read_c": (outputs, 1)}
    for name, (rows, columns) in shapes.items():
        found = held.entries[name]
        if len(found) != rows or any(len(row) != columns for row in found):
            raise ProofError(f"loop.json: plant.{name} has not {rows} rows of {columns}")
        if any(entry >= count for row in found for entry in row):
            raise ProofError(f"loop.json: plant.{name} names an operation that is not there")
    if any(output >= outputs for output in stated.measured.values()) or not outputs or not states:
        raise ProofError("loop.json: the plant has not the outputs that are measured")
    if len(stated.units) != states + outputs or not 0 < len(stated.parts) <= MOST_PARTS:
        raise ProofError(f"loop.json: units do not fit the plant, or it has not 1 to {MOST_PARTS} parts")
    for part in stated.parts:
        size = len(part.rest)
        for name, matrix, order in (("lyapunov", part.lyapunov, size), ("modes", part.modes, states)):
            if len(matrix) != order or any(len(row) != order for row in matrix):
                raise ProofError(f"loop.json: {name} is not square, of {order} rows")
        if size > MOST_STATES or len(part.levels) != states + inputs or len(part.box) != len(held.parameters):
            raise ProofError("loop.json: box, rest and levels of a part do not fit the plant")
        if not 0 < part.rate < 1:
            raise ProofError("loop.json: a rate is not between 0 and 1")
    if held.delay is not None and held.delay >= len(held.parameters):
        raise ProofError("loop.json: plant.delay names a parameter that is not there")
    if stated.reach < 0:
        raise ProofError("loop.json: reach is below 0")
    _check_cover(tuple((low, high) for _, low, high in held.parameters), [part.box for part in stated.parts])


def _check_cover(box: Box, parts: Sequence[Box]) -> None:
    """Assert that parts fill the box: each inside, no two with a common inside, and as large together."""
    wide = [k for k, (low, high) in enumerate(box) if low < high]
    for part in parts:
        if any(not a <= low <= high <= b for (low, high), (a, b) in zip(part, box, strict=True)):
            raise ProofError("loop.json: a part is not inside the plant's intervals")
    for k, one in enumerate(parts):
        if any(all(max(one[j][0], other[j][0]) < min(one[j][1], other[j][1]) for j in wide) for other in parts[:k]):
            raise ProofError("loop.json: two parts overlap")
    if sum(_volume(part, wide) for part in parts) != _volume(box, wide):
        raise ProofError("loop.json: its parts leave out some of the plant's intervals")


def _volume(box: Box, wide: Sequence[int]) -> Fraction:
    return prod((box[k][1] - box[k][0] for k in wide), start=Fraction(1))


def _read_part(row: object) -> ShownPart:
    if not isinstance(row, Mapping):
        raise ProofError("loop.json: a part is none")
    box = _matrix(row, "box")
    if any(len(interval) != 2 for interval in box):
        raise ProofError("loop.json: an interval of a part has not two ends")
    return ShownPart(
        box=tuple((low, high) for low, high in box),
        rest=_row(_list(row, "rest"), "rest"),
        modes=_matrix(row, "modes"),
        lyapunov=_matrix(row, "lyapunov"),
        rate=_number(row.get("rate"), "rate"),
        steps=_count(row, "steps"),
        levels=_row(_list(row, "levels"), "levels"),
    )


def _operation(row: object) -> tuple[str, tuple[Fraction, ...]]:
    if not isinstance(row, list) or not row or not isinstance(row[0], str):
        raise ProofError("loop.json: an operation of the plant is no list that begins with its function")
    return row[0], tuple(_number(part, f"an argument of {row[0]}") for part in row[1:])


def _part(whole: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = whole.get(name)
    if not isinstance(found, Mapping):
        raise ProofError(f"loop.json: {name} is missing")
    return found


def _list(whole: Mapping[str, Any], name: str) -> Sequence[Any]:
    found = whole.get(name)
    if not isinstance(found, list):
        raise ProofError(f"loop.json: {name} is no list")
    return found


def _text(whole: Mapping[str, Any], name: str) -> str:
    found = whole.get(name)
    if not isinstance(found, str):
        raise ProofError(f"loop.json: {name} is no text")
    return found


def _count(whole: Mapping[str, Any], name: str) -> int:
    found = whole.get(name)
    if not isinstance(found, int) or isinstance(found, bool) or found < 0:
        raise ProofError(f"loop.json: {name} is no number of something")
    return found


def _number(found: object, name: str) -> Fraction:
    if isinstance(found, int) and not isinstance(found, bool):
        return Fraction(found)
    if not isinstance(found, str) or not _NUMBER.fullmatch(found):
        raise ProofError(f"loop.json: {name} is no number that is written as text")
    return Fraction(found)


def _row(found: Sequence[Any], name: str) -> Row:
    return tuple(_number(entry, name) for entry in found)


def _matrix(whole: Mapping[str, Any], name: str) -> Matrix:
    return tuple(_row(row if isinstance(row, list) else [row], name) for row in _list(whole, name))


def _whole_rows(whole: Mapping[str, Any], name: str) -> tuple[tuple[int, ...], ...]:
    rows = _list(whole, name)
    for row in rows:
        if not isinstance(row, list) or not all(type(entry) is int and entry >= 0 for entry in row):
            raise ProofError(f"loop.json: plant.{name} holds what is no number of an operation")
    return tuple(tuple(row) for row in rows)
