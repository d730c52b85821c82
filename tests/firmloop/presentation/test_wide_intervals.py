"""A value whose interval is wider than itself keeps two digits; one that is known has as many as its interval tells."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.plant import Parameter
from firmloop.presentation import words


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (0.2134, 260.0, "0.21"),
        (-0.3141, 40.0, "-0.31"),
        (3.141, 19.0, "3.1"),
        (3.1e-7, 2.0, "3.1e-07"),
        (0.0, 3.0, "0"),
        (12.34, 100.0, "12"),
        (12.34, 1.9, "12.3"),
        (0.93987, 0.043, "0.940"),
    ],
)
def test_a_value_that_is_not_zero_is_shown_by_two_digits_at_least(value: float, half: float, shown: str) -> None:
    told, reach, _ = words.estimate(Parameter("x", "s", value, True, -1e9, 1e9, half / NORMAL_95))
    assert (told, reach) == (shown, f"± {half:.2g}")


def test_two_lags_that_are_only_known_together_are_not_shown_as_0(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(3)
    drive, lag, shown, rows = np.repeat(np.concatenate([[0.0], random.uniform(0.0, 5.0, 19)]), 50), 0.0, 0.0, []
    for k, u in enumerate(drive):
        rows.append(f"{0.02 * k:.2f},{u:.5g},{shown + 0.01 * random.normal():.5f}")
        lag, shown = lag + 0.1 * (u - lag), shown + 0.1 * (lag - shown)
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("\n".join(["time_s,valve_V,sensor_V", *rows, ""]))
    Path("p.toml").write_text(
        'schema = 1\nname = "lags"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "first_order"\n'
        'input = "valve_V"\noutputs = ["sensor_V"]\n[[plant.effects]]\nname = "sensor_lag"\noutput = "sensor_V"\n'
        "time_constant_s = { value = 0.15, free = true }\n"
    )
    assert main(["identify", "p.toml", "--out", "out", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["plant"]["parameters"]["time_constant_s"]
    assert main(["identify", "p.toml", "--out", "out2"]) == 0
    (line,) = (each for each in capsys.readouterr().out.splitlines() if each.startswith("  time_constant_s "))
    assert float(line.split()[1]) == pytest.approx(found["value"], rel=0.05)
    assert found["value"] > 0.01
