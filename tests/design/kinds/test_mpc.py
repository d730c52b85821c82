"""Predictive control in closed loop, with model error and disturbance; and what it refuses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from firmloop.design.design import Request
from firmloop.design.kinds.mpc.kind import design
from firmloop.design.law import DesignError, Law
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.graph import evaluator, law_graph
from firmloop.quantize.twins.qp import optimum

Array = np.ndarray
PERIOD = 0.01
VOLT = Signal("voltage", "V", -6.0, 6.0)


def servo(inertia: float = 1.0, friction: float = 1.0) -> tuple[Array, Array]:
    """A DC servo, angle and speed, sampled behind a hold; the factors are errors of the model."""
    a = np.array([[0.0, 1.0], [0.0, -8.0 * friction / inertia]])
    b = np.array([[0.0], [60.0 / inertia]])
    whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, 3))]]) * PERIOD)
    return whole[:2, :2], whole[:2, 2:]


def cart_pole(mass: float = 1.0) -> tuple[Array, Array]:
    """The cart-pole about the upright: position, angle, speed, turning; `mass` scales the pole's."""
    cart, pole, length, gravity = 1.0, 0.2 * mass, 0.5, 9.81
    a = np.zeros((4, 4))
    a[0, 2] = a[1, 3] = 1.0
    a[2, 1], a[3, 1] = -pole * gravity / cart, (cart + pole) * gravity / (cart * length)
    b = np.array([[0.0], [0.0], [10.0 / cart], [-10.0 / (cart * length)]])
    whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, 5))]]) * 0.02)
    return whole[:4, :4], whole[:4, 4:]


class Running:
    """A law that is stepped sample by sample, in float64."""

    def __init__(self, law: Law) -> None:
        self.law, self.graph = law, law_graph(law)
        self.state = [np.array([x]) for x in law.start]

    def step(self, inputs: Mapping[str, float]) -> tuple[Array, tuple[bool, ...]]:
        """Return the outputs and the flags."""
        columns = [np.array([min(max(inputs[s.name], s.low), s.high)]) for s in self.law.inputs]
        after, outputs, flags, _ = evaluator(self.graph)([self.state, columns])
        self.state = [np.broadcast_to(x, 1) for x in after]
        return np.array([float(np.ravel(u)[0]) for u in outputs]), tuple(bool(np.ravel(f)[0]) for f in flags)


def table(model: tuple[Array, Array], **keys: object) -> dict[str, object]:
    return {"A": model[0].tolist(), "B": model[1].tolist(), **keys}


def request(own: dict[str, object], inputs: tuple[Signal, ...], outputs: tuple[Signal, ...] = (VOLT,)) -> Request:
    return Request("test_mpc", own, PERIOD, inputs, outputs, None, optimum)


ANGLE, SPEED = Signal("angle", "rad", -10.0, 10.0), Signal("speed", "rad/s", -60.0, 60.0)
REFERENCE = Signal("reference", "rad", -10.0, 10.0)
SERVO = {"horizon": 15, "Q": [200.0, 0.1], "R": 0.01}


def servo_run(
    own: dict[str, object], inputs: tuple[Signal, ...], plant: tuple[Array, Array], steps: int,
    read: Callable[[Array], dict[str, float]], load: float = 0.0, delay: int = 0,
) -> tuple[Array, Array]:  # fmt: skip
    """States before each sample and the voltages that act; `load` in V stands against the drive from sample 100 on."""
    running, x = Running(design(request(own, inputs)).law), np.zeros(2)
    on_the_way = [0.0] * delay
    states, voltages = [], []
    for k in range(steps):
        u, (capped, infeasible) = running.step(read(x))
        assert not capped and not infeasible
        on_the_way.append(float(u[0]))
        acting = on_the_way.pop(0)
        states.append(x)
        voltages.append(acting)
        x = plant[0] @ x + plant[1][:, 0] * (acting - (load if k >= 100 else 0.0))
    return np.array(states), np.array(voltages)


