"""What a fixed-point program does by itself while its inputs stand still: dead bands and limit cycles, and how large.

Near rest a program is linear in its state but for its roundings: x+ = A x + E n, y = C x + F n, where n holds one
number of at most half a unit in the last place per rounding operation. So whatever it does by itself stays within
sum_j |A^j E| / 2 of where the exact law would settle (Jackson, Digital Filters and Signal Processing, 3rd ed.,
ch. 11): a bound on every limit cycle. Then the program is run from states within that bound, all of them where they
are few enough, as long as the slowest pole asks for, and what does not come to rest, or to another rest, is told; of a
start that does neither in that time nothing is said. State that nothing moves (an integrator at
zero error) is held and makes no cycle. Where a limit acts at rest, or the law has an edge there, there is no bound and
no search.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.design.discretize.unit_circle import poles, within
from firmloop.design.linear.reach import ON_CIRCLE, reach
from firmloop.quantize.ops import EVERY
from firmloop.quantize.program import Op, Program
from firmloop.verify.reference import Machine, run, start_state, working_type

Array = NDArray[np.float64]
States = NDArray[np.int64]

MOST_STARTS = 4096  # states of an exhaustive search
DRAWN_STARTS = 128  # of one that is not
SETTLING = 1000  # steps in which rest is reached, once what the start had is forgotten
MOST_SETTLING = 10_000  # steps of a search: seconds where there is no compiler
LONGEST = 128  # steps of the first window in which a lane must return
HELD = 2**22  # numbers held of one window
SEED = 1


@dataclass(frozen=True, slots=True)
class AtRest:
    """One output of a program whose inputs stand still.

    `bound` limits what roundings alone can move it, either way, None where the program is not linear near rest;
    `cycle` is the largest swing found, `offset` the farthest rest from that of the start; all in `unit`.
    """

    output: str
    unit: str
    bound: float | None
    cycle: float
    offset: float


@dataclass(frozen=True, slots=True)
class ZeroInput:
    """What was found, from how many states; `exhaustive`: these were all within the bound."""

    outputs: tuple[AtRest, ...]
    starts: int
    exhaustive: bool
    unsettled: int  # starts that were still moving without a period: of these nothing is known but the bound
    steps: int  # for which each start was followed

    def as_dict(self) -> dict[str, object]:
        """Return the entry of proof.json."""
        return {
            "starts": self.starts,
            "exhaustive": self.exhaustive,
            "unsettled": self.unsettled,
            "steps": self.steps,
            "outputs": {
                r.output: {"bound": r.bound, "cycle": r.cycle, "offset": r.offset, "unit": r.unit} for r in self.outputs
            },
        }


def zero_input(program: Program) -> ZeroInput | None:
    """Bound and search what `program` does by itself; None in floating point."""
    if not program.arithmetic.startswith("fixed"):
        return None
    machine = Machine(program)
    rest = _rest(program, machine)
    model = _linear(program, machine, rest)
    spread, slowest, bounds = _bounds(program, model) if model is not None else (np.zeros(len(rest)), 0.0, None)
    if bounds is None:
        unknown = tuple(AtRest(value.name, value.unit, None, 0.0, 0.0) for value in program.outputs)
        return ZeroInput(unknown, 0, False, 0, 0)
    starts, exhaustive = _starts(program, rest, spread)
    cycle, offset, unsettled, steps = _search(program, machine, starts, _patience(spread, slowest))
    outputs = tuple(
        AtRest(value.name, value.unit, float(bounds[j]), float(cycle[j]), float(offset[j]))
        for j, value in enumerate(program.outputs)
    )
    return ZeroInput(outputs, len(starts), exhaustive, unsettled, steps)


# -- the linear program -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Model:
    """x+ = a x + e n, y = c x + f n in raw numbers, and what |deviation| of some values must stay below."""

    a: Array  # (n, n)
    e: Array  # (n, k)
    c: Array  # (r, n)
    f: Array  # (r, k)
    conditions: tuple[tuple[Array, float], ...]  # row (n + k), margin


def _linear(program: Program, machine: Machine, rest: list[States]) -> _Model | None:
    """Follow every operation at rest; None where one of them has an edge there."""
    order, noises = len(program.state), len(program.body)
    named = machine.named(machine.step(_still(program, 1), rest))
    rows: dict[str, Array | None] = {f"in.{v.name}": np.zeros(order + noises) for v in program.inputs}
    rows |= {f"self.{v.name}": row for v, row in zip(program.state, np.eye(order, order + noises), strict=True)}
    rows |= {f"table.{table.name}": np.zeros(order + noises) for table in program.tables}
    conditions: list[tuple[Array, float]] = []
    for k, op in enumerate(program.body):
        rows[op.result.name] = _row(op, rows, named, order + k, order, conditions)
    found = [rows[a.source] for a in (*program.next_state, *program.results)]
    if any(row is None for row in found):
        return None
    table = np.array(found, dtype=np.float64).reshape(-1, order + noises)
    return _Model(
        table[:order, :order], table[:order, order:], table[order:, :order], table[order:, order:], tuple(conditions)
    )


def _row(
    op: Op,
    rows: Mapping[str, Array | None],
    named: Mapping[str, States],
    own: int,
    order: int,
    conditions: list[tuple[Array, float]],
) -> Array | None:
    """Return how the result depends on state and roundings; None where that has an edge at rest."""
    width = len(next(row for row in rows.values() if row is not None))
    still = np.zeros(width)
    given: list[Array | None] = [rows[a] if isinstance(a, str) else still for a in op.arguments]
    moving = [k for k, row in enumerate(given) if row is None or np.any(row != 0)]
    if not moving:
        return still
    if any(given[k] is None for k in moving):
        return None
    if EVERY[op.function].record:
        return None  # a table's operation
    values = [_one(named[a]) if isinstance(a, str) else float(a) for a in op.arguments]
    a, b = given[0], given[1] if len(given) > 1 else still
    assert a is not None and b is not None
    match op.function:
        case "add":
            return a + b
        case "sub":
            return a - b
        case "neg":
            return -a
        case "copy":
            return a
        case "shl":
            return a * float(2.0 ** values[1])
        case "mac" | "mul_add" | "mul_add_short":
            c = given[2]
            assert c is not None
            product = _added(op.function, b * values[2] + c * values[1], own, order)
            return None if {1, 2} <= set(moving) else a + product
        case "asr" | "high_down":  # rounded down: up to a whole unit
            return 2.0 * _rounded(a * float(2.0 ** -values[1]) / 2.0, own, order)
        case "shr" | "high":
            return _rounded(a * float(2.0 ** -values[1]), own, order)
        case "mul" | "wide" | "mul_shift" | "mul_down":
            return None if moving == [0, 1] else _product(op.function, a, b, values, own, order)
        case "select":
            return None if 0 in moving else given[1 if values[0] else 2]
        case "min" | "max" | "clamp" | "wrap":
            return _kept(a, values, op.function, conditions) if moving == [0] else None
        case "lt" | "le" | "eq" | "ne" if values[0] != values[1]:
            conditions.append((a - b, abs(values[0] - values[1])))
            return still
        case _:
            return None  # two that are equal, a truth value of one that may change, a magnitude


def _product(function: str, a: Array, b: Array, values: Sequence[float], own: int, order: int) -> Array:
    """Return how a product depends on them, of whose two factors one stands still."""
    shift = values[2] if function in ("mul_shift", "mul_down") else 0.0
    row: Array = (a * values[1] + b * values[0]) * 2.0**-shift
    if function == "mul_down":  # rounded down: up to a whole unit
        return 2.0 * _rounded(row / 2.0, own, order)
    return _rounded(row, own, order) if shift else row


def _added(function: str, product: Array, own: int, order: int) -> Array:
    """Return how a product that is added depends on them, given how it does before it is rounded."""
    if function == "mul_add_short":  # rounded down: up to a whole unit
        return 2.0 * _rounded(product * 2.0**-17, own, order)
    return _rounded(product * 2.0**-32, own, order) if function == "mul_add" else product


def _one(value: object) -> float:
    """Return the value of the only lane."""
    return float(np.asarray(value).ravel()[0])


def _rounded(row: Array, own: int, order: int) -> Array:
    """Add the rounding of operation `own`; a whole multiple of state variables is exact."""
    row = row.copy()
    if np.any(row[order:]) or not np.array_equal(row, np.round(row)):
        row[own] += 1.0
    return row


def _kept(a: Array, values: list[float], function: str, conditions: list[tuple[Array, float]]) -> Array | None:
    """Return the row of a limited value: its own inside the limits, none beyond one, no linear one at one."""
    half = 2.0 ** (31 - values[1]) if function == "wrap" else math.inf
    low = values[1] if function in ("max", "clamp") else -half
    high = {"min": values[1], "max": math.inf, "clamp": values[-1], "wrap": half - 1}[function]
    margin = min(values[0] - low, high - values[0])
    if margin == 0 or (function == "wrap" and margin < 0):  # beyond, it is another number
        return None
    conditions.append((a, abs(margin)))
    return a if margin > 0 else np.zeros_like(a)


def _bounds(program: Program, model: _Model) -> tuple[Array, float, Array | None]:
    """Return the raw bound of each state, the slowest pole's distance from 0, and the physical bound of each output.

    There is none where it cannot be given.
    """
    order = len(model.a)
    held = np.array(
        [not np.any(model.e[j]) and np.array_equal(model.a[j], np.eye(order)[j]) for j in range(order)], dtype=bool
    )
    free = ~held
    a, e = model.a[np.ix_(free, free)], model.e[free]
    spread = np.zeros(order)
    if not within(a, 1 - ON_CIRCLE):
        return np.zeros(order), 0.0, None
    half = np.full(e.shape[1], 0.5)
    spread[free] = reach(a, e, -half, half)[1]
    for row, margin in model.conditions:
        if np.abs(row[:order]) @ spread + np.abs(row[order:]) @ half >= margin:
            return np.zeros(order), 0.0, None
    scale = np.array([2.0**-v.number.fraction for v in program.outputs])
    slowest = float(np.max(np.abs(poles(a)), initial=0.0))
    return spread, slowest, (np.abs(model.c) @ spread + np.abs(model.f) @ half) * scale


# -- the search -------------------------------------------------------------------------------------------------------


def _still(program: Program, lanes: int) -> list[States]:
    """Return inputs that stand at zero, or at the end of their range next to it."""
    return [np.full(lanes, min(max(0, int(v.low)), int(v.high)), dtype=np.int64) for v in program.inputs]


def _rest(program: Program, machine: Machine) -> list[States]:
    """Return the state after a while of still inputs from the start."""
    state = start_state(program, 1)
    for _ in range(LONGEST):
        values = machine.step(_still(program, 1), state)
        state = [np.broadcast_to(values[s], 1) for s in machine.next]
    return state


def _starts(program: Program, rest: list[States], spread: Array) -> tuple[States, bool]:
    """Return start states (lanes, n): all within the bound where they are few, else drawn from twice of it."""
    center = np.array([int(x[0]) for x in rest], dtype=np.int64)
    whole = np.array([math.floor(x) for x in spread], dtype=np.int64)
    if math.prod(int(2 * w + 1) for w in whole) <= MOST_STARTS:
        offsets = list(itertools.product(*(range(-w, w + 1) for w in whole)))
        return _inside(program, center + np.array(offsets, dtype=np.int64).reshape(len(offsets), -1)), True
    random = np.random.default_rng(SEED)
    return _inside(program, center + random.integers(-2 * whole, 2 * whole + 1, size=(DRAWN_STARTS, len(whole)))), False


def _inside(program: Program, states: States) -> States:
    low, high = ([int(getattr(v, end)) for v in program.state] for end in ("low", "high"))
    return np.clip(states, low, high) if states.shape[1] else states


def _patience(spread: Array, slowest: float) -> int:
    """Return the steps in which the linear program forgets a start: the slowest pole brings it within half a unit."""
    far = 4.0 * float(np.max(spread, initial=0.0))  # a start is within twice the spread; half a unit is rest
    steps = math.log(far) / -math.log(slowest) if far > 1 and 0 < slowest < 1 else 0.0
    return SETTLING + math.ceil(min(steps, MOST_SETTLING - SETTLING))


def _search(program: Program, machine: Machine, starts: States, patience: int) -> tuple[Array, Array, int, int]:
    """Return the largest swing and the farthest rest of every output, how many starts did neither, and the steps.

    A lane has come to rest, or cycles, where it returns to the state that a window of steps began with; windows grow
    (R. P. Brent, BIT 20 (1980) 176-184), so that a long cycle is seen too.
    """
    lanes, width = starts.shape
    state = [np.array(column, dtype=working_type(program)) for column in starts.T]
    steps, window, most = 0, LONGEST, max(LONGEST, HELD // (lanes * (width + len(program.outputs))))
    while True:
        still = np.array(_still(program, lanes), dtype=np.int64).T[:, None, :]
        trace = run(program, np.broadcast_to(still, (lanes, window + 1, still.shape[2])), start=state)
        states = np.asarray(trace.state)  # (lanes, steps, n)
        returned = np.any(np.all(states[:, 1:] == states[:, :1], axis=2), axis=1)
        settled, steps = steps >= patience, steps + window
        if settled or np.all(returned):
            break
        state, window = list(states[:, -1].T), min(2 * window, most)
    scale = np.array([2.0**-v.number.fraction for v in program.outputs])
    at_start = machine.step(_still(program, 1), _rest(program, machine))
    origin = np.array([_one(at_start[s]) for s in machine.results])
    outputs = np.asarray(trace.outputs, dtype=np.float64)[returned]  # (lanes, steps, r)
    low, high = outputs.min(axis=1), outputs.max(axis=1)
    swing = np.max(high - low, axis=0, initial=0.0) * scale
    away = np.where(high == low, np.abs(high - origin), 0.0)
    return swing, np.max(away, axis=0, initial=0.0) * scale, int(np.count_nonzero(~returned)), steps
