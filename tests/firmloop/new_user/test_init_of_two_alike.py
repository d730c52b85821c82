"""Two columns of one quantity, as a scope records them, are a drive and its answer where there are no others."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

HEADS = (
    "t,u_motor,u_tacho\ns,V,V",
    "Time(s),CH1V,CH2V,",
    "Zeit [s],Spannung 1 [V],Spannung 2 [V]",
    "time,voltage_supply,voltage_output",
    "time_s,voltage_V,voltage_C_V",
    "t,ch1_voltage,ch2_voltage",
    "t,drive_voltage,tacho_voltage",
    "t,speed1_rpm,speed2_rpm",
    "Time,Channel A,Channel B\n(s),(V),(V)",
)


@pytest.mark.parametrize("head", HEADS)
@pytest.mark.parametrize("turned", [False, True], ids=["drive first", "answer first"])
def test_what_the_other_lags_behind_is_the_input(head: str, turned: bool, tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    drive, answer = np.where(np.arange(1000) % 400 < 200, 5.0, 0.5), [0.0]
    for u in drive[:-1]:
        answer.append(answer[-1] + 0.02 * (u - answer[-1]))
    read = np.array([drive, answer]).T + random.normal(0.0, 0.02, (1000, 2))
    names, *units = head.split("\n")
    cells = names.split(",")
    order = [0, 2, 1, *range(3, len(cells))] if turned else list(range(len(cells)))
    end = "," * (len(cells) - 3)
    rows = [
        f"{k * 1e-3:.3f},{one:.4f},{other:.4f}{end}"
        for k, (one, other) in enumerate(read[:, [1, 0] if turned else [0, 1]])
    ]
    (tmp_path / "a.csv").write_text("\n".join([",".join(cells[k] for k in order), *units, *rows, ""]))
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 0
    made = tomllib.loads((tmp_path / "p.toml").read_text())
    foreign = (
        {rule if isinstance(rule, str) else rule["name"]: name for name, rule in made["recordings"]["rename"].items()}
        if "rename" in made["recordings"]
        else {}
    )
    plant = made["plant"]
    assert [foreign.get(each, each) for each in (plant["input"], *plant["outputs"])] == cells[1:3]
