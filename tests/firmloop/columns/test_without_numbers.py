"""A column that is there but holds no numbers is named with what it holds, and never called missing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.plain_file import HEAT, TIME, VOLT, alike, rows_of

HEX = "\n".join(["t,voltage_V,temperature_C", *(f"{hex(50 * k)},{r}" for k, r in enumerate(rows_of(VOLT, HEAT))), ""])
LAST = hex(50 * (len(TIME) - 1))


@pytest.mark.parametrize(
    ("lines", "is_it"),
    [
        ('[recordings.rename]\nt = { name = "time_s", unit = "ms" }', "is the time, but"),
        ("", "seems to be the time, but"),
    ],
)
def test_a_time_in_words_is_named_as_the_file_has_it(lines: str, is_it: str, bench: Callable[..., tuple]) -> None:
    status, _, said = bench(HEX, lines)
    assert status == 2 and f"column t {is_it} no column of numbers, it holds '{LAST}'; write decimal numbers" in said
    assert "missing" not in said and "0.001" not in said and "period_s =" not in said
    status, columns, said = bench(HEX, "period_s = 0.05")
    assert status == 0, said
    alike(columns)


def stepped(state: Callable[[float], str]) -> str:
    power = np.repeat([0.0, 60.0, 20.0, 80.0, 0.0], 120)
    level, rows = 0.0, ["time_s,heater_percent,temperature_C,state"]
    for k, (u, noise) in enumerate(zip(power, np.random.default_rng(1).normal(size=600), strict=True)):
        rows.append(f"{k},{u:g},{21.0 + level + 0.05 * noise:.4f},{state(u)}")
        level += (1 - np.exp(-1 / 40)) * (0.8 * u - level)
    return "\n".join([*rows, ""])


def test_init_says_which_column_it_left_aside_and_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text(stepped(lambda u: "ON" if u else "OFF"))
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 0
    told = "column state holds 'OFF' and is not used"
    assert told in capsys.readouterr().out and told in (tmp_path / "p.toml").read_text()
    left = ["--leave-out", "state", "--out", str(tmp_path / "q.toml")]
    assert main(["init", str(tmp_path / "a.csv"), *left]) == 0
    assert "state" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (
            "\n".join(["time_s,heater,temp_C", *(f"{r},OFF,20.{k % 7}" for k, r in enumerate(rows_of(TIME)))]),
            "it has temp_C; without numbers: heater (holds 'OFF'); write decimal numbers there, such as 0 and 1",
        ),
        (HEX, f"without numbers: t (holds '{LAST}'); write decimal numbers there, or give the time between two rows"),
    ],
)
def test_init_names_the_words_that_stand_where_numbers_are_needed(
    content: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(content)
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 2
    assert words in capsys.readouterr().err


def empty_columns(named: str = "servo,app message,") -> str:
    """Return rows with an empty column amid the others, an empty one behind them, and a delimiter at the end."""
    rows = (row.rpartition(",")[0].replace(",", ",,", 1) + ",," for row in stepped(lambda u: "").splitlines()[1:])
    first, *others = named.split(",")
    return "\n".join([f"time_s,{first},heater_percent,temperature_C,{','.join(others)}", *rows, ""])


def test_columns_without_a_single_number_are_no_columns_of_the_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(empty_columns())
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 0
    said = capsys.readouterr().out
    assert "first_order, heater_percent -> temperature_C" in said
    assert "column servo is empty and is not used" in said and "column app message is empty and is not used" in said
    left = ["--leave-out", "servo", "--leave-out", "app message", "--out", str(tmp_path / "q.toml")]
    assert main(["init", str(tmp_path / "a.csv"), *left]) == 0
    assert "servo" not in capsys.readouterr().out
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 0


@pytest.mark.parametrize("used", ["servo", "app message"])
def test_an_empty_column_that_a_project_uses_is_called_empty(used: str, bench: Callable[..., tuple]) -> None:
    content = empty_columns().replace("heater_percent", "u").replace(f"{used},", "voltage_V,", 1)
    status, _, said = bench(content)
    assert status == 2 and "column voltage_V is no column of numbers, it is empty; write numbers there" in said


def test_columns_of_nan_of_a_binary_file_are_left_aside_until_they_are_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = np.genfromtxt(stepped(lambda u: "0").splitlines(), delimiter=",", names=True)
    columns = {name: table[name] for name in ("time_s", "heater_percent", "temperature_C")}
    np.savez(tmp_path / "a.npz", **columns, servo=np.full(len(table), np.nan))
    assert main(["init", str(tmp_path / "a.npz"), "--out", str(tmp_path / "p.toml")]) == 0
    assert "column servo holds no number and is not used" in capsys.readouterr().out
    project = (tmp_path / "p.toml").read_text()
    (tmp_path / "p.toml").write_text(project.replace('input = "heater_percent"', 'input = "servo"'))
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "fit")]) == 2
    assert "column servo is no column of numbers, it holds no number; write numbers there" in capsys.readouterr().err
