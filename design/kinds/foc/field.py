"""A current along the magnets beside the one that is asked for: least current for a torque, less field at high speed.

`mtpa = true`, of a salient machine: of all currents that give a torque the least (Morimoto and others,
IEEE Trans. Ind. Appl. 26(5), 1990), with D = Lq - Ld::

    i_d = -2 D r_q^2/(psi + sqrt(psi^2 + 4 D^2 r_q^2))

as a table over the magnitude of r_q = reference_q_A, linear between its points.

`weakening_A` is the largest current against the magnets, at which the voltage still goes as far as it can. With u the
voltage and V its limit, both in shares of the supply, and k = w_c psi/(60 Ld), w_c = kp_d/Ld::

    f[k+1] = min(max(f + h k (0.9 - |u|^2/V^2), -weakening_A), 0)

Both are added to reference_d_A.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from firmloop.design.law import DesignError
from firmloop.design.table import positive, truth
from firmloop.identify.signal import Signal

KEYS = ("mtpa", "weakening_A")
POINTS = 8  # of the table: what it asks beyond the least is below a two-thousandth of the largest current
KEPT = 0.9  # of the square of the voltage
SLOWER = 60.0  # half of it is how much slower than the current the field follows
STATE = "weakening"
WHY = "limited from -weakening_A to 0"


@dataclass(frozen=True, slots=True)
class Field:
    """`slopes` are those of the table, in steps of `step` in A; `gain` in A/s and `most` in A of the weakening."""

    slopes: tuple[float, ...]
    step: float
    gain: float
    most: float

    def states(self) -> tuple[tuple[Signal, float, str], ...]:
        """Return the state variable, what it begins with, and why it keeps its range; none without weakening."""
        return ((Signal(STATE, "A", -self.most, 0.0), 0.0, WHY),) if self.most else ()

    def reach(self) -> float:
        """Return the largest magnitude in A of what is added."""
        return self.most + abs(sum(self.slopes)) * self.step

    def added(self, reference_q: ca.SX, state: Mapping[str, ca.SX]) -> ca.SX:
        """Return what is added to the reference of d."""
        total, size = (state[STATE] if self.most else ca.SX(0)), ca.fabs(reference_q)
        for k, slope in enumerate(self.slopes):
            total = total + slope * ca.fmin(ca.fmax(size - k * self.step, 0.0), self.step)
        return total

    def after(self, state: Mapping[str, ca.SX], power: ca.SX, period: float) -> list[ca.SX]:
        """Return the next state; `power` is |u|^2/V^2."""
        if not self.most:
            return []
        moved = state[STATE] + (period * self.gain) * (KEPT - power)
        return [ca.fmin(ca.fmax(moved, -self.most), 0.0)]


def least_current(machine: Mapping[str, float], current_q: float) -> float:
    """Return the current along d in A that goes with one across it, for the most torque per ampere."""
    salient, psi = machine["Lq_H"] - machine["Ld_H"], machine["flux_Wb"]
    return -2.0 * salient * current_q**2 / (psi + math.sqrt(psi**2 + 4.0 * (salient * current_q) ** 2))


def field_of(
    table: Mapping[str, object], machine: Mapping[str, float], gain: float, wires: Mapping[str, Signal]
) -> Field | None:
    """Read the keys; None where there are none. `gain` is kp_d in V/A."""
    if not any(key in table for key in KEYS):
        return None
    largest = max(abs(wires["reference_q_A"].low), abs(wires["reference_q_A"].high))
    slopes: list[float] = []
    if truth(table, "mtpa", False):
        if machine["Ld_H"] == machine["Lq_H"]:
            raise DesignError(
                "controller.mtpa = true has nothing to do where Ld_H and Lq_H are the same: a current along d gives no "
                "torque; remove it"
            )
        points = [least_current(machine, largest * k / POINTS) for k in range(POINTS + 1)]
        slopes = [(after - before) * POINTS / largest for before, after in itertools.pairwise(points)]
    most = positive(table, "weakening_A", None) if "weakening_A" in table else 0.0
    ends = machine["flux_Wb"] / machine["Ld_H"]
    if most >= ends:
        raise DesignError(
            f"controller.weakening_A = {most:g} takes the whole field away: psi/Ld is {ends:.4g} A; give less"
        )
    found = Field(
        tuple(slopes), largest / POINTS, gain / machine["Ld_H"] * machine["flux_Wb"] / (SLOWER * machine["Ld_H"]), most
    )
    held = min(abs(wires[f"current_{phase}_A"].low) for phase in "ab")
    if found.reach() > held:
        raise DesignError(
            f"controller.mtpa and weakening_A ask for up to {found.reach():.4g} A along d, beyond signals.current_a_A "
            f"or current_b_A, {held:g} A; give less weakening_A or widen the signals"
        )
    return found
