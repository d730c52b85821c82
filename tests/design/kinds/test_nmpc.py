"""Nonlinear predictive control in closed loop, against another solver's optimum; and what it refuses."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Request
from firmloop.design.kinds.nmpc import KIND, design
from firmloop.design.law import DesignError, Horizon, Law
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.signal import Signal
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.stages.plant import plant_of
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.reference import Machine, run, start_state
from firmloop.verify.stimuli.stimuli import stimuli

EXAMPLE = Path(__file__).parents[3] / "examples" / "pendulum_nmpc" / "pendulum_nmpc.toml"
INFEASIBLE, UNSETTLED = 2, 4
FORCE = 20.0


def swing_up(**keys: object) -> tuple[Plant, Law]:
    """The example's plant and its law, with other keys."""
    project = read_project(EXAMPLE)
    plant, part = plant_of(project), project.controller
    assert part is not None
    table = {key: value for key, value in {**part.settings, **keys}.items() if key not in ("kind", "period_s")}
    wires = project.controller_inputs, project.controller_outputs
    return plant, design(Request("pendulum", table, part.period, *wires, plant)).law


class Stepped:
    """A program that is stepped sample by sample."""

    def __init__(self, program: Program) -> None:
        self.machine, self.kind = Machine(program), np.dtype(program.arithmetic)
        self.state = start_state(program, 1)

    def step(self, inputs: np.ndarray) -> tuple[float, int]:
        """Return the output and the status."""
        with np.errstate(all="ignore"):
            values = self.machine.step([np.array([x], self.kind) for x in inputs], self.state)
        self.state = [np.broadcast_to(values[slot], 1) for slot in self.machine.next]
        status = sum(int(np.ravel(values[slot])[0]) << bit for slot, bit in self.machine.status)
        return float(np.ravel(values[self.machine.results[0]])[0]), status


def moved(plant: Plant, x: np.ndarray, u: float, period: float) -> np.ndarray:
    """Integrate the plant over a sample, in ten steps of Runge-Kutta."""
    constants, h = [parameter.value for parameter in plant.parameters], period / 10
    for _ in range(10):
        k1 = np.array(plant.rate(x, u, constants)).ravel()
        k2 = np.array(plant.rate(x + h / 2 * k1, u, constants)).ravel()
        k3 = np.array(plant.rate(x + h / 2 * k2, u, constants)).ravel()
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + np.array(plant.rate(x + h * k3, u, constants)).ravel())
    return x


class Optimum:
    """The whole nonlinear program, its states kept, solved by ipopt in double precision."""

    def __init__(self, horizon: Horizon, target: np.ndarray) -> None:
        n, m, length = len(horizon.q), len(horizon.r), horizon.length
        x, u = ca.SX.sym("x", n, length + 1), ca.SX.sym("u", m, length)
        cost, gaps = ca.SX(0), []
        self.after = horizon.model.last.function
        for k in range(length):
            weight = horizon.q if k < length - 1 else horizon.p
            away = x[:, k + 1] - target
            cost += (away.T @ weight @ away + u[:, k].T @ horizon.r @ u[:, k]) / 2
            gaps.append(x[:, k + 1] - self.after(ca.SX(0, 1), ca.vertcat(x[:, k], u[:, k]))[1][:n])
        quiet = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-9}
        problem = {"x": ca.veccat(x, u), "f": cost, "g": ca.vertcat(*gaps)}
        self.solver, self.n, self.length = ca.nlpsol("optimum", "ipopt", problem, quiet), n, length

    def move(self, x: np.ndarray, moves: np.ndarray) -> float:
        """Return u[0] of the optimum near the plan `moves`."""
        states = [x]
        for u in moves:
            states.append(np.array(self.after([], np.append(states[-1], u))[1]).ravel()[: self.n])
        free = np.full(self.n * self.length, np.inf)
        force = np.full(self.length, FORCE)
        found = self.solver(
            x0=np.concatenate([*states, moves]), lbg=0, ubg=0,
            lbx=np.concatenate([x, -free, -force]), ubx=np.concatenate([x, free, force]),
        )  # fmt: skip
        assert self.solver.stats()["success"]
        return float(found["x"][self.n * (self.length + 1)])


