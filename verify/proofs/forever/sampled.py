"""Enclose a linear plant seen at its samples, for every value of its parameters within their intervals.

With M(p) the matrix of states, inputs and constant, x[k+1] follows from exp(M h). Around the middle of the box, M is
M0 + E with E = sum d_i M_i + what is left; the exponential is exp(M0) + its slope along E + a rest of second order in
E. The rest is bounded by majorants: split into blocks by an invertible matrix of modes, the norms of the blocks of
exp(M) are at most exp(N), N with logarithmic norms on its diagonal and norms elsewhere (Strom, SIAM J. Numer. Anal. 12
(1975) 741), and the rest is at most exp(N + R) - exp(N) - slope of exp(N) along R, with R the norms of E.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.forever.exponential import Near, exponential, with_slope
from firmloop.verify.proofs.forever.slopes import ZERO, Slope, add, evaluate, multiply, negative, root
from firmloop.verify.proofs.forever.stated import Box, Interval, Matrix, PlantEquations

Rows = list[list[Interval]]
Point = list[list[Fraction]]
MOST_PIECES = 4  # periods that the interval of a delay may cross


@dataclass(frozen=True, slots=True)
class SampledPlants:
    """x[k+1] = a x[k] + sum of taps[age] u[k-age] + c,  y[k] = read_x x[k] + sum of reads[age] u[k-age] + read_c.

    Every entry is an interval.
    """

    a: Rows
    taps: Mapping[int, Rows]
    c: list[Interval]
    read_x: Rows
    reads: Mapping[int, Rows]
    read_c: list[Interval]


def sample(held: PlantEquations, box: Box, period: Fraction, modes: Matrix) -> SampledPlants:
    """Enclose it behind a zero-order hold, its parameters in `box`.

    Raises
    ------
    ProofError
        when an equation divides by zero, the modes are not independent, or the delay is not known well enough.
    """
    found = [_piece(held, part, period, whole, modes) for part, whole in _pieces(held, box, period)]
    first = found[0]
    for other in found[1:]:
        first = SampledPlants(
            _hull(first.a, other.a),
            _hulls(first.taps, other.taps),
            _hull([first.c], [other.c])[0],
            _hull(first.read_x, other.read_x),
            _hulls(first.reads, other.reads),
            _hull([first.read_c], [other.read_c])[0],
        )
    return first


def _pieces(held: PlantEquations, box: Box, period: Fraction) -> list[tuple[Box, int]]:
    """Return parts of the box in which the delay holds one number of whole periods."""
    if held.delay is None:
        return [(box, 0)]
    low, high = box[held.delay]
    if low < 0:
        raise ProofError("loop.json: the delay may be below 0")
    first, last = low // period, high // period
    if last > first and last * period == high:
        last -= 1
    if last - first >= MOST_PIECES:
        raise ProofError(f"the interval of the delay is {float((high - low) / period):.3g} periods wide")
    parts = []
    for whole in range(first, last + 1):
        part = max(low, whole * period), min(high, (whole + 1) * period)
        parts.append(((*box[: held.delay], part, *box[held.delay + 1 :]), whole))
    return parts


def _piece(held: PlantEquations, box: Box, period: Fraction, whole: int, modes: Matrix) -> SampledPlants:
    middle = tuple(((low + high) / 2,) * 2 for low, high in box)
    over, at = evaluate(held, box), evaluate(held, middle)
    states, inputs = len(held.entries["a"]), len(held.entries["b"][0])
    known = _constant(period, len(box)), _constant(period, len(box))
    step = _enclosed(held, over, at, known, box, modes)
    late = held.delay is not None and box[held.delay] != (whole * period,) * 2
    if not late:
        taps = {whole: [row[states : states + inputs] for row in step]}
    else:
        assert held.delay is not None
        rest = [_shifted(_parameter(each, held.delay), -whole * period) for each in (box, middle)]
        before = _enclosed(held, over, at, (rest[0], rest[1]), box, modes)
        left = [_shifted(_turned(each), period) for each in rest]
        after = _enclosed(held, over, at, (left[0], left[1]), box, modes)
        entered = [row[states : states + inputs] for row in before]
        taps = {
            whole: [row[states : states + inputs] for row in after],
            whole + 1: _product([row[:states] for row in after], entered),
        }
    reads = [[over[entry].value for entry in row] for row in held.entries["read_u"]]
    return SampledPlants(
        a=[row[:states] for row in step],
        taps=taps,
        c=[row[-1] for row in step],
        read_x=[[over[entry].value for entry in row] for row in held.entries["read_x"]],
        reads={whole + 1: reads} if any(entry != ZERO for row in reads for entry in row) else {},
        read_c=[over[row[0]].value for row in held.entries["read_c"]],
    )


def _constant(value: Fraction, size: int) -> Slope:
    return Slope((value, value), (ZERO,) * size)


def _parameter(box: Box, index: int) -> Slope:
    return Slope(box[index], tuple((Fraction(j == index),) * 2 for j in range(len(box))))


def _shifted(slope: Slope, by: Fraction) -> Slope:
    return Slope(add(slope.value, (by, by)), slope.along)


def _turned(slope: Slope) -> Slope:
    return Slope(negative(slope.value), tuple(negative(one) for one in slope.along))


def _product(one: Rows, two: Rows) -> Rows:
    columns = range(len(two[0]))
    return [[_sum(multiply(row[k], two[k][j]) for k in range(len(two))) for j in columns] for row in one]


def _sum(parts: Iterable[Interval]) -> Interval:
    total = ZERO
    for part in parts:
        total = add(total, part)
    return total


def _hull(one: Rows, two: Rows) -> Rows:
    return [
        [(min(a[0], b[0]), max(a[1], b[1])) for a, b in zip(row, other, strict=True)]
        for row, other in zip(one, two, strict=True)
    ]


def _hulls(one: Mapping[int, Rows], two: Mapping[int, Rows]) -> dict[int, Rows]:
    shape = next(iter((*one.values(), *two.values())), [])
    nothing = [[ZERO for _ in row] for row in shape]
    return {age: _hull(one.get(age, nothing), two.get(age, nothing)) for age in sorted({*one, *two})}


# -- one exponential over a box ----------------------------------------------------------------------------------------


def _enclosed(
    held: PlantEquations,
    over: Sequence[Slope],
    at: Sequence[Slope],
    times: tuple[Slope, Slope],  # over the box, in its middle
    box: Box,
    modes: Matrix,
) -> Rows:
    """Return the rows of the states of exp(M t), entries as intervals."""
    states = len(held.entries["a"])
    wide, middle = (_scaled(held, part, time) for part, time in zip((over, at), times, strict=True))
    order = len(middle)
    reach = [(high - low) / 2 for low, high in box]
    turns = [k for k, half in enumerate(reach) if half]
    center = [[entry.value[0] for entry in row] for row in middle]
    moves = [[[reach[k] * entry.along[k][0] for entry in row] for row in middle] for k in turns]
    left = [
        [
            sum((reach[k] * _most(wide[i][j].along[k], middle[i][j].along[k][0]) for k in turns), Fraction(0))
            for j in range(order)
        ]
        for i in range(order)
    ]
    along = [with_slope(center, move)[1] for move in moves]
    known = exponential(center)
    further = _second_order(center, moves, left, modes) if turns else None
    rows: Rows = []
    for i in range(states):
        row = []
        for j in range(order):
            low, high = known.ends(i, j)
            off = sum((_size(one, i, j) for one in along), Fraction(0))
            off += further[i][j] if further is not None else 0
            row.append((low - off, high + off))
        rows.append(row)
    return rows


def _scaled(held: PlantEquations, found: Sequence[Slope], time: Slope) -> list[list[Slope]]:
    """Return M t: rows of states, then of inputs and constant, which stay as they are."""
    states, inputs = len(held.entries["a"]), len(held.entries["b"][0])
    still = _constant(Fraction(0), len(time.along))
    rows = []
    for a, b, c in zip(*(held.entries[name] for name in "abc"), strict=True):
        rows.append([_times(found[entry], time) for entry in (*a, *b, *c)])
    return rows + [[still] * (states + inputs + 1) for _ in range(inputs + 1)]


def _times(a: Slope, b: Slope) -> Slope:
    along = (add(multiply(x, b.value), multiply(y, a.value)) for x, y in zip(a.along, b.along, strict=True))
    return Slope(multiply(a.value, b.value), tuple(along))


def _most(interval: Interval, middle: Fraction) -> Fraction:
    return max(abs(interval[0] - middle), abs(interval[1] - middle))


def _size(near: Near, row: int, column: int) -> Fraction:
    low, high = near.ends(row, column)
    return max(abs(low), abs(high))


def _second_order(center: Point, moves: Sequence[Point], left: Point, modes: Matrix) -> Point:
    """Bound what the exponential has beyond its slopes, entry by entry; each of `moves` counts either way."""
    order, states = len(center), len(modes)
    unit = [[Fraction(i == j) for j in range(order)] for i in range(order)]
    forth = [[modes[i][j] if i < states and j < states else unit[i][j] for j in range(order)] for i in range(order)]
    back = inverted(forth)
    turned = _times_times(back, center, forth)
    blocks = _blocks(turned, states)
    norms = [[_norm(turned, one, two) for two in blocks] for one in blocks]
    for k, block in enumerate(blocks):
        norms[k][k] = _logarithmic_norm(turned, block)
    loose = _times_times(_sizes(back), left, _sizes(forth))
    rest = [[_norm(loose, one, two) for two in blocks] for one in blocks]
    span = [list(row) for row in rest]
    for move in moves:
        seen = _times_times(back, move, forth)
        span = [
            [entry + _norm(seen, one, two) for entry, two in zip(row, blocks, strict=True)]
            for row, one in zip(span, blocks, strict=True)
        ]
    wider = [[a + b for a, b in zip(row, other, strict=True)] for row, other in zip(norms, span, strict=True)]
    whole, (plain, slope), linear = exponential(wider), with_slope(norms, span), with_slope(norms, rest)[1]
    count = range(len(blocks))
    beyond = [
        [
            max(
                whole.ends(i, j)[1] - plain.ends(i, j)[0] - slope.ends(i, j)[0] + linear.ends(i, j)[1],
                Fraction(0),
            )
            for j in count
        ]
        for i in count
    ]
    out = [[_length([forth[i][k] for k in block]) for block in blocks] for i in range(order)]
    into = [[_length([back[k][j] for k in block]) for j in range(order)] for block in blocks]
    return _times_times(out, beyond, into)


def _blocks(turned: Point, states: int) -> list[list[int]]:
    """Return pairs of modes that turn into one another, and all others by themselves."""
    blocks: list[list[int]] = []
    k = 0
    while k < len(turned):
        pair = k + 1 < states and turned[k][k + 1] * turned[k + 1][k] < 0
        blocks.append([k, k + 1] if pair else [k])
        k += len(blocks[-1])
    return blocks


def _norm(matrix: Point, rows: Sequence[int], columns: Sequence[int]) -> Fraction:
    return _length([matrix[i][j] for i in rows for j in columns])


def _length(values: Sequence[Fraction]) -> Fraction:
    if len(values) == 1:
        return abs(values[0])
    return root(sum((value * value for value in values), Fraction(0)))


def _logarithmic_norm(matrix: Point, block: Sequence[int]) -> Fraction:
    """Return a bound of the largest eigenvalue of the symmetric part."""
    if len(block) == 1:
        return matrix[block[0]][block[0]]
    i, j = block
    half, cross = (matrix[i][i] - matrix[j][j]) / 2, (matrix[i][j] + matrix[j][i]) / 2
    return (matrix[i][i] + matrix[j][j]) / 2 + root(half * half + cross * cross)


def _sizes(matrix: Point) -> Point:
    return [[abs(entry) for entry in row] for row in matrix]


def _times_times(a: Point, b: Point, c: Point) -> Point:
    return matrix_product(matrix_product(a, b), c)


def matrix_product(a: Sequence[Sequence[Fraction]], b: Sequence[Sequence[Fraction]]) -> Point:
    """Return the product of two matrices."""
    columns = list(zip(*b, strict=True))
    return [
        [sum((x * y for x, y in zip(row, column, strict=True) if x and y), Fraction(0)) for column in columns]
        for row in a
    ]


def inverted(matrix: Sequence[Sequence[Fraction]]) -> Point:
    """Return the inverse, by Gauss and Jordan.

    Raises
    ------
    ProofError
        when it has none.
    """
    order = len(matrix)
    rows = [[*row, *(Fraction(i == j) for j in range(order))] for i, row in enumerate(matrix)]
    for k in range(order):
        pivot = next((i for i in range(k, order) if rows[i][k]), None)
        if pivot is None:
            raise ProofError("loop.json: a matrix that must be invertible is not")
        rows[k], rows[pivot] = rows[pivot], rows[k]
        lead = rows[k][k]
        rows[k] = [entry / lead for entry in rows[k]]
        for i in range(order):
            if i != k and rows[i][k]:
                factor = rows[i][k]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k], strict=True)]
    return [row[order:] for row in rows]
