"""Run generated predictive controllers against plants that are not their models, and disturbances they do not know.

    python -m bench.mpc.loops

A DC servo with 1.2 of its inertia and 0.8 of its friction, against a load of 1 V from the second second on; and a
cart-pole about the upright with a lighter, the right and a heavier pole, a constant push and a shove. Both in float32,
by the reference that the C agrees with bit for bit. A row says what is left at the end, how far each limit was passed,
and what the searches said. Exit status 1 where an offset is left, or a limit passed by more than ALLOWED of it.
"""

from __future__ import annotations

import sys

import numpy as np
import scipy.linalg

from firmloop.design.kinds import design
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.reference import Machine, start_state, working_type

Array = np.ndarray
ALLOWED = 0.1  # of a softened limit
OFFSET = 2e-3  # rad, m, or their rates


def sampled(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """Return A and B behind a hold."""
    n = len(a)
    whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, n + 1))]]) * period)
    return whole[:n, :n], whole[:n, n:]


def servo(inertia: float, friction: float) -> tuple[Array, Array]:
    """Angle and speed of a DC servo; the factors are errors of the model."""
    return sampled(np.array([[0.0, 1.0], [0.0, -8.0 * friction / inertia]]), np.array([[0.0], [60.0 / inertia]]), 0.01)


def cart_pole(mass: float) -> tuple[Array, Array]:
    """Position, angle, speed and turning of a cart-pole about the upright; `mass` scales the pole's."""
    cart, pole, length, gravity = 1.0, 0.2 * mass, 0.5, 9.81
    a = np.zeros((4, 4))
    a[0, 2] = a[1, 3] = 1.0
    a[2, 1], a[3, 1] = -pole * gravity / cart, (cart + pole) * gravity / (cart * length)
    return sampled(a, np.array([[0.0], [0.0], [10.0 / cart], [-10.0 / (cart * length)]]), 0.02)


class Stepped:
    """A program that is stepped sample by sample."""

    def __init__(self, program: Program) -> None:
        self.machine, self.kind = Machine(program), working_type(program)
        self.state = start_state(program, 1)

    def step(self, inputs: list[float]) -> tuple[float, int]:
        """Return the output and the status word."""
        with np.errstate(all="ignore"):
            values = self.machine.step([np.array([x], self.kind) for x in inputs], self.state)
        self.state = [np.broadcast_to(values[slot], 1) for slot in self.machine.next]
        status = sum(int(np.ravel(values[slot])[0]) << bit for slot, bit in self.machine.status)
        return float(np.ravel(values[self.machine.results[0]])[0]), status


def servo_row() -> int:
    """Print the servo's row; return how much of it is wrong."""
    a, b = servo(1.0, 1.0)
    table = {
        "A": a.tolist(), "B": b.tolist(), "horizon": 15, "Q": [200.0, 0.1], "R": 0.01, "offset_free": True,
        "du_min": -2.0, "du_max": 2.0, "x_max": [np.inf, 20.0], "x_soft": 1e3,
    }  # fmt: skip
    inputs = (
        Signal("reference", "rad", -10, 10), Signal("angle", "rad", -10, 10), Signal("speed", "rad/s", -60, 60),
    )  # fmt: skip
    law = design("mpc", "servo", table, 0.01, inputs, (Signal("voltage", "V", -6, 6),), None).law
    running, (a, b), x = Stepped(lower(law, "float32")), servo(1.2, 0.8), np.zeros(2)
    seen, moves, told = [], [0.0], 0
    for k in range(400):
        u, status = running.step([2.0, *x])
        told += status != 0
        seen.append(x)
        moves.append(u)
        x = a @ x + b[:, 0] * (u - (1.0 if k >= 200 else 0.0))
    states = np.array(seen)
    offsets = abs(states[199, 0] - 2.0), abs(states[-1, 0] - 2.0)
    rate, passed = float(np.max(np.abs(np.diff(moves)))), float(np.max(states[:, 1])) / 20.0 - 1.0
    print(
        f"servo                offset {offsets[0]:.2g} rad without and {offsets[1]:.2g} with the load; voltage "
        f"{np.max(np.abs(moves)):g} of 6 V, change {rate:.6g} of 2 V, speed limit passed by {max(passed, 0.0):.2%}; "
        f"{told} steps without answer"
    )
    return int(max(offsets) > OFFSET or np.max(np.abs(moves)) > 6 or rate > 2 + 1e-5 or passed > ALLOWED or told > 0)


def cart_row(mass: float) -> int:
    """Print the cart-pole's row; return how much of it is wrong."""
    a, b = cart_pole(1.0)
    table = {
        "A": a.tolist(), "B": b.tolist(), "horizon": 19, "Q": [10.0, 1.0, 0.1, 0.1], "R": 0.1, "offset_free": True,
        "x_min": [-0.5, -np.inf, -0.8, -np.inf], "x_max": [0.5, np.inf, 0.8, np.inf], "x_soft": 1e4,
    }  # fmt: skip
    sizes = (("position", "m", 1.0), ("angle", "rad", 0.5), ("speed", "m/s", 3.0), ("turning", "rad/s", 4.0))
    inputs = tuple(Signal(name, unit, -size, size) for name, unit, size in sizes)
    law = design("mpc", "cart", table, 0.02, inputs, (Signal("force", "1", -1, 1),), None).law
    running, (a, b), x = Stepped(lower(law, "float32")), cart_pole(mass), np.array([0.3, 0.05, 0.0, 0.0])
    seen, force, told = [], 0.0, 0
    for k in range(400):
        u, status = running.step(list(x))
        told, force = told + (status != 0), max(force, abs(u))
        seen.append(x)
        x = a @ x + b[:, 0] * (u - 0.05)
        if k == 200:
            x = x + np.array([0.0, 0.05, 0.0, 0.3])
    states = np.array(seen)
    passed = max(np.max(np.abs(states[:, 0])) / 0.5, np.max(np.abs(states[:, 2])) / 0.8) - 1.0
    left = float(np.max(np.abs(states[-1])))
    print(
        f"cart-pole, pole {mass:3.1f}  {left:.2g} left of any state; force {force:g} of 1, position and speed limits "
        f"passed by {max(passed, 0.0):.2%}; {told} steps without answer"
    )
    return int(left > OFFSET or force > 1 or passed > ALLOWED or told > 0)


def main() -> int:
    """Print every row."""
    return 1 if servo_row() + sum(cart_row(mass) for mass in (0.7, 1.0, 1.4)) else 0


if __name__ == "__main__":
    sys.exit(main())
