"""Sine, root and reciprocal in whole numbers: the C is the twin, both are what mathematics says, the bounds hold."""

from __future__ import annotations

import ctypes
import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.codegen.environment import text_of
from firmloop.design.law import Law, Scalar
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.compiler import shared_library
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.twins import curved
from firmloop.quantize.twins.root import ROOT_ERROR, root, root_bound
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import FLAGS
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.stimuli.stimuli import stimuli

Words = NDArray[np.int64]
WORD = 2**31
EDGES = [-WORD, -(2**30), 0, 2**30, WORD]


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    text = ['#include "fl_curved_i32.h"']
    for name, counts in {"turn_sine": 0, "turn_cosine": 0, "whole_root": 1, "inverse": 2}.items():
        given = "".join(f", uint32_t c{k}" for k in range(counts))
        head = f"void {name}(const int32_t *a, uint32_t n, int32_t *out{given})"
        call = f"fl_{name}_i32(a[i]{''.join(f', c{k}' for k in range(counts))})"
        text.append(f"{head};\n{head} {{ for (uint32_t i = 0U; i < n; i++) {{ out[i] = {call}; }} }}")
    head = "void turn(const int32_t *a, uint32_t n, int32_t *out, int32_t f, uint32_t s)"
    text.append(f"{head};\n{head} {{ for (uint32_t i = 0U; i < n; i++) {{ out[i] = fl_turn_i32(a[i], f, s); }} }}")
    files = {"curved.c": "\n".join(text) + "\n", "fl_curved_i32.h": text_of("support/fl_curved_i32.h")}
    return ctypes.CDLL(str(shared_library(files, ["curved.c"], FLAGS)))


def in_c(library: ctypes.CDLL, name: str, a: Words, *counts: int) -> Words:
    given, out = np.ascontiguousarray(a, dtype=np.int32), np.empty(len(a), dtype=np.int32)
    pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (given, out)]
    getattr(library, name)(pointers[0], ctypes.c_uint32(len(a)), pointers[1], *(ctypes.c_int32(c) for c in counts))
    return out.astype(np.int64)


def words(low: int, high: int, seed: int) -> Words:
    """Words from `low` to below `high`: drawn evenly, drawn small, and near every edge."""
    random = np.random.default_rng(seed)
    near = np.concatenate([edge + np.arange(-3000, 3000) for edge in (*EDGES, low, high)])
    drawn = random.integers(low, high, 400_000)
    small = random.integers(low, high, 100_000) >> random.integers(0, 31, 100_000)
    every = np.concatenate([near, drawn, small])
    return every[(every >= low) & (every < high)]


def test_a_sine_is_the_twin_and_the_sine(library: ctypes.CDLL) -> None:
    share = words(-WORD, WORD, 1)
    for name, run, truth in (
        ("turn_sine", curved.turn_sine, np.sin),
        ("turn_cosine", curved.turn_cosine, np.cos),
    ):
        found = run(share)
        np.testing.assert_array_equal(in_c(library, name, share), found)
        assert (
            np.max(np.abs(found * 2.0**-curved.SINE_PLACES - truth(share * (2 * math.pi / 2**32)))) < curved.SINE_ERROR
        )
        assert np.max(np.abs(found)) <= curved.ONE


@pytest.mark.parametrize("places", [3, 20, 28, 31])
def test_an_angle_wraps_as_often_as_it_turns(library: ctypes.CDLL, places: int) -> None:
    per_turn = 2.0 ** (32 - places) / (2 * math.pi)
    s = min(32, 30 - math.floor(math.log2(per_turn)))
    factor = round(per_turn * 2.0**s)
    angle = words(-WORD, WORD, 2)
    found = curved.turn(angle, factor, s)
    np.testing.assert_array_equal(in_c(library, "turn", angle, factor, s), found)
    turns = angle * 2.0**-places / (2 * math.pi)
    away = (found * 2.0**-32 - turns + 0.5) % 1.0 - 0.5
    assert np.max(np.abs(away)) < 1e-9 * max(1.0, float(np.max(np.abs(turns))))


@pytest.mark.parametrize("s", [1, 9, 20 + 1, 31])
def test_a_root_is_the_twin_and_the_root(library: ctypes.CDLL, s: int) -> None:
    a = words(0, WORD, 3)
    found = curved.whole_root(a, s)
    np.testing.assert_array_equal(in_c(library, "whole_root", a, s), found)
    truth = np.sqrt(a.astype(np.longdouble) * 2.0**s)
    assert np.all(np.abs(found - truth) <= 1.01 + curved.ROOT_ERROR * truth)
    assert found.max() < WORD
    for low, high in ((0, 5), (7, 1000), (2**20, 2**31 - 1)):
        inside = found[(a >= low) & (a <= high)]
        least, most = curved.root_bound((low, high), s)
        assert least <= inside.min() and inside.max() <= most


