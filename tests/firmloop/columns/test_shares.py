"""Percent is a unit of a column as the others are: a share in ones or thousandths is asked for, and converted."""

from __future__ import annotations

import tomllib
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.plain_file import HEAT, PLAIN, TIME, VOLT, rows_of
from tests.firmloop.conftest import PROJECT

POWER = np.round(50.0 + 40.0 * np.sin(TIME), 3)  # %


def heated(name: str, values: np.ndarray, units: str = "") -> str:
    head = f"time_s,{name},temperature_C,voltage_V"
    return "\n".join([head, *filter(None, [units]), *rows_of(TIME, values, HEAT, VOLT), ""])


@pytest.mark.parametrize(
    ("name", "unit", "share"),
    [("u [1]", "1", 0.01), ("u [‰]", "‰", 10.0), ("u ‰", "‰", 10.0), ("u_permille", "permille", 10.0)],
)
def test_a_share_in_another_unit_is_asked_for_and_converted(
    name: str, unit: str, share: float, bench: Callable[..., tuple]
) -> None:
    content = heated(name, share * POWER)
    key = name if name.isidentifier() else f'"{name}"'
    status, _, said = bench(content, f'[recordings.rename]\n{key} = "heater_percent"')
    line = f'{key} = {{ name = "heater_percent", unit = "{unit}" }}'
    assert status == 2 and f"carries a unit that is not percent; write which unit it is in: {line}" in said, said
    status, columns, said = bench(content, f"[recordings.rename]\n{line}")
    assert status == 0, said
    np.testing.assert_allclose(columns["heater_percent"], POWER, rtol=1e-12)


@pytest.mark.parametrize("name", ["u [%]", "u (percent)", "u %", "u_pct", "u_percent", "u"])
def test_a_share_in_percent_is_taken_as_it_is(name: str, bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(heated(name, POWER), f'[recordings.rename]\n"{name}" = "heater_percent"')
    assert status == 0, said
    np.testing.assert_array_equal(columns[name], POWER)


@pytest.mark.parametrize(("unit", "share"), [("%", 1.0), ("1", 0.01), ("‰", 10.0)])
def test_the_unit_of_a_share_may_be_written(unit: str, share: float, bench: Callable[..., tuple]) -> None:
    rename = f'[recordings.rename]\nu = {{ name = "heater_percent", unit = "{unit}" }}'
    status, columns, said = bench(heated("u", share * POWER), rename)
    assert status == 0, said
    np.testing.assert_allclose(columns["heater_percent"], POWER, rtol=1e-12)


def test_a_share_is_no_voltage(bench: Callable[..., tuple]) -> None:
    rename = '[recordings.rename]\nu = { name = "heater_percent", unit = "V" }'
    status, _, said = bench(heated("u", POWER), rename)
    assert status == 2 and "is in 'V', which is no percent" in said


@pytest.mark.parametrize("name", ["Heater (%)", "Heater %", "Heater_pct"])
def test_init_keeps_percent_as_the_unit_of_the_drive(name: str, tmp_path: Path) -> None:
    power = np.repeat([0.0, 60.0, 20.0, 80.0, 0.0], 120)
    level, heat = 0.0, []
    for u in power:
        heat.append(21.0 + level)
        level += (1 - np.exp(-1 / 40)) * (0.8 * u - level)
    rows = rows_of(np.arange(600.0), power, np.array(heat) + np.random.default_rng(1).normal(size=600) * 0.05)
    (tmp_path / "a.csv").write_text("\n".join([f"time_s,{name},temperature_C", *rows, ""]))
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 0
    made = tomllib.loads((tmp_path / "p.toml").read_text())
    assert made["plant"]["input"] == "Heater_percent"
    assert made["signals"]["output"] == {"unit": "percent", "low": 0, "high": 80}


@pytest.mark.parametrize(("name", "unit"), [("heater_percent", "percent"), ("pump_l_s", "l/s"), ("valve", "1")])
def test_an_exported_plant_tells_the_unit_of_its_drive(name: str, unit: str, tmp_path: Path) -> None:
    (tmp_path / "p.toml").write_text(
        PROJECT.replace('input = "voltage_V"', f'input = "{name}"').replace('unit = "V"', f'unit = "{unit}"')
    )
    for part in ("plant", "controller"):
        out = tmp_path / f"{part}.fmu"
        assert main(["export", str(tmp_path / "p.toml"), "--fmu", "--of", part, "--out", str(out)]) == 0
        with zipfile.ZipFile(out) as archive:
            described = archive.read("modelDescription.xml").decode()
        variable = next(
            line for line in described.splitlines() if f'name="{name if part == "plant" else "output"}"' in line
        )
        assert f'unit="{unit}"' in variable, variable


@pytest.mark.parametrize("line", ['"Duty [%]" = "voltage_V"', '"Duty [%]" = { name = "voltage_V", unit = "%" }'])
def test_a_duty_in_percent_that_is_renamed_to_volts_is_answered_with_a_line_that_works(
    line: str, bench: Callable[..., tuple]
) -> None:
    content = PLAIN.replace("voltage_V", "Duty [%]", 1)
    status, _, said = bench(content, f"[recordings.rename]\n{line}")
    way = '"Duty [%]" = { name = "voltage_V", scale = 0.24 }'
    assert status == 2 and f"% is a share, so write the V that one of it stands for as the scale, such as {way}" in said
    status, columns, said = bench(content, f"[recordings.rename]\n{way}")
    assert status == 0, said
    np.testing.assert_allclose(columns["voltage_V"], 0.24 * VOLT, rtol=1e-12)
