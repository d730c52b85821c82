"""Laws that several tests share."""

from __future__ import annotations

import casadi as ca
import numpy as np

from firmloop.design.kinds import design
from firmloop.design.law import Flag, Law, Scalar
from firmloop.identify.signal import Signal

SPEED = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
VOLTS = (Signal("output", "V", -12.0, 12.0),)
FULL = {"kp": 0.05, "ki": 1.4, "kd": 0.0004, "tf_s": 0.01, "tt_s": 0.05, "b": 0.7, "c": 0.2}
TABLES = {
    "full": FULL,
    "pi": {"kp": 0.05, "ki": 1.4},
    "p": {"kp": 0.05},
    "clamping": {**FULL, "anti_windup": "clamping"},
    "tustin": {**FULL, "form": "tustin"},
    "unfiltered": {"kp": 0.05, "ki": 1.4, "kd": 0.00002, "tf_s": 0.0},
    "narrow": {**FULL, "u_min": -3.3, "u_max": 11.7},
}


def pid(table: dict[str, object]) -> Law:
    """Return the law of one controller table over the example's signals."""
    return design("pid", "motor_pid", table, 0.001, SPEED, VOLTS, None).law


def random_law(random: np.random.Generator) -> Law:
    """Return a stable linear law with limits, two states, two inputs and two outputs."""
    n = 2
    a = random.normal(size=(n, n))
    a *= random.uniform(0.1, 0.95) / max(abs(np.linalg.eigvals(a)))
    b = random.normal(size=(n, 2)) * 10.0 ** random.uniform(-3, 1)
    c = random.normal(size=(2, n)) * 10.0 ** random.uniform(-2, 2)
    d = random.normal(size=(2, 2))
    spans = 10.0 ** random.uniform(-2, 3, size=2)
    limits = 10.0 ** random.uniform(-1, 2, size=2)
    power, reach = np.eye(n), np.zeros(n)
    for _ in range(2000):
        reach += np.abs(power @ b) @ spans
        power = a @ power
    reach = reach * 1.01 + 1e-9
    x, z = ca.SX.sym("x", n), ca.SX.sym("z", 2)
    free = ca.mtimes(ca.DM(c), x) + ca.mtimes(ca.DM(d), z)
    out = ca.vertcat(*[ca.fmin(ca.fmax(free[i], -limits[i]), limits[i]) for i in range(2)])
    function = ca.Function(
        "law", [x, z], [ca.mtimes(ca.DM(a), x) + ca.mtimes(ca.DM(b), z), out, out[0] != free[0], free[1]]
    )
    return Law(
        name="random_law",
        says="a random linear law",
        period=0.01,
        inputs=tuple(Signal(f"z_{i}", "V", -spans[i], spans[i]) for i in range(2)),
        outputs=tuple(Signal(f"u_{i}", "V", -limits[i], limits[i]) for i in range(2)),
        state=tuple(Signal(f"x_{i}", "V", -reach[i], reach[i]) for i in range(n)),
        start=(0.0,) * n,
        why=("L1 norm of the impulse response",) * n,
        flags=(Flag("limited", "output 0 stands at its limit"),),
        stages=(Scalar(function, (Signal("free", "V", -np.inf, np.inf),)),),
    )
