"""Gains of state feedback and of an observer: LQR, Kalman, pole placement, the reference's feedthrough.

With x[k+1] = A x[k] + B u[k] + w, y[k] = C x[k] + v:

- LQR: K = (R + B'SB)^-1 B'SA minimizes sum x'Qx + u'Ru for u = -K x, S the solution of the Riccati equation (Anderson
  and Moore, Optimal Control, 1990, section 2.4).
- Kalman predictor: L = A P C'(C P C' + V)^-1 for x_hat+ = A x_hat + B u + L (y - C x_hat), the dual, w and v white
  with covariances W and V.
- Luenberger: L places the eigenvalues of A - L C.
- Reference: N makes y = r at rest for u = -K x + N r: (A - I) X + B U = 0, C X = 1, N = U + K X.
"""

from __future__ import annotations

import warnings

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.discretize.unit_circle import poles, within
from firmloop.design.law import DesignError
from firmloop.design.linear.reach import ON_CIRCLE

Array = npt.NDArray[np.float64]


def lqr(a: Array, b: Array, q: Array, r: Array, what: str) -> Array:
    """Return K (m, n); `what` names the weights in an error."""
    try:
        s = scipy.linalg.solve_discrete_are(a, b, q, r)
        gain = np.linalg.solve(r + b.T @ s @ b, b.T @ s @ a)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(
            f"{what} have no stabilizing solution ({str(error).rstrip('.').lower()}); weigh every mode that does not "
            "fade by itself, and see that the inputs reach it"
        ) from None
    check_stable(a - b @ gain, f"the loop that {what} ask for")
    return np.asarray(gain, dtype=np.float64)


def terminal_weight(a: Array, b: Array, q: Array, r: Array) -> Array:
    """Return S (n, n), what the LQR's loop costs from x on: 1/2 x'Sx."""
    lqr(a, b, q, r, "the weights Q and R")
    return np.asarray(scipy.linalg.solve_discrete_are(a, b, q, r), dtype=np.float64)


def kalman(a: Array, c: Array, w: Array, v: Array) -> Array:
    """Return L (n, r)."""
    return lqr(a.T, c.T, w, v, "process_noise and measurement_noise").T


def luenberger(a: Array, c: Array, wanted: tuple[float, ...]) -> Array:
    """Return L (n, r) that places the eigenvalues of A - L C at `wanted` (n,)."""
    outside = [pole for pole in wanted if abs(pole) >= 1]
    if outside:
        raise DesignError(
            f"controller.observer_poles holds {outside[0]:g}, on or outside the unit circle; give poles in z, like 0.5"
        )
    order = len(a)
    if len(wanted) != order:
        raise DesignError(
            f"controller.observer_poles has {len(wanted)} poles for {order} states; give one for each state"
        )
    watched = np.vstack([c @ np.linalg.matrix_power(a, k) for k in range(order)])
    if np.linalg.matrix_rank(watched) < order:
        raise DesignError("the measurements do not show every state, so no observer exists; measure another signal")
    if len(c) == 1:  # Ackermann's formula allows poles to coincide
        polynomial = np.zeros_like(a)
        for coefficient in np.poly(np.array(wanted)):
            polynomial = polynomial @ a + coefficient * np.eye(order)
        last = np.zeros((order, 1))
        last[-1] = 1.0
        return np.asarray(polynomial @ np.linalg.solve(watched, last), dtype=np.float64)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it tells when it stopped short of the most robust gain
            placed = scipy.signal.place_poles(a.T, c.T, np.array(wanted)).gain_matrix.T
    except ValueError as error:
        raise DesignError(
            f"controller.observer_poles cannot be placed: {str(error).rstrip('.')}; spread them"
        ) from None
    return np.asarray(placed, dtype=np.float64)


def reference_gain(a: Array, b: Array, c: Array, gain: Array) -> Array:
    """Return N (m,) for which the first output rests at the reference."""
    order, drives = b.shape
    ring = np.block([[a - np.eye(order), b], [c[:1], np.zeros((1, drives))]])
    wanted = np.zeros(order + 1)
    wanted[-1] = 1.0
    found, *_ = np.linalg.lstsq(ring, wanted, rcond=None)
    if not np.allclose(ring @ found, wanted, atol=1e-6):
        raise DesignError(
            "no constant input holds the plant's first output at a reference (a zero at z = 1); remove 'reference' "
            "from [signals], or give controller.reference_gain"
        )
    return np.asarray(found[order:] + gain @ found[:order], dtype=np.float64)


def check_stable(a: Array, what: str) -> None:
    """Refuse a pole on or outside the unit circle."""
    if not within(a, 1 - ON_CIRCLE):
        found = poles(a)
        worst = [pole for pole in found if abs(pole) >= 1 - ON_CIRCLE] or [found[0]]
        listed = ", ".join(f"{pole:.6g}" if pole.imag else f"{pole.real:.6g}" for pole in worst[:4])
        raise DesignError(
            f"{what} is unstable: its poles at z = {listed} are not inside the unit circle; correct the gains"
        )
