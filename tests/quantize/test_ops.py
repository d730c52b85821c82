"""The Python and the C of every operation give the same bits."""

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.codegen.environment import text_of
from firmloop.codegen.view import c_type
from firmloop.identify.simulation.compiler import shared_library
from firmloop.quantize.ops import OPERATIONS
from firmloop.quantize.program import Number
from firmloop.verify.build.host import FLAGS

STYLES = {"fixed": Number("fixed", 32, 0), "float32": Number("float", 32, 0), "float64": Number("float", 64, 0)}
KINDS = {"fixed": "i8", "float32": "f4", "float64": "f8"}
SHIFTED = {"shr", "asr", "wrap", "shl", "mul_shift", "mul_down"}
WIDE = {"wide", "mac", "high", "high_down"}  # of 64-bit sums
CURVED = {name for name, operation in OPERATIONS.items() if operation.support == "fl_curved_i32.h"}  # test_curved.py
TRUTHS = {"and", "or", "not"}
LOGIC_OK = {
    style: {name for name, operation in OPERATIONS.items() if style in operation.c}
    - WIDE
    - CURVED
    - (SHIFTED if style != "fixed" else set())
    for style in STYLES
}
WORD = 2**31
CORNERS = [0, 1, -1, 2, -2, 3, -3, 2**15, -(2**15), 2**16 - 1, 2**30, -(2**30), 2**31 - 1, -(2**31), -(2**31) + 1]
FLOAT_CORNERS = [0.0, -0.0, 1.0, -1.0, 1e-45, -1e-45, 5e-324, 3.4e38, -3.4e38, 1.7e308, np.inf, -np.inf, np.nan, 0.1]


WIDE_SUM = """\
void wide_sum(const int32_t *a, const int32_t *b, uint32_t n, uint32_t s, int32_t *out);
void wide_sum(const int32_t *a, const int32_t *b, uint32_t n, uint32_t s, int32_t *out)
{
    int64_t sum = fl_wide_i64(a[0], b[0]);
    for (uint32_t i = 1; i < n; i++) { sum = fl_mac_i64(sum, a[i], b[i]); }
    *out = fl_high_i32(sum, s);
}
"""


def arity(name: str) -> int:
    return next(iter(OPERATIONS[name].c.values())).count("{")


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    """One C function per operation and number type, over arrays; shifts are arrays too."""
    headers = ("fl_fixed.h", "fl_float.h", *sorted({each.support for each in OPERATIONS.values()} - {""}))
    text = [f'#include "{header}"' for header in headers]
    for style, number in STYLES.items():
        kind = c_type(number)
        for name in sorted(LOGIC_OK[style]):
            operation = OPERATIONS[name]
            own = "int32_t" if name in TRUTHS else kind
            form = operation.c["fixed" if name in TRUTHS else style]
            names = ["a", "b", "c", "d"][: arity(name)]
            kinds = [own] * len(names)
            values = [f"{n}[i]" for n in names]
            if name == "select":
                kinds[0] = "int32_t"
            if name in SHIFTED:
                kinds[-1] = "uint32_t"
                form = form.replace("U)", ")")
            result = "int32_t" if operation.truth else own
            arguments = ", ".join(f"const {k} *{n}" for k, n in zip(kinds, names, strict=True))
            head = f"void {style}_{name}({arguments}, {result} *out, uint32_t n)"
            body = f"for (uint32_t i = 0; i < n; i++) {{ out[i] = {form.format(*values)}; }}"
            text.append(f"{head};\n{head}\n{{\n{body}\n}}")
    text.append(WIDE_SUM)
    files = {"ops.c": "\n".join(text) + "\n", **{header: text_of(f"support/{header}") for header in headers}}
    flags = [f for f in FLAGS if f != "-Wsign-conversion"]  # shifts come from arrays here, not from literals
    return ctypes.CDLL(str(shared_library(files, ["ops.c"], flags)))