def test_a_servo_with_a_wrong_model_and_a_load_keeps_its_limits_and_leaves_no_offset() -> None:
    own = table(servo(), **SERVO, offset_free=True, du_min=-2.0, du_max=2.0, x_max=[np.inf, 20.0], x_soft=1e3)
    states, voltages = servo_run(
        own, (REFERENCE, ANGLE, SPEED), servo(1.2, 0.8), 300,
        lambda x: {"reference": 2.0, "angle": x[0], "speed": x[1]}, load=1.0,
    )  # fmt: skip
    assert np.max(np.abs(voltages)) <= 6.0 and np.max(np.abs(np.diff(voltages, prepend=0.0))) <= 2.0 + 1e-12
    assert np.max(states[:, 1]) < 20.0 * 1.05 and np.max(states[:, 1]) > 19.0, "the speed limit is met and softened"
    assert abs(states[99, 0] - 2.0) < 1e-3 and abs(states[-1, 0] - 2.0) < 1e-4


def test_without_a_disturbance_model_a_load_leaves_an_offset() -> None:
    states, _ = servo_run(
        table(servo(), **SERVO), (REFERENCE, ANGLE, SPEED), servo(1.2, 0.8), 300,
        lambda x: {"reference": 2.0, "angle": x[0], "speed": x[1]}, load=1.0,
    )  # fmt: skip
    assert abs(states[-1, 0] - 2.0) > 1e-3


def test_a_kalman_filter_stands_in_for_the_speed() -> None:
    own = table(
        servo(), **SERVO, C=[[1.0, 0.0]], observer="kalman", process_noise=[1e-8, 1e-3], measurement_noise=1e-6,
        offset_free=True, disturbance_noise=1e-3,
    )  # fmt: skip
    states, voltages = servo_run(
        own, (REFERENCE, ANGLE), servo(0.9, 1.1), 400, lambda x: {"reference": 1.0, "angle": x[0]}, load=0.5
    )
    assert abs(states[-1, 0] - 1.0) < 1e-4 and np.max(np.abs(voltages)) <= 6.0


def test_outputs_on_their_way_are_told_to_the_prediction() -> None:
    """With the delay known, the run is the undelayed one, later; with it unknown it overshoots much more."""
    delay, inputs = 4, (ANGLE, SPEED)

    def after(told: int, acting: int) -> Array:
        running = Running(design(request(table(servo(), **SERVO, delay_periods=told), inputs)).law)
        x, way, seen = np.array([1.0, 0.0]), [0.0] * acting, []
        for _ in range(150):
            u, _ = running.step({"angle": x[0], "speed": x[1]})
            way.append(float(u[0]))
            seen.append(x)
            x = servo()[0] @ x + servo()[1][:, 0] * way.pop(0)
        return np.array(seen)

    known, undelayed, unknown = after(delay, delay), after(0, 0), after(0, delay)
    assert np.allclose(known[delay:], undelayed[:-delay], atol=1e-9)
    assert unknown[:, 0].min() < known[:, 0].min() - 0.05


@pytest.mark.parametrize("mass", [0.7, 1.0, 1.4])
def test_the_cart_pole_stands_in_spite_of_a_wrong_pole_and_a_push(mass: float) -> None:
    sizes = {"position": ("m", 1.0), "angle": ("rad", 0.5), "speed": ("m/s", 3.0), "turning": ("rad/s", 4.0)}
    inputs = tuple(Signal(name, unit, -size, size) for name, (unit, size) in sizes.items())
    own = table(
        cart_pole(), horizon=19, Q=[10.0, 1.0, 0.1, 0.1], R=0.1, x_min=[-0.5, -np.inf, -0.8, -np.inf],
        x_max=[0.5, np.inf, 0.8, np.inf], x_soft=1e4, offset_free=True,
    )  # fmt: skip
    running = Running(design(request(own, inputs, (Signal("force", "1", -1.0, 1.0),))).law)
    (a, b), x = cart_pole(mass), np.array([0.3, 0.05, 0.0, 0.0])
    states = []
    for k in range(400):
        u, (capped, infeasible) = running.step(dict(zip(sizes, x, strict=True)))
        assert abs(u[0]) <= 1.0 and not capped and not infeasible
        states.append(x)
        x = a @ x + b[:, 0] * (u[0] - 0.05)  # a push that the model does not know
        if k == 200:
            x = x + np.array([0.0, 0.05, 0.0, 0.3])
    seen = np.array(states)
    assert np.max(np.abs(seen[:, 0])) < 0.5 * 1.02 and np.max(np.abs(seen[:, 2])) < 0.8 * 1.1
    assert np.max(np.abs(seen[-1])) < 2e-3, "upright, at rest and in the middle"