def test_the_pendulum_swings_up_and_a_clean_status_is_the_optimum() -> None:
    plant, law = swing_up()
    assert law.solve is not None and isinstance(law.solve.problem, Horizon)
    target = np.array([0.0, math.pi, 0.0, 0.0])
    judge, controller = Optimum(law.solve.problem, target), Stepped(lower(law, "float32"))
    x, clean = np.zeros(4), 0
    for k in range(35):
        seen = x.astype(np.float32).astype(np.float64)
        u, status = controller.step(seen)
        assert abs(u) <= FORCE and status in (0, UNSETTLED)
        plan = np.array([u, *(float(part[0]) for part in controller.state[-10:-1])])
        if status == 0:
            clean += 1
            assert abs(u - judge.move(seen, plan)) < 2e-4 * 2 * FORCE
        assert k < 25 or np.max(np.abs(x - target)) < 0.3
        x = moved(plant, x, u, law.period)
    assert clean >= 20
    assert np.max(np.abs(x - target)) < 0.1


def test_limits_of_a_state_are_kept() -> None:
    plant, law = swing_up(x_min=[-0.9, -math.inf, -math.inf, -math.inf], x_max=[0.9, math.inf, math.inf, math.inf])
    _, free = swing_up()
    farthest = []
    for each in (law, free):
        controller, x, most = Stepped(lower(each, "float32")), np.zeros(4), 0.0
        for _ in range(30):
            u, _ = controller.step(x)
            assert abs(u) <= FORCE
            x = moved(plant, x, u, law.period)
            most = max(most, abs(x[0]))
        assert abs(x[1] - math.pi) < 0.1
        farthest.append(most)
    assert farthest[0] < 0.95 < 1.1 < farthest[1]  # the limit acts, and holds but for one step's curvature


def motor(friction: float, weight: float) -> Plant:
    values = {"R_ohm": 2.0, "L_H": 0.0, "ke_V_s_rad": 0.05, "kt_N_m_A": 0.05, "J_kg_m2": 1e-4, "b_N_m_s_rad": 1e-4}
    effects = [
        {"name": "coulomb_friction", "torque_N_m": friction},
        {"name": "gravity_torque", "amplitude_N_m": weight},
    ]
    return plant_from_table(
        {
            "kind": "dc_motor",
            "input": "voltage_V",
            "outputs": ["position_rad", "speed_rad_s"],
            "parameters": {name: {"value": value, "free": value > 0.0} for name, value in values.items()},
            "effects": effects if friction else [],
        }
    )


def servo_error(plant: Plant) -> float:
    """Position less reference after 0.6 s, on a motor that sticks and lifts a weight."""
    inputs = Signal("reference", "rad", -3.2, 3.2), Signal("speed", "rad/s", -100, 100), Signal("angle", "rad", -5, 5)
    table = {"horizon": 10, "Q": [1e-3, 400.0], "R": 1e-6, "R_change": 0.05, "smooth": 1.0}
    law = design(Request("servo", table, 0.01, inputs, (Signal("output", "V", -12, 12),), plant)).law
    controller, speed, angle, h = Stepped(lower(law, "float32")), 0.0, 0.0, 1e-4
    for _ in range(60):
        u, _ = controller.step(np.array([1.0, speed, angle]))
        for _ in range(100):
            push = 0.05 * (u - 0.05 * speed) / 2.0 - 1e-4 * speed - 0.03 * math.sin(angle)
            if speed == 0.0 and abs(push) <= 0.02:
                continue
            sense = math.copysign(1.0, speed or push)
            after = speed + h * (push - 0.02 * sense) / 1e-4
            speed = after if after * sense >= 0 else 0.0
            angle += h * speed
    return angle - 1.0


