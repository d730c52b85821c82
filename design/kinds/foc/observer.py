r"""Angle and speed of a machine without an encoder, from its currents and the voltages that it was given.

`observer = "flux"` (Ortega, Praly, Astolfi, Lee and Nam, IEEE Trans. Control Syst. Technol. 19(3), 2011, of the
active flux of Boldea, Paicu and Andreescu, IEEE Trans. Power Electron. 23(6), 2008): the flux x of the stator is
integrated and drawn to the circle that it must lie on, with n = (x - Lq i)/psi, r = 1 + (Ld - Lq) i_d/psi, and g the
speed of the hand-over::

    x[k+1] = x + h (v - R i) + h g psi min(max(r^2 - |n|^2, -1), 1) n/2           e = n_be cos(th) - n_al sin(th)

`observer = "sliding_mode"` (Chen, Tomita, Doki and Okuma, IEEE Trans. Ind. Electron. 50(2), 2003, for the extended back
EMF): a current y is driven to the measured one by a voltage s, which then is the EMF::

    s = min(max(Ld/(2 h) (y - i), -K), K)       y[k+1] = y + h/Ld (v - R i - w (Ld - Lq) J i - s)
    e = -(s_al cos(th) + s_be sin(th))/(psi w)        its magnitude no less than at a quarter of the hand-over

Both turn a phase-locked loop of bandwidth c (`pll_rad_s`, default the speed of the hand-over), critically damped::

    w[k+1] = w + h c^2 e            th[k+1] = th + h (w + 2 c e)

The EMF s lags, so that the angle in use is 3/2 h w ahead of th. The voltage v is taken to act from the sample that it
is computed in.

From rest no voltage tells the angle. So a start first turns a current, 10 reference_q_A and `start_A` at most, with a
ramp of `ramp_rad_s2` in the direction of the reference; at `hand_over_rad_s`, once the observer is at half of that too,
its angle takes over, and the references. It hands back below a third of it. A reference of less than a hundredth of
`start_A` starts nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from firmloop.design.law import DesignError
from firmloop.design.table import choice, positive
from firmloop.identify.signal import Signal

KINDS = ("flux", "sliding_mode")
KEYS = ("observer", "start_A", "ramp_rad_s2", "hand_over_rad_s", "pll_rad_s")
HALF = 0.5  # of the deadbeat gain: s follows an EMF with a lag of 3/2 periods
LAG = 1.0 / HALF - 0.5  # periods
PUSH = 10.0  # times reference_q_A, on the ramp, up to `start_A`
WHY = "limited where it is stored: "

Pair = tuple[ca.SX, ca.SX]


@dataclass(frozen=True, slots=True)
class Frame:
    """What the currents are controlled in: angle and speed in use, and the references there."""

    angle: ca.SX
    speed: ca.SX
    reference_d: ca.SX
    reference_q: ca.SX


@dataclass(frozen=True, slots=True)
class Observer:
    """All constants; `fastest` is the speed that the supply allows, `most` the largest current, in A."""

    kind: str
    machine: Mapping[str, float]
    period: float  # s
    start: float  # A
    ramp: float  # rad/s^2
    hand_over: float  # rad/s
    bandwidth: float  # rad/s
    fastest: float  # rad/s
    most: float  # A

    def states(self) -> tuple[tuple[Signal, float, str], ...]:
        """Return the state variables, what they begin with, and why they keep their range."""
        psi, wide = self.machine["flux_Wb"], math.pi
        if self.kind == "flux":
            reach = 2.0 * (psi + self.machine["Lq_H"] * self.most)
            own = [(f"flux_{axis}", "Wb", reach, psi if axis == "alpha" else 0.0) for axis in ("alpha", "beta")]
        else:
            own = [(f"model_{axis}", "A", 4.0 * self.most, 0.0) for axis in ("alpha", "beta")]
        own += [("seen_angle", "rad", wide, 0.0), ("seen_speed", "rad/s", self.fastest, 0.0)]
        own += [("ramp_angle", "rad", wide, 0.0), ("ramp_speed", "rad/s", self.fastest, 0.0)]
        kept = [(Signal(name, unit, -most, most), begin, f"{WHY}{most:.6g} {unit}") for name, unit, most, begin in own]
        return (*kept, (Signal("running", "1", 0.0, 1.0), 0.0, "0 on the ramp, 1 behind the hand-over"))

    def frame(self, x: Mapping[str, ca.SX], references: Pair) -> Frame:
        """Return the angle in use: that of the ramp, or the observed one."""
        running, r_d, r_q = x["running"] > 0.5, *references
        pushed = ca.fmin(ca.fmax(PUSH * r_q, -self.start), self.start)
        return Frame(
            angle=ca.if_else(running, x["seen_angle"], x["ramp_angle"]),
            speed=ca.if_else(running, x["seen_speed"], x["ramp_speed"]),
            reference_d=ca.if_else(running, r_d, 0.0),
            reference_q=ca.if_else(running, r_q, pushed),
        )

    def after(self, x: Mapping[str, ca.SX], used: Frame, r_q: ca.SX, current: Pair, voltage: Pair) -> list[ca.SX]:
        """Return the next values of `states`, from the current of this sample and the voltage it is given."""
        h, c = self.period, self.bandwidth
        ahead = LAG * h if self.kind == "sliding_mode" else 0.0
        tracked = x["seen_angle"] - ahead * x["seen_speed"]
        cosine, sine = ca.cos(tracked), ca.sin(tracked)
        seen = self._flux if self.kind == "flux" else self._model
        error, own = seen(x, (cosine, sine), current, voltage)
        error = ca.fmin(ca.fmax(error, -1.0), 1.0)
        speed = self._slow(x["seen_speed"] + (h * c * c) * error)
        angle = _wrapped(tracked + h * x["seen_speed"] + (2.0 * h * c) * error + ahead * speed)
        running, low = x["running"] > 0.5, self.hand_over / 3.0
        step = h * self.ramp
        up = ca.fmin(ca.fmax(x["ramp_speed"] + ca.if_else(r_q < 0, -step, step), -self.hand_over), self.hand_over)
        ramp_speed = ca.if_else(running, x["seen_speed"], ca.if_else(ca.fabs(r_q) > self.start / PUSH**2, up, 0.0))
        ramp_angle = _wrapped(used.angle + h * used.speed)
        along = ca.if_else(x["ramp_speed"] < 0, -x["seen_speed"], x["seen_speed"])
        there = ca.logic_and(ca.fabs(x["ramp_speed"]) > 0.999 * self.hand_over, along > 0.5 * self.hand_over)
        kept = ca.if_else(ca.fabs(x["seen_speed"]) > low, 1.0, 0.0)
        again = ca.if_else(running, kept, ca.if_else(there, 1.0, 0.0))
        return [*own, angle, speed, ramp_angle, ramp_speed, again]

    def _slow(self, speed: ca.SX) -> ca.SX:
        return ca.fmin(ca.fmax(speed, -self.fastest), self.fastest)

    def _flux(self, x: Mapping[str, ca.SX], turn: Pair, current: Pair, voltage: Pair) -> tuple[ca.SX, list[ca.SX]]:
        r, along, across, psi = (self.machine[key] for key in ("R_ohm", "Ld_H", "Lq_H", "flux_Wb"))
        own = [x["flux_alpha"], x["flux_beta"]]
        n = [(1.0 / psi) * flux - (across / psi) * i for flux, i in zip(own, current, strict=True)]
        size = 1.0 + ((along - across) / psi) * (turn[0] * current[0] + turn[1] * current[1])
        off = ca.fmin(ca.fmax(size * size - (n[0] * n[0] + n[1] * n[1]), -1.0), 1.0)
        h, drawn = self.period, 0.5 * self.period * self.hand_over * psi
        reach = self.states()[0][0].high
        moved = [
            flux + h * v - (h * r) * i + drawn * (off * part)
            for flux, v, i, part in zip(own, voltage, current, n, strict=True)
        ]
        return n[1] * turn[0] - n[0] * turn[1], [ca.fmin(ca.fmax(flux, -reach), reach) for flux in moved]

    def _model(self, x: Mapping[str, ca.SX], turn: Pair, current: Pair, voltage: Pair) -> tuple[ca.SX, list[ca.SX]]:
        r, along, across, psi = (self.machine[key] for key in ("R_ohm", "Ld_H", "Lq_H", "flux_Wb"))
        own = [x["model_alpha"], x["model_beta"]]
        h, most, w = self.period, 1.5 * self.fastest * psi, x["seen_speed"]
        given = [ca.fmin(ca.fmax((HALF * along / h) * (y - i), -most), most) for y, i in zip(own, current, strict=True)]
        crossed = ((along - across) * w * current[1], -((along - across) * w) * current[0])
        reach = 4.0 * self.most
        moved = [
            y + (h / along) * (v - r * i - cross - s)
            for y, v, i, cross, s in zip(own, voltage, current, crossed, given, strict=True)
        ]
        size = ca.fmin(ca.fmax(ca.fabs(w), self.hand_over / 4.0), self.fastest)
        swept = (given[0] * turn[0] + given[1] * turn[1]) * ((1.0 / psi) / size)
        error = ca.if_else(x["ramp_speed"] < 0, swept, -swept)
        return error, [ca.fmin(ca.fmax(y, -reach), reach) for y in moved]


def observer_of(
    table: Mapping[str, object], machine: Mapping[str, float], period: float, wires: Mapping[str, Signal]
) -> Observer | None:
    """Read the keys of an observer; None where the table has none."""
    if "observer" not in table:
        for key in KEYS[1:]:
            if key in table:
                raise DesignError(f'controller.{key} has no effect without an observer; add observer = "flux"')
        return None
    kind = choice(table, "observer", None, KINDS)
    hand_over = positive(table, "hand_over_rad_s", None)
    fastest = 1.25 * wires["supply_V"].high / math.sqrt(3.0) / machine["flux_Wb"]
    if hand_over > fastest / 2.0:
        raise DesignError(
            f"controller.hand_over_rad_s = {hand_over:g} is more than half of what the supply allows, {fastest:.4g} "
            "rad/s electrical; give less, a tenth of the rated speed is usual"
        )
    sizes = [max(abs(wires[f"current_{phase}_A"].low), wires[f"current_{phase}_A"].high) for phase in "ab"]
    most = math.hypot(sizes[0], (sizes[0] + 2.0 * sizes[1]) / math.sqrt(3.0))
    bandwidth = positive(table, "pll_rad_s", max(hand_over, 1.0))
    if 2.0 * bandwidth * period > 0.5:
        raise DesignError(
            f"controller.pll_rad_s = {bandwidth:g} is too fast for period_s = {period:g}; "
            f"give at most {0.25 / period:.4g}"
        )
    start = positive(table, "start_A", None)
    if start > min(abs(wires["reference_q_A"].low), wires["reference_q_A"].high):
        raise DesignError(f"controller.start_A = {start:g} is beyond signals.reference_q_A; give less, or widen it")
    ramp = positive(table, "ramp_rad_s2", None)
    return Observer(kind, machine, period, start, ramp, hand_over, bandwidth, fastest, most)


def _wrapped(angle: ca.SX) -> ca.SX:
    """Return an angle within -pi..pi, of one that is at most one turn beyond."""
    down = ca.if_else(angle > math.pi, angle - 2.0 * math.pi, angle)
    return ca.if_else(angle < -math.pi, angle + 2.0 * math.pi, down)