def call(library: ctypes.CDLL, style: str, name: str, columns: list[np.ndarray]) -> np.ndarray:
    own = "i4" if name in TRUTHS or OPERATIONS[name].truth else {"fixed": "i4", "float32": "f4", "float64": "f8"}[style]
    out = np.empty(len(columns[0]), dtype=own)
    getattr(library, f"{style}_{name}")(
        *[c.ctypes.data_as(ctypes.c_void_p) for c in columns],
        out.ctypes.data_as(ctypes.c_void_p),
        ctypes.c_uint32(len(out)),
    )
    return out


def check_fixed(library: ctypes.CDLL, name: str, rows: list[tuple[int, ...]], shifts: list[int]) -> None:
    """Keep the rows whose results fit, as the generator proves for every call it emits."""
    operation = OPERATIONS[name]
    kept, expected = [], []
    for row, s in zip(rows, shifts, strict=True):
        values = [abs(v) % 2 for v in row] if name in TRUTHS else list(row)
        if name in SHIFTED:
            values[-1] = s
        if name == "clamp":
            values[1], values[2] = min(values[1:]), max(values[1:])
        if name == "mul_add_short":
            values[1] = (values[1] + 2**15) % 2**16 - 2**15
        if name == "shr" and values[0] + (1 << (values[1] - 1)) >= WORD:
            continue
        result = (
            int(np.asarray(operation.run(*[np.int64(v) for v in values[:-1]], values[-1])))
            if (name in SHIFTED)
            else int(np.asarray(operation.run(*[np.int64(v) for v in values])))
        )
        if -WORD <= result < WORD:
            kept.append(values)
            expected.append(result)
    if not kept:
        return
    columns = [np.array(c, dtype="u4" if name in SHIFTED and k == arity(name) - 1 else "i4")
               for k, c in enumerate(zip(*kept, strict=True))]  # fmt: skip
    np.testing.assert_array_equal(call(library, "fixed", name, columns), np.array(expected))


@pytest.mark.parametrize("name", sorted(LOGIC_OK["fixed"]))
def test_fixed_corners(library: ctypes.CDLL, name: str) -> None:
    random = np.random.default_rng(1)
    n = arity(name)
    grid = np.array(np.meshgrid(*[CORNERS] * n)).reshape(n, -1).T
    noise = random.integers(-WORD, WORD, size=(4000, n)) >> random.integers(0, 31, size=(4000, 1))
    rows = [tuple(int(v) for v in row) for row in np.concatenate([grid, noise])]
    shifts = [int(s) for s in random.integers(1, 62 if name == "mul_shift" else 30, size=len(rows))]
    check_fixed(library, name, rows, shifts)


@settings(max_examples=300, deadline=None)
@given(st.integers(-WORD, WORD - 1), st.integers(-WORD, WORD - 1), st.integers(1, 62))
def test_multiply_shift_is_round_half_up(library: ctypes.CDLL, a: int, b: int, s: int) -> None:
    result = (a * b + 2 ** (s - 1)) // 2**s
    if -WORD <= result < WORD:
        columns = [np.array([a], "i4"), np.array([b], "i4"), np.array([s], "u4")]
        assert call(library, "fixed", "mul_shift", columns)[0] == result


@settings(max_examples=300, deadline=None)
@given(*[st.integers(-WORD, WORD - 1)] * 3)
def test_a_product_is_rounded_half_up_as_it_is_added(library: ctypes.CDLL, first: int, a: int, b: int) -> None:
    result = first + (a * b + 2**31) // 2**32
    if -WORD <= result < WORD:
        columns = [np.array([x], "i4") for x in (first, a, b)]
        assert call(library, "fixed", "mul_add", columns)[0] == result


