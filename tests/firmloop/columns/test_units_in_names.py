"""The unit in a foreign name counts wherever it stands, however its words are parted and in whatever capitals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.plain_file import HEAT, TIME, VOLT, alike, rows_of

NAMES = {  # of a column in millivolts
    "small letters": "motor_mv",
    "capitals": "MOTOR_MV",
    "capitals within a word": "motorMv",
    "capitals that stay": "MotorMV",
    "a word behind it": "motor_mV_raw",
    "a number behind it": "motor_mV_1",
    "a number at it": "motor_mV1",
    "a word behind brackets": "motor [mV] filtered",
    "braces": "motor{mV}",
    "a point": "motor.mV",
    "a colon": "motor:mV",
    "a word for volts before it": "volts_mv",
}


@pytest.mark.parametrize("way", NAMES)
def test_a_unit_is_asked_for_with_the_line_that_converts_it(way: str, bench: Callable[..., tuple]) -> None:
    name = NAMES[way]
    content = "\n".join([f"time_s,{name},temperature_C", *rows_of(TIME, np.round(1e3 * VOLT, 9), HEAT)])
    key = name if name.replace("_", "").isalnum() else f'"{name}"'
    status, _, said = bench(content, f'[recordings.rename]\n{key} = "voltage_V"')
    line = f'{key} = {{ name = "voltage_V", unit = "mV" }}'
    assert status == 2 and line in said, said
    status, columns, said = bench(content, f"[recordings.rename]\n{line}")
    assert status == 0, said
    np.testing.assert_allclose(columns["voltage_V"], VOLT, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "ours", "unit"),
    [
        ("n_min-1", "speed_rad_s", "min-1"),
        ("n/min⁻¹", "speed_rad_s", "min⁻¹"),
        ("U/min", "speed_rad_s", "U/min"),
        ("deg_per_s", "speed_rad_s", "deg/s"),
        ("nRpm", "speed_rad_s", "Rpm"),
        ("rpm2", "speed_rad_s", "rpm"),
        ("wheel_kmh", "speed_m_s", "km/h"),
        ("pos_turns", "position_rad", "turns"),
        ("motor_MV", "heater_percent", ""),  # a manipulated variable
        ("erpm", "speed_rad_s", ""),  # electrical turns: how many pole pairs there are is not known
        ("PRESSURE_MPA", "pressure_bar", "MPa"),
        ("timeMs", "time_s", "ms"),
        ("TIME_MS", "time_s", "ms"),
        ("t_us_since_boot", "time_s", "us"),
        ("milliamps", "current_A", "milliamps"),
    ],
)
def test_a_unit_of_the_kind_that_is_wanted_is_found(
    name: str, ours: str, unit: str, bench: Callable[..., tuple]
) -> None:
    key = name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else f'"{name}"'
    header = f"{name},voltage_V,temperature_C" if ours == "time_s" else f"time_s,{name},temperature_C"
    status, _, said = bench("\n".join([header, *rows_of(TIME, VOLT, HEAT)]), f'[recordings.rename]\n{key} = "{ours}"')
    assert ("carries a unit" in said) == bool(unit), said
    assert not unit or (status == 2 and f'{key} = {{ name = "{ours}", unit = "{unit}" }}' in said), said


@pytest.mark.parametrize(
    "name",
    ["volt_ma", "volt_prev", "v_rev", "v_sec", "T_in", "v_min", "volt_V_raw", "v_1", "volt_", "lift_MA"],
)
def test_words_that_are_units_of_another_kind_alone_stay_words(name: str, bench: Callable[..., tuple]) -> None:
    """A moving average, the one before, a direction."""
    content = "\n".join([f"time_s,{name},temperature_C", *rows_of(TIME, VOLT, HEAT)])
    status, columns, said = bench(content, f'[recordings.rename]\n{name} = "voltage_V"')
    assert status == 0, said
    alike(columns, volt=name)


@pytest.mark.parametrize(
    "names",
    [
        ("time_ms", "voltage_mv", "speed_rpm", "current_ma"),
        ("TIME_MS", "VOLTAGE_MV", "SPEED_RPM", "CURRENT_MA"),
        ("timeMs", "voltageMv", "speedRpm", "currentMa"),
        ("time.ms", "voltage.mV", "speed.rpm", "current.mA"),
        ("t_ms_raw", "u_mV_raw", "n_rpm_raw", "i_mA_raw"),
        ("t{ms}", "u{mV}", "n{rpm}", "i{mA}"),
        ("millis", "U/mV", "n/min⁻¹", "I/mA"),
        ("ms", "volt (mV) 1", "speed (rpm) filt", "milliamps"),
    ],
)
def test_init_converts_them(names: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time, drive = 0.001 * np.arange(300), np.repeat([0.0, 9.0, 3.0, -6.0, 6.0, 0.0], 50)
    speed, current = np.zeros(300), np.zeros(300)
    for k in range(299):  # a motor of 2.5 ohm and 0.037 V*s/rad, without inductance
        current[k] = (drive[k] - 0.037 * speed[k]) / 2.5
        speed[k + 1] = speed[k] + 0.001 * (0.037 * current[k] - 1e-5 * speed[k]) / 2e-5
    current[-1] = (drive[-1] - 0.037 * speed[-1]) / 2.5
    rows = rows_of(1e3 * time, 1e3 * drive, speed * 30.0 / np.pi, 1e3 * current)
    (tmp_path / "a.csv").write_text("\n".join([",".join(names), *rows, ""]), encoding="utf-8")
    status = main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")])
    shown = capsys.readouterr()
    assert status == 0, shown.err
    written = (tmp_path / "p.toml").read_text(encoding="utf-8")
    assert "no unit in the file" not in written, written
    assert written.count("unit = ") >= 4
    resistance = float(written.partition("R_ohm = { value = ")[2].partition(",")[0])
    assert resistance == pytest.approx(2.5, rel=0.05)
