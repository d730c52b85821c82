"""The operations a Program may hold: each has one meaning, told three times, in Python, in C and as a bound.

`run` works on numpy arrays of one element type (int64 holding 32-bit values in fixed point, float32 or float64 in
floating point), so one call computes many independent controllers. `c` is the same in C. `bound` gives the interval
of the result from the intervals of the arguments: exact integers in fixed point; in floating point the true
interval, which `floating.py` then widens by one rounding. Comparisons return 0 or 1.

Rounding is to nearest, halves up: floor(x / 2**s + 1/2). `asr`, and the operations whose names end in `_down`, round
down: floor(x / 2**s), and so does `mul_add_short`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.design.outcome import CAPPED, INFEASIBLE
from firmloop.quantize.formats.quadratic import rows_of
from firmloop.quantize.formats.rti import course_from
from firmloop.quantize.program import Table
from firmloop.quantize.twins import curved, rows, sweeps, trees
from firmloop.quantize.twins.elementary import (
    BEYOND_ONE,
    cosine,
    exponential,
    exponential_bound,
    hyperbolic_tangent,
    quotient,
    quotient_bound,
    sine,
)
from firmloop.quantize.twins.qp import Rows, solve
from firmloop.quantize.twins.root import root, root_bound
from firmloop.quantize.twins.rti import Model, improve
from firmloop.quantize.twins.rti_course import RtiCourse

Operand = Any  # numpy array, or a literal of the same element type
Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation.

    Its C text is a format of the arguments' texts; `{rest}` stands for all but the first, with commas
    between them, `{others}` for all but the first two.
    """

    says: str
    run: Callable[..., Any]
    bound: Callable[..., Interval]
    c: Mapping[str, str]  # "fixed", "float32", "float64", where it exists there: a format of the arguments' C text
    truth: bool = False  # the result is 0 or 1
    whole: tuple[int, ...] = ()  # which arguments are literal integers in any arithmetic
    record: str = ""  # C type of a result that is several numbers
    table: Callable[[Table, np.dtype[Any]], Any] | None = None  # makes the first argument ready for `run`
    support: str = ""  # header with its C, where that is not the one of every program


def _both(text: str, f32: str = "", f64: str = "") -> dict[str, str]:
    return {"fixed": text, "float32": f32 or text, "float64": f64 or f32 or text}


def _helper(name: str, arguments: str) -> dict[str, str]:
    return _both(f"{name}_i32({arguments})", f"{name}_f32({arguments})", f"{name}_f64({arguments})")


def _function(says: str, name: str, run: Callable[..., Any], bound: Callable[..., Interval]) -> Operation:
    return Operation(says, run, bound, {"float32": f"fl_{name}_f32({{0}})", "float64": f"fl_{name}_f64({{0}})"})


def _down(says: str, name: str) -> Operation:
    def bound(a: Interval, s: int) -> Interval:
        return int(a[0]) >> int(s), int(a[1]) >> int(s)

    return Operation(says, lambda a, s: a >> s, bound, {"fixed": f"{name}({{0}}, {{1}}U)"}, whole=(1,))


def _curved(
    says: str, run: Callable[..., Any], bound: Callable[..., Interval], c: str, whole: tuple[int, ...]
) -> Operation:
    return Operation(says, run, bound, {"fixed": c}, whole=whole, support="fl_curved_i32.h")


def shift_right(a: Operand, s: int) -> Operand:
    """Round a / 2**s to nearest, halves up, as in C: half of 2**s added to a 64-bit sum could overflow."""
    return (a >> s) + ((a >> (s - 1)) & 1)


def _multiply_shift(a: Operand, b: Operand, s: int) -> Operand:
    return (a * b + (1 << (s - 1))) >> s


def _minimum(a: Operand, b: Operand) -> Operand:
    return np.where(a < b, a, b)  # a NaN in `a` yields `b`, as in C


def _maximum(a: Operand, b: Operand) -> Operand:
    return np.where(a > b, a, b)


def _limited(x: Operand, low: Operand, high: Operand) -> Operand:
    return np.where(x >= low, np.where(x > high, high, x), low)  # a NaN yields `low`


def _limited_bound(x: Interval, low: float, high: float) -> Interval:
    return min(max(x[0], low), high), min(max(x[1], low), high)


