"""A DC motor with one effect, integrated by tiny explicit steps: written apart from the simulator it judges."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
State = list[float]

R, L, KE, KT, J, B = 2.0, 2e-3, 0.03, 0.03, 2e-5, 1e-5
SUBSTEPS = 40  # per row; R/L is 1000/s, so that the classical formula is right to 1e-10


@dataclass
class Motor:
    """States: current, speed, angle, then three spare ones that an effect may use (`extra_rate`)."""

    torque: Callable[[State, float, int], float] = lambda x, t, s: 0.0
    voltage: Callable[[State], float] = lambda x: 0.0
    level: Callable[[State, int], float] | None = None  # dry friction, N m
    brush: float = 0.0  # V
    limit: float = math.inf  # A, of a motor without brushes' drop; at it `flow` is -2 or 2
    diode: bool = False  # lets current through the way the voltage points; `flow` is 3 where none flows
    current_torque: Callable[[float], float] = lambda i: KT * i
    inverse_inductance: Callable[[float], float] = lambda i: 1.0 / L
    extra: Callable[[State], State] = lambda x: [0.0, 0.0, 0.0]
    start: State = field(default_factory=lambda: [0.0] * 6)
    on_turn: Callable[[State, int], None] = lambda x, s: None

    def rate(self, x: State, u: float, t: float, way: int, flow: int) -> State:
        push = self.pull(x, t, way)
        if self.level is not None:
            push = 0.0 if way == 0 else push - way * self.level(x, way)
        drop = self.drive(x, u) - flow * self.brush
        if (self.brush and flow == 0) or abs(flow) >= 2:
            drop = 0.0
        if self.diode and flow * u <= 0.0 < flow * (u - KE * x[1]):
            drop = -R * x[0]  # no switch is closed that way: what still flows dies away
        return [drop * self.inverse_inductance(x[0]), push / J, x[1], *self.extra(x)]

    def pull(self, x: State, t: float, way: int) -> float:
        return self.current_torque(x[0]) - B * x[1] + self.torque(x, t, way)

    def drive(self, x: State, u: float) -> float:
        return u - R * x[0] - KE * x[1] + self.voltage(x)

    def run(self, moments: Array, inputs: Callable[[float], float], reads: Array) -> Array:
        """Integrate from the first of `moments`, where the input may jump; return the states at `reads` (q, 6)."""
        x, t = list(self.start), float(moments[0])
        way, flow = 0 if self.level is not None else 1, 0
        nodes = sorted({*moments.tolist(), *reads.tolist()})
        found = {t: list(x)}
        for begin, end in pairwise(nodes):
            found[begin] = list(x)
            middle = begin + 1e-9 * (end - begin)
            h = (end - begin) / max(1, math.ceil((end - begin) / (1e-3 / SUBSTEPS) - 1e-9))
            t = begin
            value = inputs(middle)
            u = straight(begin, value, end, inputs(end - 1e-9 * (end - begin)))
            way, flow = self.free(x, value, t, way, flow)
            while end - t > 1e-13:
                step = min(h, end - t)
                y = self.classical(x, u, t, step, way, flow)
                if self.crossed(y, u(t + step), t + step, way, flow):
                    low, high = 0.0, step
                    for _ in range(45):
                        half = 0.5 * (low + high)
                        if self.crossed(self.classical(x, u, t, half, way, flow), u(t + half), t + half, way, flow):
                            high = half
                        else:
                            low = half
                    x = self.classical(x, u, t, high, way, flow)
                    t += high
                    way, flow = self.turn(x, u(t), t, way, flow)
                    continue
                x, t = y, t + step
            found[end] = list(x)
        return np.array([found[float(at)] for at in reads])

    def classical(self, x: State, u: Callable[[float], float], t: float, h: float, way: int, flow: int) -> State:
        k1 = self.rate(x, u(t), t, way, flow)
        k2 = self.rate([a + 0.5 * h * k for a, k in zip(x, k1, strict=True)], u(t + 0.5 * h), t + 0.5 * h, way, flow)
        k3 = self.rate([a + 0.5 * h * k for a, k in zip(x, k2, strict=True)], u(t + 0.5 * h), t + 0.5 * h, way, flow)
        k4 = self.rate([a + h * k for a, k in zip(x, k3, strict=True)], u(t + h), t + h, way, flow)
        return [a + h / 6.0 * (p + 2.0 * q + 2.0 * r + s) for a, p, q, r, s in zip(x, k1, k2, k3, k4, strict=True)]

    def crossed(self, x: State, u: float, t: float, way: int, flow: int) -> bool:
        if self.level is not None and (way * x[1] < 0.0 if way else self.breaks(x, t) != 0):
            return True
        if self.limit < math.inf:
            return flow * self.drive(x, u) < 0.0 if flow else abs(x[0]) > self.limit
        if self.diode:
            return self.drive(x, u) * u > 0.0 if flow == 3 else flow * x[0] < 0.0
        return bool(self.brush) and (flow * x[0] < 0.0 if flow else abs(self.drive(x, u)) > self.brush)

    def breaks(self, x: State, t: float) -> int:
        push = self.pull(x, t, 0)
        way = 1 if push > 0.0 else -1
        assert self.level is not None
        return way if abs(push) > self.level(x, way) else 0

    def free(self, x: State, u: float, t: float, way: int, flow: int) -> tuple[int, int]:
        if self.level is not None and way == 0:
            way = self.breaks(x, t)
        if self.brush and flow == 0 and abs(self.drive(x, u)) > self.brush:
            flow = 1 if self.drive(x, u) > 0.0 else -1
        return way, self.through(x, u, flow)

    def through(self, x: State, u: float, flow: int) -> int:
        if not self.diode or x[0] != 0.0:
            return flow
        push = self.drive(x, u)
        return 3 if push * u <= 0.0 else (1 if push > 0.0 else -1)

    def turn(self, x: State, u: float, t: float, way: int, flow: int) -> tuple[int, int]:
        if self.level is not None and (way * x[1] <= 0.0 if way else self.breaks(x, t) != 0):
            x[1] = 0.0
            self.on_turn(x, way)
            way = self.breaks(x, t)
        if self.limit < math.inf:
            side = 1 if x[0] > 0.0 else -1
            x[0] = min(max(x[0], -self.limit), self.limit)
            flow = 2 * side if abs(x[0]) == self.limit and side * self.drive(x, u) > 0.0 else 0
        if self.diode:
            x[0] = 0.0 if flow == 3 or flow * x[0] <= 0.0 else x[0]
            flow = self.through(x, u, flow)
        if self.brush and (flow * x[0] <= 0.0 if flow else abs(self.drive(x, u)) > self.brush):
            x[0] = 0.0
            push = self.drive(x, u)
            flow = 0 if abs(push) <= self.brush else (1 if push > 0.0 else -1)
        return way, flow


def straight(begin: float, first: float, end: float, last: float) -> Callable[[float], float]:
    """Return the straight line between two points."""
    return lambda at: first + (last - first) * (at - begin) / (end - begin)


NOMINAL: Mapping[str, float] = {"R_ohm": R, "L_H": L, "ke_V_s_rad": KE, "kt_N_m_A": KT, "J_kg_m2": J, "b_N_m_s_rad": B}
