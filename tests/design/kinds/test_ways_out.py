"""A state of no finite range is refused in fixed point with a way out that the kind it names really has."""

import json
import re
from pathlib import Path

import pytest

from firmloop.cli import main

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "controllers.md"
LOOP = """
[signals]
reference = { unit = "V", low = -10, high = 10 }
measurement = { unit = "V", low = -10, high = 10 }
level = { unit = "V", low = 0, high = 5 }
output = { unit = "V", low = -40, high = 40 }
"""
PLAIN = LOOP.replace('level = { unit = "V", low = 0, high = 5 }\n', "")
MOTOR = """
[signals]
voltage = { unit = "V", low = -12, high = 12 }
current = { unit = "A", low = -2, high = 2 }
output = { unit = "rad/s", low = -700, high = 700 }
"""
INTEGRATOR = "A = [[1.0]], B = [[0.1, -0.1]], C = [[1.0]]"
CASES = {
    "transfer_function": ("numerator = [0.01]\ndenominator = [1.0, -1.0]", PLAIN),
    "transfer_function, a pole cancelled": ("numerator = [1.0, -1.0]\ndenominator = [1.0, -1.5, 0.5]", PLAIN),
    "lead_lag": ("zero_rad_s = 1.0\npole_rad_s = 1e-14", PLAIN),
    "notch": ("frequency_hz = 1e-9\ndamping = 1e-6", PLAIN),
    "state_space": (INTEGRATOR.replace("], ", "]\n"), PLAIN),
    "pid": ('kp = 1.0\nki = 2.0\nanti_windup = "none"', PLAIN),
    "gain_schedule": (
        'schedule_on = "level"\npoints = [0.0, 5.0]\ncontrollers = [{ kp = 1.0, ki = 2.0, anti_windup = "none" }, '
        '{ kp = 2.0, ki = 2.0, anti_windup = "none" }]',
        LOOP,
    ),
    "gain_schedule, of transfer functions": (
        'schedule_on = "level"\npoints = [0.0, 5.0]\ncontrollers = ['
        '{ kind = "transfer_function", numerator = [0.01], denominator = [1.0, -1.0] }, '
        '{ kind = "transfer_function", numerator = [0.02], denominator = [1.0, -1.0] }]',
        LOOP,
    ),
    "gain_schedule, of state spaces": (
        'schedule_on = "level"\npoints = [0.0, 5.0]\ncontrollers = ['
        f'{{ kind = "state_space", {INTEGRATOR} }}, {{ kind = "state_space", {INTEGRATOR} }}]',
        LOOP,
    ),
    "cascade": (
        '[[controller.loops]]\nname = "inner"\nkind = "pid"\nkp = 1.0\nki = 2.0\nanti_windup = "none"\n'
        'inputs = { measurement = "speed" }\n'
        '[[controller.loops]]\nname = "outer"\nkind = "pid"\nkp = 1.0\nu_min = -9.0\nu_max = 9.0\n'
        'inputs = { reference = "target", measurement = "level" }',
        LOOP.replace("reference =", "target =").replace("measurement =", "speed ="),
    ),
    "sensorless_speed": (
        "R_ohm = 8.0\nL_H = 0.001\nke_V_s_rad = 0.02\nkt_N_m_A = 0.02\nJ_kg_m2 = 3e-06\nbandwidth_rad_s = 1e-9",
        MOTOR,
    ),
}
# Whose the keys are where it is a controller within that has the state.
OWNERS = {"gain_schedule": "pid", "gain_schedule, of state spaces": "state_space", "cascade": "pid"}


def keys_of(kind: str) -> set[str]:
    """Return the keys that the reference page names for a kind."""
    return set(re.findall(r"`(\w+)", PAGE.read_text().split(f"\n## {kind}\n")[1].split("\n## ")[0]))


