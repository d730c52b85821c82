"""Plants whose equations are text: right against SciPy, and strict about what they read."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.expression import read_expression
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.superset import superset

TANKS: Mapping[str, object] = {
    "kind": "ode",
    "states": ["upper_m", "lower_m"],
    "inputs": ["pump_V"],
    "outputs": {"level_m": "lower_m"},
    "derivatives": {
        "upper_m": "k_pump*pump_V - k_upper*sqrt(upper_m)",
        "lower_m": "k_upper*sqrt(upper_m) - k_lower*sqrt(lower_m)",
    },
    "balances": {"upper_m": {"kind": "flow"}, "lower_m": {"kind": "flow"}},
    "parameters": {"k_pump": 0.1, "k_upper": 0.15, "k_lower": 0.12},
}
SPRING: Mapping[str, object] = {
    "kind": "ode",
    "states": ["x_m", "v_m_s"],
    "inputs": ["force_N"],
    "outputs": {"position_m": "x_m", "speed_m_s": "v_m_s"},
    "derivatives": {"x_m": "v_m_s", "v_m_s": "(force_N - c_N_s_m*v_m_s - k_N_m*x_m) / m_kg"},
    "balances": {"v_m_s": {"kind": "force", "per": "1/m_kg", "position": "x_m", "speed": "v_m_s"}},
    "parameters": {"m_kg": 0.5, "c_N_s_m": 0.8, "k_N_m": 40.0},
}


def recorded(time: NDArray[np.float64], name: str, drive: NDArray[np.float64], *outputs: str) -> Recording:
    """Make a recording whose outputs are zero."""
    return make_recording(time, {name: drive, **{o: np.zeros(len(time)) for o in outputs}}, "drawn", "")


def row_by_row(rate: object, time: NDArray[np.float64], drive: NDArray[np.float64], start: list[float]) -> object:
    """Integrate by SciPy from row to row."""
    assert callable(rate)
    states = [np.array(start)]
    for k in range(len(time) - 1):
        done = solve_ivp(
            lambda t, x, u: rate(x, u), time[k : k + 2], states[-1], args=(drive[k],), method="DOP853", rtol=1e-11,
            atol=1e-13,
        )  # fmt: skip
        states.append(done.y[:, -1])
    return np.array(states)


def test_tanks_flow_as_scipy_says() -> None:
    time = np.arange(80) * 4.0
    drive = np.repeat(np.random.default_rng(2).uniform(0.4, 3.0, 8), 10)
    recording = recorded(time, "pump_V", drive, "level_m")
    truth = row_by_row(
        lambda x, u: [0.1 * u - 0.15 * np.sqrt(x[0]), 0.15 * np.sqrt(x[0]) - 0.12 * np.sqrt(x[1])],
        time, drive, [1.0, 2.0],
    )  # fmt: skip
    assert isinstance(truth, np.ndarray)
    start = np.array([1.0, 2.0])
    plant = plant_from_table(TANKS)
    assert np.allclose(simulate(plant, recording, start)[:, 0], truth[:, 1], rtol=1e-6)
    assert np.allclose(superset(plant).simulate(recording, {}, start)[:, 0], truth[:, 1], rtol=1e-6)


@pytest.mark.parametrize("wider", [1.0, 2.5])
@pytest.mark.parametrize("states", [["upper_m", "lower_m"], ["lower_m", "upper_m"]])
def test_an_upper_tank_runs_over_into_the_lower(states: list[str], wider: float) -> None:
    """Against explicit steps of a thousandth of a row: the level stays, two fifths of the excess run on.

    They are two fifths of a volume, which lift a wider tank less, and they run down whatever is listed first.
    """
    time = np.arange(60) * 4.0
    drive = np.repeat([3.0, 0.5, 3.0], 20)
    x, shown, h = np.array([1.0, 1.0]), [], 4e-3
    for k in range(60):
        shown.append(x[1])
        for _ in range(1000):
            flow = 0.15 * np.sqrt(x[0])
            rise = 0.1 * drive[k] - flow
            over = max(rise, 0.0) if x[0] >= 2.5 else 0.0
            x = np.minimum(
                x + h * np.array([rise - over, (flow - 0.12 * np.sqrt(x[1]) + 0.4 * over) / wider]), [2.5, np.inf]
            )
    rates = {**TANKS["derivatives"], "lower_m": f"(k_upper*sqrt(upper_m) - k_lower*sqrt(lower_m))/{wider}"}
    balances = {"upper_m": {"kind": "flow"}, "lower_m": {"kind": "flow", "per": f"1/{wider}"}}
    whole = superset(plant_from_table({**TANKS, "states": states, "derivatives": rates, "balances": balances}))
    recording = recorded(time, "pump_V", drive, "level_m")
    parameters = {"overflow.upper_m.level": 2.5, "overflow.upper_m.fraction": 0.4}
    found = whole.simulate(recording, parameters, np.array([1.0, 1.0]))[:, 0]
    assert np.max(np.abs(whole.simulate(recording, {}, np.array([1.0, 1.0]))[:, 0] - found)) > 0.1
    assert np.allclose(found, shown, atol=2e-3)


def test_a_spring_hardens_as_scipy_says() -> None:
    time = np.arange(200) * 5e-3
    drive = np.repeat(np.random.default_rng(6).uniform(-6.0, 6.0, 20), 10)
    recording = recorded(time, "force_N", drive, "position_m", "speed_m_s")
    truth = row_by_row(
        lambda x, u: [x[1], (u - 0.8 * x[1] - 40.0 * x[0] - 900.0 * x[0] ** 3) / 0.5], time, drive, [0.05, 0.0]
    )
    assert isinstance(truth, np.ndarray)
    plant = plant_from_table({**SPRING, "effects": [{"name": "hardening_spring", "cubic_N_m3": 900.0}]})
    assert np.allclose(simulate(plant, recording, np.array([0.05, 0.0])), truth, atol=1e-4 * np.abs(truth).max())
    text = "(force_N - c_N_s_m*v_m_s - k_N_m*x_m - 900*x_m**3) / m_kg"
    written = plant_from_table({**SPRING, "derivatives": {"x_m": "v_m_s", "v_m_s": text}})
    assert np.allclose(simulate(written, recording, np.array([0.05, 0.0])), truth, atol=1e-4 * np.abs(truth).max())


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2*3 - 4/8", 6.5),
        ("-x**2", -4.0),
        ("sqrt(x*8) + abs(-x) + sign(-x)", 5.0),
        ("min(x, 1, 3) + max(x, 7)", 8.0),
        ("exp(0) + log(1) + sin(0) + cos(0) + tan(0) + tanh(0)", 2.0),
        ("sqrt(-x)", 0.0),
        (3, 3.0),
    ],
)
def test_expressions(text: object, value: float) -> None:
    x = ca.SX.sym("x")
    result = ca.Function("f", [x], [read_expression(text, {"x": x}, "plant.outputs.y")])
    assert float(result(2.0)) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    ["x +", "y", "x.real", "x[0]", "__import__('os')", "x if x else 1", "lambda: x", "x == 1", "'x'", "True", "x; x",
     "sin(x, x)", "min(x)", "f(x)", "x and x", "", "1e999", "9" * 3000, "(" * 500 + "x" + ")" * 500, "x @ x", "x % 2",
     None],
)  # fmt: skip
def test_what_is_no_expression_is_shown(text: object) -> None:
    with pytest.raises(IdentifyError, match=r"plant\.outputs\.y"):
        read_expression(text, {"x": ca.SX.sym("x")}, "plant.outputs.y")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("states", [], "plant.states"),
        ("states", ["x_m"], "is no state"),
        ("inputs", ["x_m"], "stands for two things"),
        ("outputs", {}, "plant.outputs"),
        ("derivatives", {"x_m": "v_m_s"}, "is missing"),
        ("balances", {"v_m_s": {"kind": "magic"}}, "is one of torque"),
        ("balances", {"y": {"kind": "force"}}, "is no state"),
        ("balances", {"v_m_s": {"kind": "force", "per": "x_m"}}, "parameters only"),
        ("balances", {"v_m_s": {"kind": "force", "position": "y"}}, "must be one of the states"),
        ("balances", {"v_m_s": {"kind": "force", "effort": "force_N**2"}}, "linear"),
        ("outputs", {"position_m": "x_m^2"}, "no power here; write x..2"),
        ("parameters", {"m-kg": 1.0}, "letters, digits"),
        ("parameters", {**SPRING["parameters"], "spare": 1.0}, "spare stands in no expression"),
    ],
)
def test_a_wrong_ode_is_named(key: str, value: object, said: str) -> None:
    with pytest.raises(IdentifyError, match=said):
        plant_from_table({**SPRING, key: value})


@pytest.mark.parametrize(
    ("effect", "size"),
    [("hardening_spring.cubic_N_m3", 5.0), ("end_stop.stiffness_N_m", 9.0)],
)
def test_a_search_may_try_a_mass_below_zero(effect: str, size: float) -> None:
    """Nothing holds a parameter of equations of one's own above zero: what runs away is no error."""
    time = np.arange(200) * 1e-2
    recording = recorded(time, "force_N", np.sin(9.0 * time), "position_m", "speed_m_s")
    engine = superset(plant_from_table(SPRING))
    assert effect in engine.names
    shown = engine.simulate(recording, {"m_kg": -0.5, effect: size}, np.array([0.01, 0.0]))
    assert shown.shape == (200, 2)


