"""Reduce a linear plant to a gain, at most two lags or integrators, and an effective delay.

The rules are those of S. Skogestad, "Simple analytic rules for model reduction and PID controller tuning", J. Process
Control 13 (2003) 291-309, section 3: the half rule for lags, T1 to T3 for zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.law import DesignError
from firmloop.identify.simulation.linearize import Linear

Roots = npt.NDArray[np.complex128]

ORIGIN = 1e-9  # poles this much slower than the fastest one act as integrators at any sample time in use
SAME = 1e-6  # a zero this close to a pole, relatively, cancels it: the mode is not seen or not driven
NEARER = 1.6 * (1 - 1e-9)  # Skogestad pairs a zero with the next smaller lag only below this ratio
DAMPING = 0.5  # below it a lag no longer resembles a complex pair: its step response overshoots by more than 16 %


@dataclass(frozen=True, slots=True)
class ZeroPole:
    """G(s) = factor prod(s - zeros) / prod(s - poles) exp(-delay s), without common factors; roots in rad/s."""

    factor: float
    zeros: Roots
    poles: Roots
    delay: float  # s


@dataclass(frozen=True, slots=True)
class Process:
    """G(s) = gain exp(-delay s) / (s^integrators prod(lag s + 1)), lags in s, longest first."""

    gain: float
    integrators: int
    lags: tuple[float, ...]
    delay: float  # s


def zero_pole(linear: Linear) -> ZeroPole:
    """Find zeros, poles and factor of the first input's way to the first output.

    With the first nonzero Markov parameter D, CB, CAB, ... at index r there are n - r finite zeros: those generalized
    eigenvalues of the system matrix that are smallest.
    """
    a, b, c = np.atleast_2d(linear.a), np.atleast_2d(linear.b)[:, :1], np.atleast_2d(linear.c)[:1]
    d = float(np.atleast_2d(linear.d)[0, 0])
    order = a.shape[0]
    poles = np.linalg.eigvals(a).astype(np.complex128) if order else np.zeros(0, np.complex128)
    markov, size, column = [d], [abs(d)], b
    for _ in range(order):
        markov.append((c @ column).item())
        size.append((abs(c) @ abs(column)).item())
        column = a @ column
    relative = next((k for k, value in enumerate(markov) if abs(value) > 1e-12 * size[k]), None)
    if relative is None:
        raise DesignError(f"the plant's output does not answer its input (gain 0); {BY_HAND}")
    zeros = np.zeros(0, np.complex128)
    if order - relative:
        left = np.block([[a, b], [c, np.array([[d]])]])
        right = scipy.linalg.block_diag(np.eye(order), np.zeros((1, 1)))
        every = scipy.linalg.eigvals(left, right)
        finite = every[np.isfinite(every)]
        zeros = finite[np.argsort(np.abs(finite))][: order - relative].astype(np.complex128)
    zeros, poles = _cancel(zeros, poles)
    return ZeroPole(float(markov[relative]), zeros, poles, float(linear.delay))


def process(plant: ZeroPole, period: float) -> Process:
    """Find lags, integrators and effective delay of `plant` behind a zero-order hold of `period`.

    A right-half-plane zero adds its time constant to the delay and the hold adds half a period (Skogestad,
    section 3.1); a complex pair counts as two lags with the same slope at s = 0.
    """
    scale = max(np.abs(plant.poles), default=0.0)
    at_origin = np.abs(plant.poles) <= ORIGIN * scale
    poles = plant.poles[~at_origin]
    _refuse_poles(poles)
    _refuse_zeros(plant.zeros, ORIGIN * scale)
    gain = plant.factor * float(np.real(np.prod(-plant.zeros) / np.prod(-poles)))
    lags = tuple(sorted((float(lag) for lag in np.real(-1 / poles)), reverse=True))
    leads = sorted((float(lead) for lead in np.real(-1 / plant.zeros)), reverse=True)
    delay = plant.delay + period / 2 + sum(-lead for lead in leads if lead < 0)
    start = Process(gain, int(np.sum(at_origin)), lags, delay)
    reduced = start
    for _ in range(5):  # the rules need the delay that they lead to: a few rounds settle it
        delay = half_rule(reduced, 1).delay
        reduced = start
        for lead in leads:
            reduced = _absorb(reduced, lead, delay) if lead > 0 else reduced
    return reduced


def half_rule(process: Process, order: int) -> Process:
    """Keep `order` lags and integrators; half of the longest dropped lag lengthens the last kept one.

    The rest becomes delay. Behind an integrator alone a dropped lag is delay whole (Skogestad's example E6).
    """
    keep = max(order - process.integrators, 0)
    kept, dropped = list(process.lags[:keep]), list(process.lags[keep:])
    delay = process.delay + sum(dropped)
    if kept and dropped:
        kept[-1] += dropped[0] / 2
    if dropped and (kept or not process.integrators):
        delay -= dropped[0] / 2
    return replace(process, lags=tuple(sorted(kept, reverse=True)), delay=delay)


def natural_period(plant: ZeroPole, full: Process) -> float:
    """Return 1/w of the complex pair that makes the two longest lags, in s; 0 where these are not a pair."""
    pairs = [pole for pole in plant.poles if pole.imag > 0]
    slowest = max(pairs, key=lambda pole: (-1 / pole).real, default=None)
    if slowest is None or full.integrators or len(full.lags) < 2:
        return 0.0
    lag = (-1 / slowest).real
    return 1 / abs(slowest) if max(abs(lag - kept) for kept in full.lags[:2]) < 1e-6 * lag else 0.0


def _absorb(process: Process, lead: float, delay: float) -> Process:
    """Replace (lead s + 1)/(lag s + 1) by rules T1 to T3 (Skogestad, section 3.3), `delay` the effective one."""
    larger = [lag for lag in process.lags if lag >= lead]
    smaller = [lag for lag in process.lags if lag < lead]
    if not larger and not smaller:
        raise DesignError(f"the plant is an integrator with a zero at {-1 / lead:.3g} rad/s; {BY_HAND}")
    below = lead / smaller[0] if smaller else np.inf
    nearer = below < NEARER and (not larger or below < larger[-1] / lead)
    lag = smaller[0] if nearer or not larger else larger[-1]
    lags = list(process.lags)
    lags.remove(lag)
    factor = 1.0
    if lead >= lag:
        factor = lead / max(lag, delay) if lead >= delay else 1.0  # T1, T1a; T1b
    elif lead >= 5 * delay:
        factor = lead / lag  # T2
    else:
        shorter = max(min(lag, 5 * delay), lead)
        factor = shorter / lag  # T3
        lags += [shorter - lead] if shorter > lead else []
    return replace(process, gain=process.gain * factor, lags=tuple(sorted(lags, reverse=True)))


BY_HAND = "this rule cannot tune it: give kp, ki, kd instead"


def _refuse_poles(poles: Roots) -> None:
    """Refuse what the rules were not made for: unstable and ringing plants."""
    for pole in poles:
        if pole.real > 0:
            raise DesignError(f"the plant is unstable (pole at {pole.real:.3g} rad/s); {BY_HAND}")
        damping = -pole.real / abs(pole)
        if damping < DAMPING:
            raise DesignError(
                f"the plant rings: damping ratio {damping:.2g} at {abs(pole):.3g} rad/s, at least {DAMPING:g} is "
                f"needed; {BY_HAND}"
            )


def _refuse_zeros(zeros: Roots, origin: float) -> None:
    """Refuse a plant without gain at rest, and a notch."""
    for zero in zeros:
        if abs(zero) <= origin:
            raise DesignError(f"the plant's output returns to 0 under a constant input (gain 0 at rest); {BY_HAND}")
        if abs(zero.real) < DAMPING * abs(zero):
            raise DesignError(f"the plant has a notch at {abs(zero):.3g} rad/s; {BY_HAND}")


def _cancel(zeros: Roots, poles: Roots) -> tuple[Roots, Roots]:
    """Remove pairs of a zero and a pole that stand at one place."""
    origin = ORIGIN * max(np.abs(poles), default=0.0)
    left, kept = list(poles), []
    for zero in zeros:
        distance = np.abs(np.array(left) - zero)
        if len(left) and distance.min() <= max(SAME * abs(zero), origin):
            left.pop(int(distance.argmin()))
        else:
            kept.append(zero)
    return np.array(kept, np.complex128), np.array(left, np.complex128)
