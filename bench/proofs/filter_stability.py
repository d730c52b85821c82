"""Design filters of every usual family and compare the verdict on their stability with exact arithmetic.

Run it as `python -m bench.proofs.filter_stability [SEED]`: orders 2 to 20, five families, low, high and band pass,
cut-offs over six decades of the rate, both drawn where a seed is given; coefficients in z, in s, and as sections.
Prints one row a family and the share that is right; ends with 1 where a verdict is wrong. Two minutes on two cores.
"""

from __future__ import annotations

import math
import os
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction

import numpy as np
import scipy.signal
from threadpoolctl import threadpool_limits

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


def drawn(seed: int) -> tuple[list[int], list[float]]:
    """Return other orders and cut-offs, over the same ranges."""
    dice = np.random.default_rng(seed)
    orders = dice.choice(np.arange(ORDERS[0], ORDERS[-1] + 1), len(ORDERS), replace=False)
    cut_offs = np.exp(dice.uniform(math.log(CUT_OFFS[0]), math.log(CUT_OFFS[-1]), len(CUT_OFFS)))
    return sorted(orders.tolist()), sorted(cut_offs.tolist())


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
    """Return "stable", "unstable" or "boundary" of the given coefficients, by Schur and Cohn's test in integers."""
    if "sections" in table:
        parts = [row[3:] for row in table["sections"]]
        parts = [part[:-1] if part[-1] == 0 else part for part in parts]
        return _worst([_within(_whole(part), 1 + EDGE * k) for part in parts] for k in (0, 1))
    below = _whole(table["denominator"])
    if table.get("domain") != "s":
        return _worst([_within(below, 1 + EDGE * k)] for k in (0, 1))
    scale = Fraction(float(np.max(np.abs(np.roots(table["denominator"])))))
    scaled = _common([value / scale**k for k, value in enumerate(below)])
    return _worst([_within(_turned(scaled, k * 2 * EDGE), Fraction(1))] for k in (0, 1))


def _worst(tests: Iterator[list[bool]]) -> str:
    inside, nearly = (all(test) for test in tests)
    return "stable" if inside else "boundary" if nearly else "unstable"


def _whole(values: Sequence[float]) -> list[int]:
    return _common([Fraction(float(value)) for value in values])


def _common(values: Sequence[Fraction]) -> list[int]:
    """Multiply by what makes all of them whole, and take out what they have in common."""
    unit = math.lcm(*(value.denominator for value in values))
    return _shortened([int(value * unit) for value in values])


def _shortened(values: list[int]) -> list[int]:
    common = math.gcd(*values) or 1
    return [value // common for value in values]


def _turned(scaled: list[int], shift: Fraction) -> list[int]:
    """Put s = shift + (w - 1)/(w + 1), so that the left half plane becomes the unit circle; by Horner's rule."""
    above = shift.numerator + shift.denominator, shift.numerator - shift.denominator
    below = shift.denominator, shift.denominator
    total, power = [scaled[0]], [1]
    for value in scaled[1:]:
        power = _times(power, below)
        total = [x + value * y for x, y in zip(_times(total, above), power, strict=True)]
    return _shortened(total)


def _times(values: list[int], factor: tuple[int, int]) -> list[int]:
    return [factor[0] * x + factor[1] * y for x, y in zip([*values, 0], [0, *values], strict=True)]


def _within(coefficients: list[int], radius: Fraction) -> bool:
    order = len(coefficients) - 1
    left = [value * radius.denominator**k * radius.numerator ** (order - k) for k, value in enumerate(coefficients)]
    while len(left) > 1:
        first, last = left[0], left[-1]
        if abs(last) >= abs(first):
            return False
        left = _shortened([first * left[k] - last * left[-1 - k] for k in range(len(left) - 1)])
    return True


def judged(table: dict[str, object]) -> tuple[str, bool]:
    """Return what a filter is in truth, and whether it was called unstable."""
    return truth(table), refused(table)


def main() -> int:
    """Judge all of them."""
    began = time.monotonic()
    counts: dict[str, list[int]] = {family: [0, 0, 0, 0] for family in FAMILIES}
    every = list(filters(*(drawn(int(sys.argv[1])) if len(sys.argv) > 1 else (ORDERS, CUT_OFFS))))
    with ProcessPoolExecutor(os.cpu_count(), initializer=threadpool_limits, initargs=(1,)) as pool:
        answers = list(pool.map(judged, (table for _, _, table in every), chunksize=16))
    for (family, given, table), (right, said) in zip(every, answers, strict=True):
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
    wrong = sum(row[3] for row in counts.values())
    print(f"{100 * (1 - wrong / len(every)):.4g} % of {len(every)} right, {time.monotonic() - began:.0f} s")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
