"""Sampled transfer functions agree with python-control and scipy; their sections multiply to the whole."""

from __future__ import annotations

import control
import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.design.discretize.rational import Rational, from_s, from_z, response
from firmloop.design.discretize.sections import sections

CASES = {
    "lag": ([3.0], [0.2, 1.0]),
    "lead": ([0.5, 10.0], [0.01, 1.0]),
    "resonance": ([40.0, 900.0], [1.0, 6.0, 900.0]),
    "fourth": ([40.0, 2400.0, 16000.0], [1.0, 480.0, 90400.0, 2.4e6, 2.4e5]),
    "third, biproper": ([1.0, 5.0, 60.0, 80.0], [1.0, 12.0, 90.0, 400.0]),
    "gain": ([7.0], [2.0]),
}
H = 0.004
Z = np.exp(1j * np.geomspace(1e-3, 3.1, 60))


def by_control(numerator: list[float], denominator: list[float], method: str, w: float) -> np.ndarray:
    system = control.tf(numerator, denominator)
    if method == "backward":
        num, den, _ = scipy.signal.cont2discrete((numerator, denominator), H, "backward_diff")
        return np.polyval(num.ravel(), Z) / np.polyval(den, Z)
    if method == "prewarp":
        return control.c2d(system, H, "tustin", prewarp_frequency=w)(Z)
    return control.c2d(system, H, method)(Z)


@pytest.mark.parametrize("method", ["tustin", "zoh", "matched", "prewarp", "backward"])
@pytest.mark.parametrize("case", CASES)
def test_every_method_is_that_of_python_control(case: str, method: str) -> None:
    numerator, denominator = CASES[case]
    if case == "gain" and method == "matched":
        expected = np.full(len(Z), 3.5 + 0j)  # python-control has no poles to match there
    else:
        expected = by_control(numerator, denominator, method, 25.0)
    got = response(from_s(numerator, denominator, H, method, 25.0), Z)
    np.testing.assert_allclose(got, expected, rtol=2e-7)


def test_an_integrator_is_matched_as_it_is_slow() -> None:
    found = from_s([2.0, 10.0], [1.0, 0.0], H, "matched", 0.0)
    slow = np.exp(1j * np.array([1e-4]))
    np.testing.assert_allclose(response(found, slow), 2.0 + 10.0 / np.log(slow) * H, rtol=1e-3)
    assert found.poles == [0.0]


def test_prewarping_keeps_the_response_where_it_was_asked_for() -> None:
    numerator, denominator = CASES["resonance"]
    w = 200.0
    got = response(from_s(numerator, denominator, H, "prewarp", w), np.exp(1j * np.array([w * H])))
    s = 1j * w
    assert got[0] == pytest.approx(np.polyval(numerator, s) / np.polyval(denominator, s))


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    order=st.integers(1, 6),
    missing=st.integers(0, 6),
    near=st.booleans(),
    form=st.sampled_from(["auto", "shift", "delta"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_sections_multiply_to_the_whole(order: int, missing: int, near: bool, form: str, seed: int) -> None:
    random = np.random.default_rng(seed)

    def roots(count: int) -> np.ndarray:
        pairs = random.integers(0, count // 2 + 1)
        radius = 1 - 10.0 ** random.uniform(-4, -2, pairs) if near else random.uniform(0.1, 0.95, pairs)
        found = radius * np.exp(1j * (random.uniform(0, 0.05, pairs) if near else random.uniform(0, np.pi, pairs)))
        real = 1 - 10.0 ** random.uniform(-4, -1.5, count) if near else random.uniform(-0.9, 0.9, count)
        return np.concatenate([found, found.conj(), real[: count - 2 * pairs]]) - 1

    whole = Rational(roots(max(0, order - missing)), roots(order), float(random.normal()))
    got = np.ones(len(Z), complex)
    parts = sections(whole, form)
    for part in parts:
        point = Z - 1 if part.form == "delta" else Z
        got *= np.polyval(part.b, point) / np.polyval([1.0, *part.a], point)
    np.testing.assert_allclose(got, response(whole, Z), rtol=1e-6)
    assert len(parts) == (order + 1) // 2
    if form != "auto":
        assert {part.form for part in parts} == {form}


def test_auto_chooses_delta_only_near_one() -> None:
    slow, fast = from_z([1.0], np.poly([0.99, 0.98]).tolist()), from_z([1.0], np.poly([0.5, 0.4]).tolist())
    assert [part.form for part in sections(slow, "auto")] == ["delta"]
    assert [part.form for part in sections(fast, "auto")] == ["shift"]


def test_the_delta_form_keeps_what_a_rounded_coefficient_would_move() -> None:
    """Two poles near 1, coefficients rounded to 16 bits: the shift form's poles move hundreds of times farther."""
    poles = np.array([-0.004 + 0.003j, -0.004 - 0.003j])
    whole = Rational(np.zeros(0, complex), poles, 1.0)
    moved = {}
    for form in ("shift", "delta"):
        (part,) = sections(whole, form)
        rounded = [float(np.float16(value)) for value in part.a]
        found = np.roots([1.0, *rounded]) - (1 if form == "shift" else 0)
        moved[form] = np.max(np.abs(np.sort_complex(found) - np.sort_complex(poles)))
    assert moved["shift"] > 100 * moved["delta"]


@pytest.mark.parametrize("order", [4, 12, 20, 30, 60])
def test_roots_around_the_circle_keep_their_places(order: int) -> None:
    """Powers of z - 1 have coefficients as large as 2^order there; powers of z lose nothing."""
    rational = from_z([1.0], [1.0, *[0.0] * (order - 1), -0.5])
    np.testing.assert_allclose(np.abs(1 + rational.poles), 0.5 ** (1 / order), rtol=1e-12)


def test_roots_that_crowd_one_keep_their_places() -> None:
    distances = np.array([1e-6, 2e-6, 5e-4])
    rational = from_z([1.0], np.poly(1 - distances).tolist())
    np.testing.assert_allclose(np.sort(-rational.poles.real)[2], 5e-4, rtol=1e-6)


def test_a_middle_coefficient_of_nothing_but_rounding_is_none() -> None:
    """A pair at +-i r has a1 = 0, whatever its two roots round to."""
    for section in sections(from_z([1.0], [1.0, *[0.0] * 29, -0.5]), "shift"):
        assert all(value == 0 or abs(value) > 1e-9 for value in (*section.a, *section.b))
