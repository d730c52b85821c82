"""Take large dense sums of a floating-point program from a table, in loops: the same sums in the same order.

Loops are chosen where they take no more than MOST times the instructions of straight lines on a Cortex-M4F. They take a
third of the bytes there or less, and from 24 rows and values on fewer instructions too: straight lines run out of
registers, and load every value again for every row. Measured with gcc 12 at -O2, orders 9 to 40, the counts below are
right to 5 %.

A row is a sum that adds one product with a constant after the other to its first; rows that weigh the same values in
the same order stand in one table. Values of rows keep their names, ranges and bits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from firmloop.quantize.program import Op, Program, Table, Value

DATA, SUMS = "row_data", "sums"
MOST = 1.25
BY_8, BY_4, ALONE, END = 3.4, 3.75, 7.0, 4.0  # instructions of loops: a product, by rows taken together; a value or row
STRAIGHT, REGISTERS, SPILL = 3.2, 16, 1 / 12  # of straight lines: a product; more for each value beyond these


@dataclass(frozen=True, slots=True)
class _Row:
    """The operation that ends a sum, those before it, and what it weighs by what."""

    end: Op
    inner: frozenset[str]
    values: tuple[str, ...]
    weights: tuple[float, ...]


def in_rows(program: Program) -> Program:
    """Return a floating-point `program` with its largest lot of rows of the same values in loops, where that pays."""
    if program.tables:
        return program
    lots: dict[tuple[str, ...], list[_Row]] = {}
    for row in _rows(program):
        lots.setdefault(row.values, []).append(row)
    rows = max(lots.values(), key=lambda lot: len(lot) * len(lot[0].values), default=[])
    return _looped(program, rows) if rows and cheaper(len(rows), len(rows[0].values)) else program


def cheaper(rows: int, values: int) -> bool:
    """Tell whether loops take few enough instructions beside straight lines."""
    by_8, by_4, alone = rows - rows % 8, rows % 8 - rows % 4, rows % 4
    loops = values * (BY_8 * by_8 + BY_4 * by_4 + ALONE * alone) + END * (rows + values)
    return loops <= MOST * rows * values * (STRAIGHT + SPILL * max(0, values - REGISTERS))


def _rows(program: Program) -> list[_Row]:
    """Return every sum of products with constants that nothing takes a part of."""
    made = {op.result.name: op for op in program.body}
    uses = Counter(a for op in program.body for a in op.arguments if isinstance(a, str))
    uses.update(a.source for a in (*program.next_state, *program.results))
    uses.update(bit.source for bit in program.status)

    def own(name: object) -> Op | None:
        """Return the operation of a value that is used once."""
        return made.get(str(name)) if uses[str(name)] == 1 else None

    found, taken = [], set[str]()
    for op in reversed(program.body):
        if op.function not in ("add", "sub") or op.result.name in taken:
            continue
        terms: list[tuple[str, float]] = []
        inner: set[str] = set()
        place: Op | None = op
        while place is not None and place.function in ("add", "sub"):
            before, product = place.arguments
            terms.append(_term(product, own(product), -1.0 if place.function == "sub" else 1.0, inner))
            place = own(before)
            inner.add(str(before))
        inner.discard(str(before) if place is None else "")
        terms.append(_term(before, place, 1.0, inner))
        values, weights = zip(*reversed(terms), strict=True)
        if all(values) and len(set(values)) == len(values):
            found.append(_Row(op, frozenset(inner), values, weights))
        taken |= inner
    return found[::-1]


def _term(name: object, made: Op | None, sign: float, inner: set[str]) -> tuple[str, float]:
    """Return value and weight of a part of a sum; no name where it is a constant."""
    if made is not None and made.function == "mul":
        factor, value = sorted(made.arguments, key=lambda a: isinstance(a, str))
        if isinstance(value, str) and not isinstance(factor, str):
            inner.add(str(name))
            return value, sign * factor
    return (name, sign) if isinstance(name, str) else ("", 0.0)


def _looped(program: Program, rows: Sequence[_Row]) -> Program:
    """Put an operation over a table before the first end of these rows, which take their sums from it."""
    values, names = rows[0].values, {op.result.name for op in program.body}
    sums = next(name for name in (SUMS, *(f"{SUMS}{k}" for k in range(2, len(names) + 3))) if name not in names)
    weights = tuple(row.weights[k] for k in range(len(values)) for row in rows)
    table = Table(
        DATA,
        f"weights of {len(values)} values in {len(rows)} rows",
        "fl_rows_t",
        "fl_rows.h",
        (("FL_ROWS", len(rows)), ("FL_ROW_VALUES", len(values))),
        (("weight", weights),),
    )
    number = rows[0].end.result.number
    low, high = min(row.end.result.low for row in rows), max(row.end.result.high for row in rows)
    plan = Op(Value(sums, "", number, low, high), "rows", (f"table.{DATA}", *values))
    ends: Mapping[str, Op] = {
        row.end.result.name: replace(row.end, function="row", arguments=(sums, k)) for k, row in enumerate(rows)
    }
    gone = frozenset[str]().union(*(row.inner for row in rows))
    body: list[Op] = []
    for op in program.body:
        if op.result.name in ends and plan not in body:
            body.append(plan)
        if op.result.name not in gone:
            body.append(ends.get(op.result.name, op))
    return replace(program, body=tuple(body), tables=(table,))