MOTOR: Mapping[str, object] = {
    "kind": "ode",
    "states": ["i_A", "w_rad_s"],
    "inputs": ["voltage_V"],
    "outputs": {"speed_rad_s": "w_rad_s"},
    "derivatives": {
        "i_A": "(voltage_V - R_ohm*i_A - ke_V_s_rad*w_rad_s) / L_H",
        "w_rad_s": "(kt_N_m_A*i_A - b_N_m_s_rad*w_rad_s) / J_kg_m2",
    },
    "parameters": {
        "R_ohm": 2.0,
        "L_H": 1e-3,
        "ke_V_s_rad": 0.05,
        "kt_N_m_A": 0.05,
        "J_kg_m2": 1e-4,
        "b_N_m_s_rad": 1e-4,
    },
}


def test_units_tell_the_balances_that_a_project_does_not_name() -> None:
    voltage, torque = plant_from_table(MOTOR).balances
    values = list(MOTOR["parameters"].values())  # type: ignore[attr-defined]
    assert (voltage.kind, torque.kind, torque.state) == ("voltage", "torque", 1)
    assert voltage.resistance is not None and float(voltage.resistance(values)) == 2.0
    assert torque.effort is not None and float(torque.effort([3.0, 0.0], [0.0], values)) == pytest.approx(0.15)
    body = {key: value for key, value in SPRING.items() if key != "balances"}
    named, told = plant_from_table(SPRING).balances[0], plant_from_table(body).balances[0]
    assert (told.kind, told.state, told.position) == (named.kind, named.state, named.position)
    p = [0.5, 0.8, 40.0]
    assert float(told.per(p)) == float(named.per(p)) == 2.0
    assert told.effort is not None and float(told.effort([0, 0], [3.0], p)) == 3.0


@pytest.mark.parametrize(
    "changed",
    [
        {"balances": {}},  # said to have none
        {"derivatives": {"x_m": "v_m_s", "v_m_s": "force_N/m_kg - c_N_s_m*v_m_s - k_N_m*x_m"}},  # not all by the mass
        {
            "derivatives": {"x_m": "v_m_s", "v_m_s": "(force_N - k_N_m*x_m) / (m_kg + c_kg)"},
            "parameters": {"m_kg": 1.0, "c_kg": 2.0, "k_N_m": 3.0},
        },
    ],
)
def test_a_derivative_that_one_parameter_does_not_divide_is_no_balance(changed: Mapping[str, object]) -> None:
    body = {key: value for key, value in SPRING.items() if key != "balances"}
    assert plant_from_table({**body, **changed}).balances == ()