@pytest.mark.parametrize("case", CASES)
def test_the_way_out_of_a_state_without_a_range_is_one_that_is_there(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = case.partition(",")[0]
    table, signals = CASES[case]
    text = f'schema = 1\nname = "plain"\n[controller]\nkind = "{kind}"\nperiod_s = 0.001\n{table}\n{signals}'
    number = '[arithmetic]\nnumber = "fixed"\nbits = 32\n[target]\nnames = ["host"]\n'
    (tmp_path / "p.toml").write_text(text + number)
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "state " in said and "no finite proven range" in said and 'number = "float32" in [arithmetic]' in said
    own, *others = re.split(r'kind = "(?=\w+")', said)  # each key stands behind the kind that it is of
    parts = [(OWNERS.get(case, kind), own), *((part.partition('"')[0], part) for part in others)]
    named = [(of, key) for of, part in parts for key in re.findall(r"\b(?:\w+_(?:min|max)|anti_windup|\w+_s)\b", part)]
    assert named and all(key in keys_of(of) for of, key in named), said


@pytest.mark.parametrize("case", ["pid", "gain_schedule, of transfer functions", "lead_lag"])
def test_the_number_that_is_named_for_a_state_without_a_range_is_verified(case: str, tmp_path: Path) -> None:
    kind = case.partition(",")[0]
    table, signals = CASES[case]
    text = f'schema = 1\nname = "plain"\n[controller]\nkind = "{kind}"\nperiod_s = 0.001\n{table}\n{signals}'
    text = text.replace("ki = 2.0", "ki = 2.0\nkd = 0.1") if case == "pid" else text
    (tmp_path / "p.toml").write_text(f'{text}[arithmetic]\nnumber = "float32"\n[target]\nnames = ["host"]\n')
    assert main(["verify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out"), "--steps", "500"]) == 0
    found = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert found["verdict"] == "agrees" and found["differences"] == 0


@pytest.mark.parametrize(("phase", "status"), [(89, 0), (90, 2), (-89, 0), (-90, 2)])
def test_the_page_tells_the_phases_that_a_lead_lag_takes(
    phase: int, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = f'kind = "lead_lag"\nperiod_s = 0.001\nfrequency_rad_s = 100.0\nphase_deg = {phase}.0\n{PLAIN}'
    (tmp_path / "p.toml").write_text(
        f'schema = 1\nname = "plain"\n[controller]\n{table}[arithmetic]\nnumber="float64"\n'
    )
    assert main(["generate", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == status
    assert status == 0 or "must be from -89 to 89" in capsys.readouterr().err
    assert "`phase_deg` (from -89 to 89;" in PAGE.read_text()


def test_a_method_of_s_beside_no_domain_is_told_the_line_that_is_missing(tmp_path, capsys) -> None:
    """Left out, the domain is z, in which the coefficients of a law in s are another law."""
    law = 'numerator = [1e6]\ndenominator = [1, 200, 20000, 1e6]\ndiscretize = "matched"\n'
    text = f'schema = 1\nname = "p"\n[controller]\nkind = "transfer_function"\nperiod_s = 0.001\n{law}'
    number = '[arithmetic]\nnumber = "float64"\n'
    path = tmp_path / "p.toml"
    path.write_text(text + PLAIN + number)
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    (line,) = re.findall(r"write (domain = \S+) for coefficients in s", capsys.readouterr().err)
    path.write_text(f"{text}{line}\n{PLAIN}{number}")
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 0


def test_an_unstable_loop_of_no_pid_is_told_to_scale_what_it_has(tmp_path, capsys) -> None:
    plant = 'kind = "first_order"\ninput = "u_V"\noutputs = ["y_V"]\n[plant.parameters]\n'
    plant += "gain = { value = 3 }\ntime_constant_s = { value = 0.05 }\ndelay_s = { value = 0.02 }\n"
    law = 'kind = "transfer_function"\nperiod_s = 0.001\nnumerator = [100.0]\ndenominator = [1.0, 20.0]\ndomain = "s"\n'
    path = tmp_path / "p.toml"
    path.write_text(f'schema = 1\nname = "p"\n[plant]\n{plant}[controller]\n{law}{PLAIN}')
    assert main(["design", str(path), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "the numerator" in said and "kp" not in said
    (most,) = re.findall(r"stable with its gain below (\S+) times", said)
    path.write_text(path.read_text().replace("[100.0]", f"[{99.0 * float(most)}]"))
    assert main(["design", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "UNSTABLE" not in capsys.readouterr().out