def _truth(value: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.asarray(value).astype(np.int64)


def _product(a: Interval, b: Interval) -> Interval:
    corners = [x * y for x in a for y in b]
    return min(corners), max(corners)


def _compared(*_: Interval) -> Interval:
    return 0, 1


def _absolute(a: Interval) -> Interval:
    low, high = a
    return (0 if low <= 0 <= high else min(abs(low), abs(high))), max(abs(low), abs(high))


# Operations between two limits, given as numbers.
LIMITS = ("clamp", "outside", "beyond")

OPERATIONS: dict[str, Operation] = {
    "add": Operation("sum", lambda a, b: a + b, lambda a, b: (a[0] + b[0], a[1] + b[1]), _both("{0} + {1}")),
    "sub": Operation("difference", lambda a, b: a - b, lambda a, b: (a[0] - b[1], a[1] - b[0]), _both("{0} - {1}")),
    "mul": Operation("product", lambda a, b: a * b, _product, _both("{0} * {1}")),
    "div": Operation("quotient", quotient, quotient_bound, {"float32": "{0} / {1}", "float64": "{0} / {1}"}),
    "sin": _function("sine", "sin", sine, lambda a: (-BEYOND_ONE, BEYOND_ONE)),
    "cos": _function("cosine", "cos", cosine, lambda a: (-BEYOND_ONE, BEYOND_ONE)),
    "exp": _function("exponential function", "exp", exponential, exponential_bound),
    "tanh": _function("hyperbolic tangent", "tanh", hyperbolic_tangent, lambda a: (-BEYOND_ONE, BEYOND_ONE)),
    "sqrt": Operation(
        "square root",
        root,
        root_bound,
        {"float32": "fl_sqrt_f32({0})", "float64": "fl_sqrt_f64({0})"},
        support="fl_root.h",
    ),
    "turn": _curved(
        "an angle as share of a whole turn of 2**32",
        curved.turn,
        curved.turn_bound,
        "fl_turn_i32({0}, {1}, {2}U)",
        (1, 2),
    ),
    "turn_sine": _curved("sine of a share of a turn", curved.turn_sine, curved.sine_bound, "fl_turn_sine_i32({0})", ()),
    "turn_cosine": _curved(
        "cosine of a share of a turn", curved.turn_cosine, curved.sine_bound, "fl_turn_cosine_i32({0})", ()
    ),
    "whole_root": _curved(
        "square root of a value times a power of two",
        curved.whole_root,
        curved.root_bound,
        "fl_whole_root_i32({0}, {1}U)",
        (1,),
    ),
    "inverse": _curved(
        "a power of two over a value above 0",
        curved.inverse,
        curved.inverse_bound,
        "fl_inverse_i32({0}, {1}U, {2}U)",
        (1, 2),
    ),
    "copy": Operation("the same", lambda a: a, lambda a: a, _both("{0}")),
    "neg": Operation("negation", lambda a: -a, lambda a: (-a[1], -a[0]), _both("-{0}")),
    "mul_shift": Operation(
        "64-bit product, rounded to nearest",
        _multiply_shift,
        lambda a, b, s: tuple(shift_right(int(x), int(s)) for x in _product(a, b)),
        _both("fl_mul_shift_i32({0}, {1}, {2}U)"),
        whole=(2,),
    ),
    "wide": Operation(
        "64-bit product, the start of a sum of products",
        lambda a, b: a * b,
        _product,
        {"fixed": "fl_wide_i64({0}, {1})"},
    ),
    "mac": Operation(
        "a product added to a 64-bit sum",
        lambda acc, a, b: acc + a * b,
        lambda acc, a, b: (acc[0] + _product(a, b)[0], acc[1] + _product(a, b)[1]),
        {"fixed": "fl_mac_i64({0}, {1}, {2})"},
    ),
    "high": Operation(
        "a 64-bit sum of products, rounded to nearest",
        shift_right,
        lambda acc, s: (shift_right(int(acc[0]), int(s)), shift_right(int(acc[1]), int(s))),
        {"fixed": "fl_high_i32({0}, {1}U)"},
        whole=(1,),
    ),
    "mul_add": Operation(
        "a value and a product over 2**32, rounded to nearest",
        lambda first, a, b: first + ((a * b + (1 << 31)) >> 32),
        lambda first, a, b: tuple(x + shift_right(int(y), 32) for x, y in zip(first, _product(a, b), strict=True)),
        {"fixed": "fl_mul_add_i32({0}, {1}, {2})"},
    ),
    "mul_add_short": Operation(
        "a value and the product of a number of 16 bits over 2**16, rounded down",
        lambda first, x, b: first + ((x * b) >> 16),
        lambda first, x, b: tuple(y + (int(z) >> 16) for y, z in zip(first, _product(x, b), strict=True)),
        {"fixed": "fl_mul_add_short_i32({0}, {1}, {2})"},
    ),
    "mul_down": Operation(
        "64-bit product, rounded down",
        lambda a, b, s: (a * b) >> s,
        lambda a, b, s: (int(_product(a, b)[0]) >> int(s), int(_product(a, b)[1]) >> int(s)),
        {"fixed": "fl_mul_down_i32({0}, {1}, {2}U)"},
        whole=(2,),
    ),
    "high_down": _down("a 64-bit sum of products, rounded down into its format", "fl_down_i32"),
    "asr": _down("divided by a power of two, rounded down", "fl_asr_i32"),
    "shr": Operation(
        "divided by a power of two, rounded to nearest",
        shift_right,
        lambda a, s: (shift_right(int(a[0]), int(s)), shift_right(int(a[1]), int(s))),
        _both("fl_shr_i32({0}, {1}U)"),
        whole=(1,),
    ),
    "wrap": Operation(
        "read as a number of so many bits less, the upper ones of the word left out",
        lambda a, s: (a << (32 + s)) >> (32 + s),
        lambda a, s: a if -(2 ** (31 - s)) <= a[0] and a[1] < 2 ** (31 - s) else (-(2 ** (31 - s)), 2 ** (31 - s) - 1),
        {"fixed": "fl_wrap_i32({0}, {1}U)"},
        whole=(1,),
    ),
    "shl": Operation(
        "multiplied by a power of two",
        lambda a, s: a << s,
        lambda a, s: (int(a[0]) << int(s), int(a[1]) << int(s)),
        _both("fl_shl_i32({0}, {1}U)"),
        whole=(1,),
    ),
    "min": Operation(
        "smaller", _minimum, lambda a, b: (min(a[0], b[0]), min(a[1], b[1])), _helper("fl_min", "{0}, {1}")
    ),
    "max": Operation(
        "larger", _maximum, lambda a, b: (max(a[0], b[0]), max(a[1], b[1])), _helper("fl_max", "{0}, {1}")
    ),
    "clamp": Operation("limited to a range", _limited, _limited_bound, _helper("fl_clamp", "{0}, {1}, {2}")),
    "abs": Operation("magnitude", lambda a: np.where(a < 0, -a, a), _absolute, _helper("fl_abs", "{0}")),
    "lt": Operation("less", lambda a, b: _truth(a < b), _compared, _both("({0} < {1}) ? 1 : 0"), truth=True),
    "le": Operation("not more", lambda a, b: _truth(a <= b), _compared, _both("({0} <= {1}) ? 1 : 0"), truth=True),
    "eq": Operation("equal", lambda a, b: _truth(a == b), _compared, _both("({0} == {1}) ? 1 : 0"), truth=True),
    "ne": Operation("different", lambda a, b: _truth(a != b), _compared, _both("({0} != {1}) ? 1 : 0"), truth=True),
    "outside": Operation(
        "limited, or no number",
        lambda x, low, high: _truth(np.where(x >= low, x > high, True)),
        _compared,
        {"float32": "fl_outside_f32({0}, {1}, {2})", "float64": "fl_outside_f64({0}, {1}, {2})"},
        truth=True,
    ),
    "beyond": Operation(
        "the limit that a value outside of a range is beyond, the low one for no number",
        lambda x, low, high: np.where(x >= low, high, low),
        lambda x, low, high: (low, high),
        {"float32": "fl_beyond_f32({0}, {1}, {2})", "float64": "fl_beyond_f64({0}, {1}, {2})"},
    ),
    "none": Operation(
        "no number",
        lambda a: _truth(a != a),
        _compared,
        {"float32": "fl_none_f32({0})", "float64": "fl_none_f64({0})"},
        truth=True,
    ),
    "none_where": Operation(
        "no number, asked only where a condition holds",
        lambda c, a: np.where(c != 0, _truth(a != a), 0),
        _compared,
        {"float32": "({0} != 0) ? fl_none_f32({1}) : 0", "float64": "({0} != 0) ? fl_none_f64({1}) : 0"},
        truth=True,
    ),
    "nought": Operation(
        "0, or no number where one of two is none or infinite",
        lambda a, b: (a - a) * b,
        lambda a, b: (0, 0),
        {"float32": "fl_nought_f32({0}, {1})", "float64": "fl_nought_f64({0}, {1})"},
    ),
    "lost": Operation(
        "no number, or an infinite one",
        lambda a: _truth((a - a) != (a - a)),
        _compared,
        {"float32": "fl_lost_f32({0})", "float64": "fl_lost_f64({0})"},
        truth=True,
    ),
    "and": Operation("both", lambda a, b: a & b, _compared, _both("{0} & {1}"), truth=True),
    "or": Operation("either", lambda a, b: a | b, _compared, _both("{0} | {1}"), truth=True),
    "not": Operation("negated truth", lambda a: 1 - a, _compared, _both("1 - {0}"), truth=True),
    "select": Operation(
        "one of two",
        lambda c, a, b: np.where(c != 0, a, b),
        lambda c, a, b: (min(a[0], b[0]), max(a[1], b[1])),
        _both("({0} != 0) ? {1} : {2}"),
    ),
}


def _plan(rows: Rows, *parameters: Operand) -> Operand:
    """Return the moves, then the status, one row each, a column a lane."""
    stacked = np.stack(np.broadcast_arrays(*(np.atleast_1d(p) for p in parameters)), axis=-1)
    solution = solve(rows, stacked)
    return np.vstack([solution.moves.T, solution.status.astype(stacked.dtype)])


def _course(course: RtiCourse, model: Model, *parameters: Operand) -> Operand:
    """Return the results, then the status, one row each, a column a lane."""
    stacked = np.stack(np.broadcast_arrays(*(np.atleast_1d(p) for p in parameters)), axis=-1)
    results, status = improve(course, model, stacked)
    return np.vstack([results.T, status.astype(stacked.dtype)])


def _unbounded(*_: Interval) -> Interval:
    return -np.inf, np.inf


# Operations over tables, and those that take their results apart.
LARGE: dict[str, Operation] = {
    "solve": Operation(
        "optimum of a quadratic program with constant data",
        _plan,
        _unbounded,
        _both("fl_qp(&{0}, (const fl_real[]){{ {rest} }})"),
        record="fl_plan_t",
        table=rows_of,
    ),
    "sweeps": Operation(
        "near the optimum of a quadratic program with constant data, by a fixed number of sweeps",
        sweeps.run,
        lambda moves, *_: moves,
        _both("fl_sweeps(&{0}, (const fl_real[]){{ {rest} }})")
        | {"fixed": "fl_sweeps_i32(&{0}, (const int32_t[]){{ {rest} }})"},
        record="fl_plan_t",
        table=sweeps.ready,
    ),
    "tree": Operation(
        "optimum of a quadratic program with constant data, from a table of its regions",
        trees.run,
        lambda moves, *_: moves,
        _both("fl_tree(&{0}, (const fl_real[]){{ {rest} }})")
        | {"fixed": "fl_tree_i32(&{0}, (const int32_t[]){{ {rest} }})"},
        record="fl_plan_t",
        table=trees.ready,
    ),
    "improve": Operation(
        "a step toward the optimum of a nonlinear program, from the plan of the sample before",
        _course,
        _unbounded,
        _both("fl_rti(&{0}, {1}, (const fl_real[]){{ {others} }})"),
        record="fl_plan_t",
        table=course_from,
    ),
    "rows": Operation(
        "sums of the same values, each with constant weights of its own",
        rows.run,
        _unbounded,
        {name: "fl_rows(&{0}, (const fl_real[]){{ {rest} }})" for name in ("float32", "float64")},
        record="fl_sums_t",
        table=rows.ready,
    ),
    "row": Operation(
        "one of the sums", lambda sums, k: sums[k], lambda sums, k: sums, _both("{0}.row[{1}]"), whole=(1,)
    ),
    "move": Operation(
        "one of the moves", lambda plan, k: plan[k], lambda plan, k: plan, _both("{0}.move[{1}]"), whole=(1,)
    ),
    "capped": Operation(
        "the search was cut short",
        lambda plan: _truth(plan[-1] == CAPPED),
        _compared,
        _both("({0}.status == FL_QP_CAPPED) ? 1 : 0"),
        truth=True,
    ),
    "infeasible": Operation(
        "no moves keep every limit",
        lambda plan: _truth(plan[-1] == INFEASIBLE),
        _compared,
        _both("({0}.status == FL_QP_INFEASIBLE) ? 1 : 0"),
        truth=True,
    ),
}

EVERY = OPERATIONS | LARGE


def as_intervals(function: str, arguments: list[Interval | int | float]) -> list[object]:
    """Literals become degenerate intervals, except shifts and clamp limits, which the rules take as numbers."""
    plain = (1, 2) if function in LIMITS else EVERY[function].whole
    return [a if isinstance(a, tuple) or k in plain else (a, a) for k, a in enumerate(arguments)]
