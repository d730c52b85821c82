"""Parameters twenty decades apart have the intervals that they have in units near one: no unit makes one unseen."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

PROJECT = """schema = 1
name = "cylinder"
[recordings]
train = ["a.csv"]
[plant]
kind = "ode"
states = ["p_{unit}"]
inputs = ["valve_V"]
[plant.outputs]
pressure_{unit} = "p_{unit}"
[plant.derivatives]
p_{unit} = "stiff*(0.8*valve_V*{flow} - leak*p_{unit})"
[plant.parameters]
stiff = {{ value = {stiff}, free = true }}
leak = {{ value = {leak}, free = true }}
"""

STATIC = """schema = 1
name = "valve"
[recordings]
train = ["a.csv"]
[plant]
kind = "static"
input = "valve_V"
outputs = ["pressure_Pa"]
[plant.parameters]
gain = { value = 1.0, free = true }
offset = { value = 9e5, free = true }
"""


def found(folder: Path, unit: str, size: float, flow: float) -> dict[str, tuple[float, float]]:
    """Value and half-width of both parameters, where pressures are `size` Pa and flows `flow` m^3/s."""
    random, pressure, rows = np.random.default_rng(5), 0.0, []
    for k in range(600):
        valve = (1.0, -0.5, 0.25)[(k // 50) % 3]
        rows.append(f"{k * 0.01:.2f},{valve},{(pressure + random.normal(0.0, 2e3)) / size:.9g}")
        pressure += (1.0 - np.exp(-0.01 / 0.25)) * (0.8 * valve * 2e-5 / 2e-12 / 10.0 - pressure)
    folder.mkdir()
    (folder / "a.csv").write_text("\n".join([f"time_s,valve_V,pressure_{unit}", *rows, ""]))
    stiff, leak = 1.2e12 * flow / size, 3e-12 * size / flow
    own = PROJECT.format(unit=unit, flow=2e-6 / flow, stiff=stiff, leak=leak)
    (folder / "p.toml").write_text(own)
    assert main(["identify", str(folder / "p.toml"), "--out", str(folder / "o")]) == 0
    values = tomllib.loads((folder / "o" / "project.toml").read_text())["plant"]["parameters"]
    half = {name: 0.5 * (each["ci95"][1] - each["ci95"][0]) for name, each in values.items()}
    return {
        "stiff": (values["stiff"]["value"] * size / flow, half["stiff"] * size / flow),
        "leak": (values["leak"]["value"] * flow / size, half["leak"] * flow / size),
    }


def test_intervals_are_the_same_in_every_unit(tmp_path: Path) -> None:
    plain, scaled = found(tmp_path / "pa", "Pa", 1.0, 1.0), found(tmp_path / "bar", "bar", 1e5, 1e-6)
    for name, true in (("stiff", 2e12), ("leak", 2e-12)):
        assert abs(plain[name][0] - true) < 2.0 * plain[name][1] < 0.05 * true
        np.testing.assert_allclose(plain[name], scaled[name], rtol=1e-3)


def test_an_interval_narrower_than_six_digits_is_written_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{k * 0.01:.2f},{k % 7},{2.0 * (k % 7) + 1e6 + 1e-3 * (-1) ** k:.9f}" for k in range(400)]
    (tmp_path / "a.csv").write_text("\n".join(["time_s,valve_V,pressure_Pa", *rows, ""]))
    (tmp_path / "p.toml").write_text(STATIC)
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "o")]) == 0
    rest = tomllib.loads((tmp_path / "o" / "project.toml").read_text())["plant"]["parameters"]["offset"]
    low, high = rest["ci95"]
    printed = next(line for line in capsys.readouterr().out.splitlines() if line.strip().startswith("offset"))
    half = float(printed.split("\u00b1")[1].split()[0])
    assert low < rest["value"] < high
    np.testing.assert_allclose((high - low) / 2.0, half, rtol=0.05)