def test_infeasible_is_told_and_the_output_keeps_its_limits() -> None:
    own = table(servo(), horizon=5, Q=[200.0, 0.1], R=0.01, x_max=[0.5, np.inf], x_min=[-0.5, -np.inf])
    running = Running(design(request(own, (ANGLE, SPEED))).law)
    u, (capped, infeasible) = running.step({"angle": 3.0, "speed": 20.0})
    assert infeasible and not capped and -6.0 <= u[0] < 0.0
    u, flags = running.step({"angle": 0.1, "speed": 0.0})
    assert flags == (False, False)


def test_blocks_hold_moves_and_leave_a_smaller_problem() -> None:
    whole, held = (
        design(request(table(servo(), **SERVO, **more), (ANGLE, SPEED))) for more in ({}, {"blocks": [1, 2, 4, 8]})
    )
    assert whole.gains["moves"] == 15 and held.gains["moves"] == 4
    x = {"angle": 0.2, "speed": 0.0}
    one, other = (float(Running(found.law).step(x)[0][0]) for found in (whole, held))
    assert abs(one - other) < 0.1 * abs(one)


def test_two_outputs() -> None:
    a, b = servo()
    both = table((np.kron(np.eye(2), a), np.kron(np.eye(2), b)), horizon=6, Q=[200.0, 0.1, 200.0, 0.1], R=0.01)
    inputs = tuple(Signal(f"{name}_{k}", "1", -10.0, 10.0) for k in (1, 2) for name in ("angle", "speed"))
    outputs = tuple(Signal(f"voltage_{k}", "V", -6.0, 6.0) for k in (1, 2))
    alone = Running(design(request(table((a, b), horizon=6, Q=[200.0, 0.1], R=0.01), (ANGLE, SPEED))).law)
    pair = Running(design(request(both, inputs, outputs)).law)
    for first, second in (((0.1, 0.0), (-0.02, 1.0)), ((3.0, 0.0), (0.01, -2.0))):
        values = dict(zip([wire.name for wire in inputs], (*first, *second), strict=True))
        expected = [alone.step({"angle": x[0], "speed": x[1]})[0][0] for x in (first, second)]
        assert np.allclose(pair.step(values)[0], expected, atol=1e-9)