@settings(max_examples=300, deadline=None)
@given(*[st.integers(-bits, bits - 1) for bits in (WORD, 2**15, WORD)])
def test_a_product_of_a_short_number_is_rounded_down_as_it_is_added(
    library: ctypes.CDLL, first: int, x: int, b: int
) -> None:
    result = first + x * b // 2**16
    if -WORD <= result < WORD:
        columns = [np.array([each], "i4") for each in (first, x, b)]
        assert call(library, "fixed", "mul_add_short", columns)[0] == result


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(-WORD, WORD - 1)] * 2), min_size=1, max_size=5),
    st.integers(1, 62),
)
def test_a_sum_of_products_is_rounded_once(library: ctypes.CDLL, products: list[tuple[int, int]], s: int) -> None:
    sums = np.cumsum([a * b for a, b in products], dtype=object)
    result = (int(sums[-1]) + 2 ** (s - 1)) // 2**s
    if all(-(2**63) <= total < 2**63 for total in (*sums, sums[-1] + 2 ** (s - 1))) and -WORD <= result < WORD:
        ops = {name: OPERATIONS[name].run for name in WIDE}
        total = ops["wide"](*(np.int64(x) for x in products[0]))
        for a, b in products[1:]:
            total = ops["mac"](total, np.int64(a), np.int64(b))
        assert int(ops["high"](total, s)) == result
        columns = [np.array([p[k] for p in products], "i4") for k in range(2)]
        out = ctypes.c_int32()
        library.wide_sum(
            *(c.ctypes.data_as(ctypes.c_void_p) for c in columns),
            ctypes.c_uint32(len(products)),
            ctypes.c_uint32(s),
            ctypes.byref(out),
        )
        assert out.value == result


@pytest.mark.parametrize("name", sorted(WIDE))
def test_the_bounds_of_a_wide_sum_are_exact(name: str) -> None:
    bound, run = OPERATIONS[name].bound, OPERATIONS[name].run
    for low, high, other in ((-7, 5, 3), (2, 9, 11), (-(2**30), 2**31 - 1, 31)):
        rest = {"wide": ((-3, other),), "mac": ((-3, 4), (other, other))}.get(name, (other,))
        extras = {"wide": [(-3,), (other,)], "mac": [(-3, other), (4, other)]}.get(name, [(other,)])
        ends = [run(x, *extra) for x in (low, high) for extra in extras]
        assert bound((low, high), *rest) == (min(ends), max(ends))


@pytest.mark.parametrize("style", ["float32", "float64"])
@pytest.mark.parametrize("name", sorted(LOGIC_OK["float32"]))
def test_float_bits(library: ctypes.CDLL, style: str, name: str) -> None:
    random = np.random.default_rng(2)
    kind = np.dtype(KINDS[style])
    n = arity(name)
    with np.errstate(all="ignore"):
        grid = np.array(np.meshgrid(*[FLOAT_CORNERS] * n)).reshape(n, -1).T.astype(kind)
        words = random.integers(0, 2 ** (8 * kind.itemsize), size=(20000, n), dtype=f"u{kind.itemsize}").view(kind)
        near = random.normal(size=(20000, n)).astype(kind)
        rows = np.concatenate([grid, words, near])
        columns = [np.ascontiguousarray(rows[:, k]) for k in range(n)]
        if name in TRUTHS:
            columns = [np.where(c > 0, 1, 0).astype("i4") for c in columns]
        if name == "select":
            columns[0] = np.where(columns[0] > 0, 1, 0).astype("i4")
        expected = np.asarray(OPERATIONS[name].run(*columns))
    got = call(library, style, name, columns)
    if got.dtype.kind == "f":
        bits = f"u{got.dtype.itemsize}"
        same = got.view(bits) == expected.astype(got.dtype).view(bits)
        assert np.all(same | (np.isnan(got) & np.isnan(expected)))  # which NaN is not defined by IEEE 754
    else:
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("name", sorted(LOGIC_OK["fixed"] - SHIFTED - {"select"}))
def test_bounds_hold_every_result(name: str) -> None:
    """The interval rule contains what the operation gives at and inside its corners."""
    random = np.random.default_rng(3)
    operation = OPERATIONS[name]
    for _ in range(300):
        spans = [sorted(int(v) for v in random.integers(-1000, 1000, size=2)) for _ in range(arity(name))]
        if name in TRUTHS:
            spans = [[0, 1]] * arity(name)
        if name == "clamp":
            spans[1:] = [[min(spans[1])] * 2, [max(spans[1]) + 5] * 2]
        rule = [tuple(s) for s in spans] if name != "clamp" else [tuple(spans[0]), spans[1][0], spans[2][0]]
        low, high = operation.bound(*rule)
        values = [random.integers(s[0], s[1] + 1, size=50) for s in spans]
        result = np.asarray(operation.run(*values))
        assert low <= result.min() and result.max() <= high
