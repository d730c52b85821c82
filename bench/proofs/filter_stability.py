"""Design filters of every usual family and compare the verdict on their stability with exact arithmetic.

Run it as `python bench/proofs/filter_stability.py`: orders 2 to 20, five families, low, high and band pass, cut-offs
over six decades of the rate; coefficients in z, in s, and as sections. Prints one row a family; ends with 1 where a
verdict is wrong.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np
import scipy.signal

from firmloop.design.kinds import design
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal

PERIOD = 1e-4
ORDERS = (2, 5, 8, 10, 14, 20)
CUT_OFFS = (4.5e-7, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.45)  # share of the rate
PASSES = ("lowpass", "highpass", "bandpass")
FAMILIES = ("butterworth", "chebyshev 1", "chebyshev 2", "elliptic", "bessel")
EDGE = Fraction(1, 10**6)  # outside by less is on the boundary, as decimal integrators are


def filters(orders: Sequence[int], cut_offs: Sequence[float]) -> Iterator[tuple[str, str, dict[str, object]]]:
    """Yield the family, what is given, and the controller's table."""
    for family in FAMILIES:
        for order in orders:
            for kind in PASSES:
                for cut in cut_offs:
                    yield from ((family, given, table) for given, table in _tables(family, order, kind, cut))


def _tables(family: str, order: int, kind: str, cut: float) -> Iterator[tuple[str, dict[str, object]]]:
    half = order // 2 if kind == "bandpass" else order
    if kind == "bandpass" and (order % 2 or cut >= 0.45):
        return
    edges = [cut, min(1.2 * cut, 0.49)] if kind == "bandpass" else cut
    options = {
        "butterworth": {"ftype": "butter"},
        "chebyshev 1": {"ftype": "cheby1", "rp": 1.0},
        "chebyshev 2": {"ftype": "cheby2", "rs": 40.0},
        "elliptic": {"ftype": "ellip", "rp": 1.0, "rs": 60.0},
        "bessel": {"ftype": "bessel"},
    }[family]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        digital = {"N": half, "Wn": 2 * np.asarray(edges), "btype": kind, **options}
        rows = scipy.signal.iirfilter(**digital, output="sos")
        b, a = scipy.signal.iirfilter(**digital, output="ba")
        turned = 2 * np.pi * np.asarray(edges) / PERIOD
        above, below = scipy.signal.iirfilter(**{**digital, "Wn": turned}, analog=True, output="ba")
    if np.all(np.isfinite(rows)):
        yield "sections", {"sections": rows.tolist()}
    if np.all(np.isfinite(b)) and np.any(b):
        yield "z", {"numerator": b.tolist(), "denominator": a.tolist()}
    if np.all(np.isfinite(above)) and np.all(np.isfinite(below)) and np.any(above):
        yield "s", {"numerator": above.tolist(), "denominator": below.tolist(), "domain": "s"}


def refused(table: dict[str, object]) -> bool:
    """Design it, and tell whether it was called unstable."""
    wires = tuple(Signal(name, "V", -1.0, 1.0) for name in ("reference", "measurement"))
    try:
        design("transfer_function", "filter", table, PERIOD, wires, (Signal("output", "V", -4.0, 4.0),), None)
    except DesignError as error:
        if "unstable" not in str(error):
            raise
        return True
    return False


def truth(table: dict[str, object]) -> str:
    """Return "stable", "unstable" or "boundary" of the given coefficients, by Schur and Cohn's test in fractions."""
    if "sections" in table:
        parts = [row[3:] for row in table["sections"]]
        parts = [part[:-1] if part[-1] == 0 else part for part in parts]
        return _worst([_within(_exact(part), 1 + EDGE * k) for part in parts] for k in (0, 1))
    below = _exact(table["denominator"])
    if table.get("domain") != "s":
        return _worst([_within(below, 1 + EDGE * k)] for k in (0, 1))
    scale = Fraction(float(np.max(np.abs(np.roots(table["denominator"])))))
    monic = [value / below[0] / scale**k for k, value in enumerate(below)]
    turn = 2 * EDGE
    return _worst([_within(_turned(monic, k * turn), Fraction(1))] for k in (0, 1))


def _worst(tests: Iterator[list[bool]]) -> str:
    inside, nearly = (all(test) for test in tests)
    return "stable" if inside else "boundary" if nearly else "unstable"


def _exact(values: Sequence[float]) -> list[Fraction]:
    return [Fraction(float(value)) for value in values]


def _turned(monic: list[Fraction], shift: Fraction) -> list[Fraction]:
    """Put s = shift + (w - 1)/(w + 1), so that the left half plane becomes the unit circle."""
    order = len(monic) - 1
    total = [Fraction(0)] * (order + 1)
    for k, value in enumerate(monic):
        product = [value]
        for above in [True] * (order - k) + [False] * k:
            one, other = (1 + shift, shift - 1) if above else (Fraction(1), Fraction(1))
            product = [one * x + other * y for x, y in zip([*product, 0], [0, *product], strict=True)]
        total = [x + y for x, y in zip(total, product, strict=True)]
    return total


def _within(coefficients: list[Fraction], radius: Fraction) -> bool:
    left = [value / coefficients[0] / radius**k for k, value in enumerate(coefficients)]
    while len(left) > 1:
        last = left[-1]
        if abs(last) >= 1:
            return False
        left = [(left[k] - last * left[-1 - k]) / (1 - last * last) for k in range(len(left) - 1)]
    return True


def main() -> int:
    """Judge all of them."""
    counts: dict[str, list[int]] = {family: [0, 0, 0, 0] for family in FAMILIES}
    for family, given, table in filters(ORDERS, CUT_OFFS):
        right, said = truth(table), refused(table)
        row = counts[family]
        row[0] += 1
        row[1] += right == "unstable"
        row[2] += right == "boundary"
        if said != (right == "unstable") and right != "boundary":
            row[3] += 1
            print(f"WRONG: {family}, {given}: {right}, said {'unstable' if said else 'stable'}: {table}"[:200])
    print(f"{'family':<12}{'filters':>9}{'unstable as given':>19}{'on the boundary':>17}{'wrong':>7}")
    for family, (filtered, unstable, boundary, wrong) in counts.items():
        print(f"{family:<12}{filtered:>9}{unstable:>19}{boundary:>17}{wrong:>7}")
    return int(any(row[3] for row in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
