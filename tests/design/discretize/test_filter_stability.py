"""Filters of high order and low cut-off are called stable or unstable as exact arithmetic says."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import scipy.signal

from firmloop.design.design import Design
from firmloop.design.discretize.exact_roots import exact_roots
from firmloop.design.discretize.unit_circle import poles, unstable, within
from firmloop.design.kinds import design
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.verify.reference import run

PERIOD = 1e-4


def made(table: dict[str, object]) -> Design:
    wires = tuple(Signal(name, "V", -1.0, 1.0) for name in ("reference", "measurement"))
    return design("transfer_function", "filter", table, PERIOD, wires, (Signal("output", "V", -4.0, 4.0),), None)


def analog(order: int, cut: float) -> dict[str, object]:
    above, below = scipy.signal.butter(order, 2 * np.pi * cut / PERIOD, analog=True)
    return {"numerator": above.tolist(), "denominator": below.tolist(), "domain": "s"}


@pytest.mark.parametrize("cut", [1e-4, 1e-3, 0.1, 0.45])
@pytest.mark.parametrize("order", [2, 5, 8, 10, 14])
def test_a_butterworth_given_in_s_is_stable_at_every_order_and_cut_off(order: int, cut: float) -> None:
    """Butterworth's polynomial moves its roots by less than their distance from the axis, rounded to doubles."""
    assert all(np.isfinite(signal.high) for signal in made(analog(order, cut)).law.state)


@pytest.mark.parametrize("kind", ["lowpass", "highpass", "bandpass"])
@pytest.mark.parametrize(
    "options", [{"ftype": "butter"}, {"ftype": "ellip", "rp": 1.0, "rs": 60.0}, {"ftype": "bessel"}]
)
def test_sections_of_order_16_are_stable(options: dict[str, object], kind: str) -> None:
    edge = [2e-4, 3e-4] if kind == "bandpass" else 2e-4
    rows = scipy.signal.iirfilter(8 if kind == "bandpass" else 16, edge, btype=kind, output="sos", **options)
    made({"sections": rows.tolist()})


@pytest.mark.parametrize("order", [9, 12])
def test_a_polynomial_that_lost_its_filter_is_refused_and_sections_are_advised(order: int) -> None:
    """The coefficients in z of so low a cut-off really have roots outside of the circle."""
    above, below = scipy.signal.butter(order, 2e-3)
    with pytest.raises(DesignError, match=r"unstable: its poles at z = .*give controller\.sections instead"):
        made({"numerator": above.tolist(), "denominator": below.tolist()})
    made({"sections": scipy.signal.butter(order, 2e-3, output="sos").tolist()})


def test_a_stable_filter_that_its_coefficients_hardly_hold_is_told_so() -> None:
    above, below = scipy.signal.butter(5, 4e-4)
    assert (
        "give controller.sections instead"
        in made({"numerator": above.tolist(), "denominator": below.tolist()}).law.says
    )
    above, below = scipy.signal.butter(5, 0.2)
    assert "note" not in made({"numerator": above.tolist(), "denominator": below.tolist()}).law.says


@pytest.mark.parametrize(("order", "cut"), [(9, 3e-4), (12, 3e-3), (9, 3e-2)])
@pytest.mark.parametrize("shape", ["butter", "cheby1", "bessel"])
def test_a_low_pass_of_high_order_is_held_in_32_bits(shape: str, order: int, cut: float) -> None:
    """The gain of the whole is 1e-30 and less; each section's is what its own poles ask for."""
    options = {"rp": 1.0} if shape == "cheby1" else {}
    rows = scipy.signal.iirfilter(order, 2 * cut, btype="low", ftype=shape, output="sos", **options)
    law = made({"sections": rows.tolist()})
    program = lower(law.law, "fixed32")
    steps = 100_000
    inputs = np.full((1, steps, 2), 0)
    inputs[..., 0] = round(0.5 * 2.0 ** program.inputs[0].number.fraction)
    answer = run(program, inputs).outputs[0, -1, 0] * 2.0 ** -program.outputs[0].number.fraction
    assert answer == pytest.approx(0.5 * np.prod(rows[:, :3].sum(axis=1) / rows[:, 3:].sum(axis=1)), abs=0.005)


@pytest.mark.parametrize(("digits", "told"), [(4, "4 of its 4 poles on the unit circle, at z = 1: it keeps"), (17, "")])
def test_a_filter_that_too_few_digits_made_an_integrator_is_told_so(digits: int, told: str) -> None:
    """Butterworth's sections of so low a cut-off print as (z - 1)^2 in four digits: no error, and no filter either."""
    rows = scipy.signal.butter(4, 1e-6, output="sos")
    says = made({"sections": [[float(f"{value:.{digits}g}") for value in row] for row in rows]}).law.says
    assert told in says and ("unit circle" in says) == bool(told)


