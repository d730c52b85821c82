r"""The air gap of an induction motor in its two axes, with iron that saturates.

All windings of an axis are referred to one number of turns. With l their flux linkages and L their leakage inductances
the flux they share is

    psi = sum(l/L) / (f/M + sum(1/L)),    i = (l - psi)/L       (Krause, Wasynczuk and Sudhoff, section 4.14)

and the iron asks f times the current that M alone would: f = 1 + (|psi| / (M i_s))^2, so that the magnetizing current
is the cubic psi/M + psi^3 / (M^3 i_s^2). Both axes share the iron, |psi| is that of both together.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from firmloop.identify.plants.kind import equations
from firmloop.identify.plants.plant import Balance

_TURNS = 3  # of the fixed point of f: each leaves some 2 % of what was wrong, the leakages over M


def air_gap(axes: Sequence[Sequence[tuple[ca.SX, ca.SX]]], magnetizing: ca.SX, knee: ca.SX | None) -> tuple[ca.SX, ...]:
    """Return the flux of each axis from (flux linkage, leakage inductance) of its windings.

    `knee` is i_s, the magnetizing current at which the inductance has fallen by half; None for iron that never does.
    """
    pushes = [sum((flux / leakage for flux, leakage in axis), start=ca.SX(0.0)) for axis in axes]
    leaks = [sum((1.0 / leakage for _, leakage in axis), start=ca.SX(0.0)) for axis in axes]
    shared = [push / (1.0 / magnetizing + leak) for push, leak in zip(pushes, leaks, strict=True)]
    if knee is None:
        return tuple(shared)
    for _ in range(_TURNS):
        more = sum((flux**2 for flux in shared), start=ca.SX(0.0)) / (magnetizing * knee) ** 2
        shared = [push / ((1.0 + more) / magnetizing + leak) for push, leak in zip(pushes, leaks, strict=True)]
    return tuple(shared)


def magnetizing_balance(x: ca.SX, u: ca.SX, p: ca.SX, current: ca.SX) -> Balance:
    """Return where the effect magnetizing_saturation enters a motor whose first place inside is the knee."""
    return Balance(
        kind="magnetizing",
        state=-1,
        per=ca.Function("per", [p], [0.0]),
        current=equations("current", x, u, p, current),
        inside=(0,),
    )