WRONG = {
    "horizon = 0": ({"horizon": 0}, r"controller.horizon = 0 is out of range; it must be a whole number from 1 to 200"),
    "horizon = 300": ({"horizon": 300}, r"controller.horizon = 300 is out of range"),
    "too many rows": (
        {"horizon": 180, "x_max": [1.0, 1.0], "x_min": [-1.0, -1.0]},
        r"controller.horizon = 180.* give 540 rows, .* bytes of constants; at most 500 rows",
    ),
    "indefinite Q": ({"Q": [[1.0, 2.0], [2.0, 1.0]]}, r"controller.Q must be symmetric and not negative.* -1"),
    "huge Q": ({"Q": [1e300, 0.1]}, r"controller.Q is up to 1e\+300 and R from 0.01 to 0.01; .* ratio of 1e\+15"),
    "huge R": ({"R": 1e300}, r"controller.Q is up to 200 and R from 1e\+300 to 1e\+300"),
    "an input that moves nothing": ({"B": [[0.0], [0.0]]}, r"controller.B is all 0 \(2 x 1\)"),
    "rows for each sample and its change": (
        {"horizon": 200, "du_min": -1.0, "x_max": [1.0, np.inf]},
        r"horizon = 200: .* give 600 rows, 1440000",
    ),
    "zero R": ({"R": 0.0}, r"controller.R must be symmetric and positive definite; its least eigenvalue is 0"),
    "indefinite P": ({"P": [-1.0, 1.0]}, r"controller.P must be symmetric and not negative"),
    "crossed limits": ({"x_min": [1.0, 0.0], "x_max": [-1.0, 1.0]}, r"x_min = 1 is not below x_max = -1 for x_1"),
    "nothing feasible": (
        {"x_min": [50.0, -np.inf], "x_max": [60.0, np.inf]},
        r"leave no state within the ranges .*least violation is 3\d",
    ),
    "u beyond the wire": ({"u_max": 7.0}, r"controller.u_min = -6 and u_max = 7 of signals.voltage are out of order"),
    "blocks": ({"blocks": [1, 2, 3]}, r"controller.blocks = \[1.0, 2.0, 3.0\] holds 6 samples.*15"),
    "du": ({"du_min": 0.0}, r"controller.du_min = 0 and du_max = inf do not let the output rest"),
    "soft": ({"x_soft": -1.0}, r"controller.x_soft = -1 is out of range"),
    "unknown key": ({"horizont": 3}, r"did you mean 'horizon'"),
    "unknown state": ({"states": ["angle", "spin"]}, r"controller.states names 'spin', which is no input"),
    "solver": ({"solver": "magic"}, r"controller.solver = 'magic' is unknown"),
    "not a number in A": ({"A": [[np.nan, 0.0], [0.0, 0.5]]}, r"controller.A = nan is not finite"),
    "a ragged A": ({"A": [[1.0, 0.0], [0.0]]}, r"controller.A has rows of \[1, 2\] numbers"),
    "a short B": ({"B": [[1.0]]}, r"controller.B is 1 x 1, but A .* ask for 2 x 1"),
    "half a fixed iteration": (
        {"solver": "fixed_iterations", "accuracy": 2e-5},
        r"controller.accuracy = 2e-05 .*0.0001",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_bad_tables_are_refused_with_the_number(case: str) -> None:
    keys, says = WRONG[case]
    with pytest.raises(DesignError, match=says):
        design(request({**table(servo(), **SERVO), **keys}, (ANGLE, SPEED)))


def test_an_unstable_plant_that_no_input_reaches_is_refused() -> None:
    with pytest.raises(DesignError, match=r"controller.A has a mode at z = 1.2 that .* no input reaches"):
        design(request(table((np.diag([1.2, 0.5]), np.array([[0.0], [1.0]])), **SERVO), (ANGLE, SPEED)))


def test_an_ill_conditioned_horizon_is_refused() -> None:
    with pytest.raises(DesignError, match=r"too ill-conditioned for float32: \d"):
        design(request(table((np.diag([1.5, 0.5]), np.ones((2, 1))), **SERVO | {"horizon": 60}), (ANGLE, SPEED)))


def test_a_mode_that_no_measurement_shows_is_refused() -> None:
    own = {**table(servo(), **SERVO), "C": [[0.0, 1.0]], "observer": "kalman"}
    with pytest.raises(DesignError, match="shows nothing of a mode at z = 1 that does not fade"):
        design(request({**own, "process_noise": 1e-3, "measurement_noise": 1e-3}, (SPEED,)))


def test_a_weight_that_is_not_symmetric_is_refused_by_its_numbers() -> None:
    with pytest.raises(DesignError, match=r"row 1, column 2 is 0\.5, but row 2, column 1 is 0"):
        design(request({**table(servo(), **SERVO), "Q": [[1.0, 0.5], [0.0, 1.0]]}, (ANGLE, SPEED)))


def test_a_table_of_regions_without_what_solves_is_refused_with_the_way_out() -> None:
    asked = request({**table(servo(), **SERVO), "solver": "explicit"}, (ANGLE, SPEED))
    with pytest.raises(DesignError, match=r"solver = 'explicit' .* optimum = firmloop.quantize.twins.qp.optimum"):
        design(replace(asked, optimum=None))
