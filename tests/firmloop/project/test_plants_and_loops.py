"""Where a plant rests, what its states are, and one without any: what `design` says of a loop around it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from firmloop.cli import main

STATIC = """kind = "static"
input = "valve_V"
outputs = ["flow_l_min"]
[plant.parameters]
gain = { value = -3.2, free = false }
offset = { value = 12.0, free = false }
"""
AMBIENT = """kind = "ode"
states = ["temperature_C"]
inputs = ["heater_percent"]
[plant.outputs]
temperature_C = "temperature_C"
[plant.derivatives]
temperature_C = "(0.5*heater_percent - h_W_K*(temperature_C - ambient_C)) / c_J_K"
[plant.parameters]
h_W_K = { value = 0.6, free = false }
c_J_K = { value = 90.0, free = false }
ambient_C = { value = 22.0, free = false }
"""
MOTOR = """kind = "dc_motor"
input = "voltage_V"
outputs = ["position_rad"]
[plant.parameters]
R_ohm = { value = 1.3, free = false }
L_H = { value = 6e-4, free = false }
ke_V_s_rad = { value = 0.031, free = false }
kt_N_m_A = { value = 0.031, free = false }
J_kg_m2 = { value = 2.2e-5, free = false }
b_N_m_s_rad = { value = 1.5e-5, free = false }
"""
Said = Callable[[str, str, str], tuple[int, str]]


@pytest.fixture
def designed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Said:
    """Return what design says of a plant, a controller and its signals."""

    def design(plant: str, controller: str, signals: str) -> tuple[int, str]:
        parts = f'schema = 1\nname = "loop"\n[plant]\n{plant}[controller]\n{controller}\n[signals]\n{signals}\n'
        (tmp_path / "p.toml").write_text(f'{parts}[arithmetic]\nnumber = "float32"\n[target]\nnames = ["host"]\n')
        status = main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")])
        shown = capsys.readouterr()
        return status, shown.out + shown.err

    return design


def signals(unit: str, low: float, high: float, output: str) -> str:
    wire = f'{{ unit = "{unit}", low = {low}, high = {high} }}'
    return f"reference = {wire}\nmeasurement = {wire}\noutput = {output}"


def test_a_plant_without_memory_is_tuned_by_every_rule_that_can(designed: Said) -> None:
    wires = signals("l/min", -20, 20, '{ unit = "V", low = 0, high = 10 }')
    status, said = designed(STATIC, 'kind = "pid"\nperiod_s = 0.05\ntune = "simc"', wires)
    assert status == 0 and "ki -3.125" in said  # 1/(K 2 h): of the plant comes nothing in the sample itself
    assert "  amigo   " in said and "ziegler_nichols: Ziegler and Nichols' rule needs a plant whose answer" in said
    status, said = designed(STATIC, 'kind = "pid"\nperiod_s = 0.05\ntune = "simc"\nterms = "pid"', wires)
    assert status == 0 and "ki -3.125" in said and "UNSTABLE" not in said.partition("tuning rules")[0]


@pytest.mark.parametrize(
    ("plant", "wires", "held"),
    [
        (STATIC, signals("l/min", -30, 20, '{ unit = "V", low = 0, high = 10 }'), "at -20 to 12 l/min"),
        (AMBIENT, signals("degC", 0, 120, '{ unit = "percent", low = 0, high = 100 }'), "at 22 to 105.3 degC"),
        (AMBIENT, signals("degC", 25, 104, '{ unit = "percent", low = 0, high = 100 }'), ""),
    ],
)
def test_what_the_actuator_holds_counts_from_where_the_plant_rests(
    plant: str, wires: str, held: str, designed: Said
) -> None:
    status, said = designed(plant, 'kind = "pid"\nperiod_s = 0.05\nkp = 0.0\nki = 0.01', wires)
    assert status == 0 and ("holds the plant" in said) == bool(held) and held in said


STATES = {
    "current": '{ unit = "A", low = -9, high = 9 }',
    "speed": '{ unit = "rad/s", low = -300, high = 300 }',
    "angle": '{ unit = "rad", low = -3, high = 3 }',
}


@pytest.mark.parametrize(
    ("order", "named", "refused"),
    [
        (("current", "speed", "angle"), "", False),
        (("angle", "speed", "current"), "", True),
        (("angle", "speed", "current"), 'states = ["current", "speed", "angle"]', False),
    ],
)
def test_states_in_another_order_than_the_plant_s_are_refused_by_their_units(
    order: tuple[str, ...], named: str, refused: bool, designed: Said
) -> None:
    wires = "\n".join(f"{name} = {STATES[name]}" for name in order) + '\noutput = { unit = "V", low = -12, high = 12 }'
    law = f'kind = "state_feedback"\nperiod_s = 0.003\nQ = [0.0, 0.01, 40.0]\nR = 0.3\n{named}'
    status, said = designed(MOTOR, law, wires)
    assert status == (2 if refused else 0)
    if refused:
        assert "angle" in said and "is in 'rad' but the plant's current_A is in 'A'" in said
        assert "in this order: current_A, speed_rad_s, position_rad" in said


def test_a_state_in_degrees_is_told_by_how_much_it_is_off(designed: Said) -> None:
    wires = "\n".join(f"{name} = {wire}" for name, wire in STATES.items()).replace('"rad"', '"deg"')
    law = 'kind = "state_feedback"\nperiod_s = 0.003\nK = [[0.1, 0.16, 8.0]]'
    status, said = designed(MOTOR, law, wires + '\noutput = { unit = "V", low = -12, high = 12 }')
    assert status == 2 and "(1 deg is 0.0174533 rad); use one unit" in said


@pytest.mark.parametrize(("told", "read"), [("setpoint", "temperature"), ("reference", "y")])
@pytest.mark.parametrize(("unit", "status"), [("degF", 2), ("degC", 0)])
def test_the_unit_of_a_loop_is_that_of_the_plant_whatever_its_signals_are_called(
    told: str, read: str, unit: str, status: int, designed: Said
) -> None:
    """The gains are those of the plant: 1.8 times too large for an error in degrees Fahrenheit."""
    wires = signals(unit, 25, 104, '{ unit = "percent", low = 0, high = 100 }')
    wires = wires.replace("reference", told).replace("measurement", read)
    law = 'kind = "pid"\nperiod_s = 1.0\ntune = "simc"\ntau_c_s = 30'
    got, said = designed(AMBIENT, law, wires)
    assert got == status
    assert status == 0 or f"is in '{unit}' but the plant's temperature_C is in 'degC'" in said


OBSERVERS = {
    "luenberger": 'observer = "luenberger"\nobserver_poles = [0.3, 0.4]',
    "kalman": 'observer = "kalman"\nprocess_noise = [1.0, 1.0]\nmeasurement_noise = 1.0',
}
SPEED_MOTOR = MOTOR.replace('["position_rad"]', '["speed_rad_s", "current_A"]')
WEIGHTED = 'kind = "state_feedback"\nperiod_s = 0.001\nQ = [1.0, 0.1]\nR = 1.0\n'
DRIVE = '\noutput = { unit = "V", low = -12, high = 12 }'


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize(
    ("unit", "words"), [("rpm", "1 rpm is 0.10472 rad/s"), ("A", "the plant's speed_rad_s is in 'rad/s'")]
)
def test_what_an_observer_measures_is_in_the_unit_of_the_plant(
    observer: str, unit: str, words: str, designed: Said
) -> None:
    wires = f'w = {{ unit = "{unit}", low = -300, high = 300 }}' + DRIVE
    status, said = designed(SPEED_MOTOR, WEIGHTED + OBSERVERS[observer], wires)
    assert status == 2 and words in said


@pytest.mark.parametrize("order", [("speed_rad_s", "current_a"), ("current_a", "speed_rad_s")])
def test_the_reference_is_for_the_plant_s_first_output_however_the_signals_stand(
    order: tuple[str, ...], designed: Said
) -> None:
    """N r = V + K x at rest, for the speed that a volt holds: 1/(ke + R b/kt) rad/s, at b w/kt in A."""
    units = {"speed_rad_s": '"rad/s", low = -300, high = 300', "current_a": '"A", low = -9, high = 9'}
    wires = 'reference = { unit = "rad/s", low = -300, high = 300 }\n'
    wires += "\n".join(f"{name} = {{ unit = {units[name]} }}" for name in order) + DRIVE
    law = WEIGHTED + OBSERVERS["kalman"].replace("noise = 1.0", "noise = [1.0, 1.0]")
    status, said = designed(SPEED_MOTOR, law, wires)
    assert status == 0
    figures = dict(each.split() for line in said.splitlines() if "N_0" in line for each in line.strip().split(", "))
    speed = 1.0 / (0.031 + 1.3 * 1.5e-5 / 0.031)
    wanted = 1.0 + float(figures["K_0_0"]) * 1.5e-5 * speed / 0.031 + float(figures["K_0_1"]) * speed
    assert float(figures["N_0"]) * speed == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('["flow_l_min"]', '["valve_V"]', "plant.outputs: valve_V is what drives the plant, too"),
        ("value = -3.2, free", "value = -3.2, low = 5, high = 4, free", "low is 5 and high is 4; exchange or correct"),
    ],
)
def test_a_plant_that_answers_itself_or_has_its_bounds_exchanged_is_refused(
    before: str, after: str, words: str, designed: Said
) -> None:
    wires = 'reference = { unit = "V", low = -9, high = 9 }\nmeasurement = { unit = "V", low = -9, high = 9 }'
    law = 'kind = "pid"\nperiod_s = 0.1\nkp = 1.0\nki = 1.0'
    status, said = designed(STATIC.replace(before, after), law, wires + DRIVE)
    assert status == 2 and words in said