def test_a_motor_with_friction_ends_nearer_when_the_friction_is_known() -> None:
    known, unknown = abs(servo_error(motor(0.02, 0.03))), abs(servo_error(motor(0.0, 0.0)))
    assert known < 0.6 * unknown < 0.03


@pytest.mark.parametrize("arithmetic", ["float32", pytest.param("float64", marks=pytest.mark.slow)])
def test_the_c_is_the_program_with_a_plan_that_is_kept(arithmetic: str) -> None:
    limited = {"x_max": [1.5, math.inf, math.inf, math.inf], "x_min": [-1.5] + [-math.inf] * 3}
    program = lower(swing_up(horizon=4, iterations=2, R_change=0.01, **limited)[1], arithmetic)
    blocks = [block for block in stimuli(program, [], 400, 3) if block.inputs.shape[1] <= 400]
    traces = [run(program, block.inputs) for block in blocks]
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), load_target("host")), program)
    done = compare(program, link, blocks, traces, lambda fraction, label: None)
    assert done.steps >= 400 and done.differences == 0
    seen = np.unique(np.concatenate([trace.status.ravel() for trace in traces]))
    assert {0, UNSETTLED} <= set(seen) or len(seen) > 2


def test_what_is_infinite_commands_the_safe_output_and_is_forgotten() -> None:
    _, law = swing_up(horizon=4)
    program = lower(law, "float32")
    broken, sound = Stepped(program), Stepped(program)
    for bad in (math.inf, -math.inf):
        for stepped in (broken, sound):
            stepped.step(np.array([0.1, 3.0, 0.0, 0.0]))
        assert broken.step(np.array([0.1, bad, 0.0, 0.0])) == (-FORCE, 1 << program.status[-1].bit)
        again = np.array([0.05, 3.1, 0.0, 0.0])
        assert broken.step(again) == sound.step(again)


def test_no_controllers_at_all_have_no_results() -> None:
    program = lower(swing_up(horizon=4)[1], "float32")
    trace = run(program, np.zeros((0, 3, 4), np.float32))
    assert trace.outputs.shape == (0, 3, 1) and trace.status.shape == (0, 3)


def test_where_no_moves_keep_every_limit_the_status_says_so() -> None:
    _, law = swing_up(horizon=4, x_max=[0.5, math.inf, math.inf, math.inf], budget=32)
    u, status = Stepped(lower(law, "float32")).step(np.array([1.5, 3.1, 3.0, 0.0]))
    assert status & INFEASIBLE and abs(u) <= FORCE


WRONG: dict[str, tuple[dict[str, object], str]] = {
    "no plant": ({}, "needs the plant's equations"),
    "horizon 0": ({"horizon": 0}, r"controller.horizon = 0 is out of range; .* from 1 to 200"),
    "too large": ({"horizon": 200}, r"controller.horizon = 200 has 400 limits .* at most 80 fit"),
    "indefinite": ({"Q": [1.0, -1.0]}, "controller.Q must be symmetric and not negative; its least eigenvalue is -1"),
    "target": ({"target": [1.0]}, "controller.target has 1 numbers; it needs 2"),
    "empty": ({"x_min": [0.0, 5.0], "x_max": [1.0, 4.0]}, "controller.x_min = 5 is not below x_max = 4 for speed"),
    "states": ({"states": ["angle"]}, "nmpc needs one input a state, 2 .* but 1 are given"),
    "key": ({"horizn": 3}, "did you mean 'horizon'"),
    "warm": ({"warm_start": 1}, "controller.warm_start = 1 is not a truth value"),
    "change": ({"R_change": -1.0}, "controller.R_change = -1.0 is out of range"),
}


@pytest.mark.parametrize("name", WRONG)
def test_bad_input_gets_a_sentence(name: str) -> None:
    keys, message = WRONG[name]
    example = replace(KIND.example, table={**KIND.example.table, **keys})
    if name == "no plant":
        example = replace(example, plant=None)
    with pytest.raises(DesignError, match=message):
        design(example)