@pytest.mark.parametrize(
    ("low", "high"), [(8, 9), (300, 400), (5000, 70_000), (671_088_640, 2_013_265_920), (2**20, 2**30)]
)
def test_a_reciprocal_is_the_twin_and_the_reciprocal(library: ctypes.CDLL, low: int, high: int) -> None:
    k = max(0, high.bit_length() - 16)
    j = 0
    while (WORD // ((low + (1 << k >> 1)) >> k)) << (j + 1) < 2**30:
        j += 1
    x = words(low, high + 1, 4)
    found = curved.inverse(x, k, j)
    np.testing.assert_array_equal(in_c(library, "inverse", x, k, j), found)
    truth = 2.0 ** (31 + k + j) / x
    assert np.all(np.abs(found - truth) <= curved.INVERSE_ROUNDING + curved.inverse_error((low, high), k) * truth)
    least, most = curved.inverse_bound((low, high), k, j)
    assert least <= found.min() and found.max() <= most


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_root_of_floats_is_right_to_its_rounding(kind: type) -> None:
    random = np.random.default_rng(5)
    x = np.exp(random.uniform(math.log(1e-37), math.log(1e37), 200_000)).astype(kind)
    truth = np.sqrt(x.astype(np.longdouble))
    assert np.max(np.abs(root(x) / truth - 1)) < ROOT_ERROR * np.finfo(kind).eps / 2
    odd = np.array([0.0, -0.0, -1.0, np.nan, 1e-320, -np.inf], dtype=kind)
    assert np.all(root(odd) == 0)
    low, high = root_bound((2.0, 9.0))
    assert low < math.sqrt(2.0) < 3.0 < high < 3.00001


def curves() -> Law:
    """A law of all four: the output of each is what its name says."""
    z = ca.SX.sym("z", 3)
    held = ca.fmin(ca.fmax(z[2], 0.5), 4.0)
    out = ca.vertcat(ca.sin(z[0]), ca.cos(z[0]), ca.sqrt(ca.fmax(z[1], 0.0)), z[1] / held)
    function = ca.Function("law", [ca.SX.sym("x", 0), z], [ca.SX(0, 1), out, ca.SX(0, 1), ca.SX(0, 1)])
    return Law(
        name="curves",
        says="four curves",
        period=0.01,
        inputs=(Signal("angle", "rad", -20.0, 20.0), Signal("level", "V", -3.0, 3.0), Signal("span", "V", 0.5, 4.0)),
        outputs=(Signal("sine", "1", -1.1, 1.1), Signal("cosine", "1", -1.1, 1.1), Signal("root", "1", 0.0, 2.0),
                 Signal("share", "1", -7.0, 7.0)),
        state=(),
        start=(),
        why=(),
        flags=(),
        stages=(Scalar(function, ()),),
    )  # fmt: skip


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
def test_a_law_of_curves_keeps_its_distance(arithmetic: str) -> None:
    law = curves()
    program = lower(law, arithmetic)
    blocks = stimuli(program, [], 20_000, 7)
    close = {"float32": 1e-5, "fixed32": 1e-7, "fixed16": 1e-3}[arithmetic]
    for rounded in measure_rounding(law, program, blocks, run_blocks(program, blocks)):
        assert rounded.worst <= rounded.bound
        if rounded.output != "root":  # near 0 a root is steeper than any line
            assert rounded.bound < 4.0 * close, rounded


@pytest.mark.parametrize("weight", [1.0, 0.5, 0.3])
def test_a_rotation_is_rounded_once(weight: float) -> None:
    """A sum of two products is; a weight that is no shift of its end is a product behind it."""
    z = ca.SX.sym("z", 3)
    out = weight * (ca.cos(z[0]) * z[1] - ca.sin(z[0]) * z[2])
    function = ca.Function("law", [ca.SX.sym("x", 0), z], [ca.SX(0, 1), out, ca.SX(0, 1), ca.SX(0, 1)])
    law = replace(
        curves(), outputs=(Signal("turned", "V", -6.0, 6.0),), stages=(Scalar(function, ()),),
    )  # fmt: skip
    program = lower(law, "fixed32")
    made = [op.function for op in program.body]
    assert (made.count("high"), made.count("mul_shift")) == ((1, 0) if weight != 0.3 else (1, 1))
    blocks = stimuli(program, [], 10_000, 7)
    for rounded in measure_rounding(law, program, blocks, run_blocks(program, blocks)):
        assert rounded.worst <= rounded.bound < 2e-7


def test_a_quotient_by_what_can_be_zero_is_refused() -> None:
    z = ca.SX.sym("z", 1)
    function = ca.Function("law", [ca.SX.sym("x", 0), z], [ca.SX(0, 1), 1.0 / z, ca.SX(0, 1), ca.SX(0, 1)])
    law = curves()
    bad = replace(law, inputs=law.inputs[2:], outputs=law.outputs[:1], stages=(Scalar(function, ()),))
    with pytest.raises(QuantizeError, match="divides by a value from -8 to 8, which has no fixed-point form"):
        lower(bad, "fixed32")
