"""Bound how far the state of a stable linear law can go while its inputs stay in their ranges.

With x[k+1] = A x[k] + B z[k] from rest, x[k] = sum_j A^j B z[k-1-j], each coordinate is farthest where every z stands
at the end of its range that the impulse response's sign asks for: the L1 norm of the impulse response (Dahleh and
Diaz-Bobillo, Control of Uncertain Systems, 1995, ch. 3). The sum is taken over N samples; with M a power of two and
P = |A^M|, entry by entry, the rest is at most P (I - P)^-1 times the sum of |A^j B| over the last M of them, because
|A^(j+M) B| <= |A^M| |A^j B|. Beyond SAMPLES the box of what M samples reach is doubled in time by interval arithmetic.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from firmloop.design.discretize.unit_circle import PRINTED, listed, poles, unstable, within
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

WIDER = 0.01  # far above the rounding of any format that has the resolution to run the law at all
ROUNDED = 4 * 2.0**-24  # of every term of a sum in float32: its coefficient, its product, and up to two sums
ON_CIRCLE = 1e-9  # a pole this close to the unit circle forgets nothing within any use of the law
OUTSIDE = 1e-6  # decimal coefficients do not tell where several poles meet, as two integrators do, better than this
SAMPLES = 2**22  # numbers held of one impulse response
DOUBLINGS = 50
SMALL = 1e-4  # the tail may add this share


def reach(a: Array, b: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the ends (n,) of what x can reach from 0 while z stays within `low` and `high` (m,).

    All poles of `a` (n, n) lie inside the unit circle; `b` is (n, m).
    """
    order, inputs = b.shape
    if not order or not inputs:
        return np.zeros(order), np.zeros(order)
    largest = max(1, SAMPLES // (order * inputs))
    responses, power = b[None, :, :], a
    size = np.maximum(np.abs(low), np.abs(high))
    for _ in range(DOUBLINGS):
        sums = np.abs(responses).sum(axis=0) @ size
        share = np.abs(power)
        rest = _rest(share, sums)
        if rest is not None and np.all(rest <= SMALL * sums):
            return _ends(responses, low, high, rest)
        if 2 * len(responses) > largest:
            break
        responses = np.concatenate([responses, power @ responses])
        power = power @ power
    none = np.zeros(order)
    down, up = _ends(responses, low, high, none)
    for _ in range(DOUBLINGS):  # no room for more samples: x[2M] is what M samples reach, plus A^M times such a value
        rest = _rest(np.abs(power), np.maximum(-down, up))
        if rest is not None and np.all(rest <= SMALL * np.maximum(-down, up)):
            return down - rest, up + rest
        rise, fall = np.maximum(power, 0.0), np.minimum(power, 0.0)
        down, up = down + rise @ down + fall @ up, up + rise @ up + fall @ down
        power = power @ power
    return np.full(order, -math.inf), np.full(order, math.inf)


def _rest(share: Array, sums: Array) -> Array | None:
    """Return P (I - P)^-1 sums; None where P does not contract."""
    if not np.all(np.isfinite(share)) or np.max(np.abs(np.linalg.eigvals(share))) > 0.9:
        return None
    return np.asarray(share @ np.linalg.solve(np.eye(len(share)) - share, sums), dtype=np.float64)


def _ends(responses: Array, low: Array, high: Array, rest: Array) -> tuple[Array, Array]:
    """Return the extremes of the sums over the first 0, 1, 2, ... samples, widened by what may follow."""
    up = np.cumsum(np.maximum(responses * low, responses * high).sum(axis=2), axis=0)
    down = np.cumsum(np.minimum(responses * low, responses * high).sum(axis=2), axis=0)
    return np.minimum(down.min(axis=0), 0.0) - rest, np.maximum(up.max(axis=0), 0.0) + rest


def forgets(a: Array, what: str) -> bool:
    """Tell whether all poles lie inside the unit circle; refuse poles outside of it, `what` names the law.

    A pole on the circle (an integrator) is legal, but its state has no range.
    """
    if within(a, 1 - ON_CIRCLE):
        return True
    if not unstable(a, OUTSIDE):
        return False
    found = poles(a)
    outside = [pole for pole in found if abs(pole) > 1 + PRINTED] or [found[0]]
    raise DesignError(
        f"{what} is unstable: its poles at z = {listed(outside)} lie outside the unit circle; correct the "
        "coefficients, or check domain and sample time"
    )


def rounding_share(a: Array, b: Array, size: Array, drive: Array) -> float:
    """Return by which share single precision can carry x beyond the range `size` (n,); `drive` (m,) bounds z.

    Each sample rounds coefficients and results by at most ROUNDED (|A| |x| + |B| |z|), which A then keeps; that is e at
    most, relatively, for x within `size`, so that x stays within 1 + e/(1 - e) times of it. Infinite from e = 1/2.
    """
    if not len(a):
        return 0.0
    disturbed = ROUNDED * (np.abs(a) @ size + np.abs(b) @ drive)
    least, most = reach(a, np.diag(disturbed), -np.ones(len(a)), np.ones(len(a)))
    moves = np.maximum(-least, most)
    shares = moves[size > 0] / size[size > 0]
    e = float(np.max(shares, initial=0.0))
    return e / (1 - e) if e < 0.5 else math.inf


def widened(name: str, unit: str, low: float, high: float, share: float = WIDER) -> Signal:
    """Return the range with `share` more on both sides, so that rounding cannot leave it."""
    wider = share * max(abs(low), abs(high)) or WIDER  # a state that never moves still needs a range
    return Signal(name, unit, low - wider, high + wider)