def test_sections_are_the_filter_that_its_polynomial_is() -> None:
    rows = scipy.signal.ellip(5, 1.0, 40.0, 0.3, output="sos")
    above, below = scipy.signal.ellip(5, 1.0, 40.0, 0.3)
    one = made({"sections": rows.tolist()}).gains
    other = made({"numerator": above.tolist(), "denominator": below.tolist()}).gains
    assert one.keys() == other.keys()
    np.testing.assert_allclose([one[key] for key in one], [other[key] for key in one], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"sections": [[1.0, 0, 0, 1.0, -0.5, 0]], "numerator": [1.0]}, "numerator is given beside sections"),
        ({"sections": [[1.0, 0, 0]]}, "1 x 3"),
        ({"sections": [[1, 2, 1, 1, -2.1, 1.3]]}, "unstable"),
        ({"sections": [[0, 0, 1, 1, 2, 1]] * 2, "domain": "s", "discretize": "zoh"}, "'zoh' holds the input"),
        ({"numerator": [1.0], "denominator": [1.0, 1.0, -1.0], "domain": "s"}, "right of the imaginary axis"),
    ],
)
def test_wrong_sections_are_refused(table: dict[str, object], words: str) -> None:
    with pytest.raises(DesignError, match=words):
        made(table)


def turning(size: float) -> list[list[float]]:
    """Return a matrix that turns by 0.01 rad a sample, with poles of that size."""
    return [[size * np.cos(0.01), size * np.sin(0.01)], [-size * np.sin(0.01), size * np.cos(0.01)]]


@pytest.mark.parametrize(
    ("held", "grows", "words"),
    [
        ({"domain": "s", "denominator": [1.0, 0.0, 100.0]}, {"denominator": [1.0, -2e-6, 100.0]}, r"s = 1e-06\+10j"),
        ({"domain": "s", "denominator": [1.0, 0.0, 0.0]}, {"denominator": [1.0, -1e-9, 0.0]}, "s = 1e-09"),
        ({"denominator": [1.0, -1.9999, 1.0]}, {"denominator": [1.0, -1.9999, 1.000000002]}, r"\(\|z\| = 1 \+ 1e-09\)"),
        ({"denominator": [1.0, -1.0]}, {"denominator": [1.0, -1.000000001]}, r"z = 1 \(\|z\| = 1 \+ 1e-09\)"),
        ({"sections": [[0, 0, 1, 1.0, -1.9999, 1.0]]}, {"sections": [[0, 0, 1, 1.0, -1.9999, 1.0 + 2e-9]]}, "1e-09"),
    ],
)
def test_a_pole_barely_outside_is_told_from_one_on_the_boundary(
    held: dict[str, object], grows: dict[str, object], words: str
) -> None:
    table = held if "sections" in held else {"numerator": [1.0], **held}
    assert any(np.isinf(signal.high) for signal in made(table).law.state)
    with pytest.raises(DesignError, match=words):
        made({**table, **grows})


def test_a_matrix_that_grows_by_a_billionth_a_sample_is_unstable() -> None:
    assert unstable(np.array(turning(1 + 1e-9)), 1e-6) and not unstable(np.array(turning(1.0)), 1e-6)
    assert not unstable(np.array([[2.0, -1.0], [1.0, 0.0]]), 1e-6)  # two poles at 1


def test_integrators_in_decimals_stay_integrators() -> None:
    """Two poles at z = 1 beside one at 0.9: as doubles they stand 3e-8 off the circle."""
    law = made({"numerator": [1.0], "denominator": [1.0, -2.9, 2.8, -0.9]}).law
    assert any(np.isinf(signal.high) for signal in law.state)


def test_a_cascade_has_the_poles_of_its_sections() -> None:
    """Twenty times one block: eigenvalues of the whole scatter by a tenth, and cross the circle."""
    block = np.array([[1.999, 1.0], [-0.99901, 0.0]])
    whole = np.kron(np.eye(20), block)
    for k in range(1, 20):
        whole[2 * k, 2 * k - 2] = 1.0
    radius = float(np.max(np.abs(np.linalg.eigvals(block))))
    assert np.max(np.abs(np.linalg.eigvals(whole))) > 1.0 > radius
    assert within(whole, 1.0) and not within(whole, radius * (1 - 1e-12))
    np.testing.assert_allclose(np.abs(poles(whole)), radius, rtol=1e-7)


@pytest.mark.parametrize("order", [3, 4, 7, 12])
def test_the_exact_test_agrees_with_a_known_spectral_radius(order: int) -> None:
    random = np.random.default_rng(order)
    roots = np.concatenate([random.uniform(-0.9, 0.9, order - 2), [0.6 + 0.5j, 0.6 - 0.5j]])
    below = np.real(np.poly(roots))
    matrix = np.eye(order, k=1)
    matrix[:, 0] -= below[1:]
    radius = float(np.max(np.abs(roots)))
    assert within(matrix, radius * (1 + 1e-9)) and not within(matrix, radius * (1 - 1e-9))


def test_exact_roots_tell_a_pair_from_two_real_ones() -> None:
    """x^2 - 2 x + 1 -+ 1e-20 differ in what no solver in doubles sees."""
    near = np.array([1.0 + 0j, 1.0 + 1e-9j])
    for sign in (1, -1):
        found = exact_roots([Fraction(1), Fraction(-2), 1 - Fraction(sign, 10**20)], near)
        apart = (found[0] - found[1]) / 2
        np.testing.assert_allclose(abs(apart.imag if sign < 0 else apart.real), 1e-10, rtol=1e-5)


def test_a_solver_that_fails_on_wide_coefficients_is_not_believed() -> None:
    """A narrow band of order 20 at so low a frequency: ordinary roots are off by a tenth, and unstable."""
    edges = 2 * np.pi / PERIOD * np.array([4.5e-7, 5.4e-7])
    above, below = scipy.signal.cheby1(10, 1.0, edges, "bandpass", analog=True)
    made({"numerator": above.tolist(), "denominator": below.tolist(), "domain": "s"})
