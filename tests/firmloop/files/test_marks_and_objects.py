"""Numbers with marks between thousands, and objects of JSON a line: the right values, or a sentence with the cure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

SPEED = [950.5, 1234.5, -2345.25, 1000.5, 12345.25, 1234567.5]
PROJECT = """schema = 1
name = "bench"
[recordings]
train = ["{file}"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
gain = {{ value = 1.0, free = true }}
time_constant_s = {{ value = 0.2, free = true }}
delay_s = {{ value = 0.0, free = false }}
"""


def simulated(folder: Path, capsys: pytest.CaptureFixture[str], name: str, text: str) -> tuple[str, list[float]]:
    """Predict the recording: return what is said of a refusal, and the speeds that its copy begins with."""
    (folder / name).write_text(text)
    (folder / "p.toml").write_text(PROJECT.format(file=name))
    out = folder / "out.csv"
    status = main(["simulate", str(folder / "p.toml"), str(folder / name), "--out", str(out)])
    said = capsys.readouterr().err
    assert status == (0 if out.exists() else 2), said
    inputs = np.loadtxt(out, delimiter=",", skiprows=1)[:, 1].tolist() if out.exists() else []
    return said, inputs


def table(cells: list[str], mark: str = ",") -> str:
    """The speeds stand in for the voltage, which a simulation hands on as it was read."""
    rows = [mark.join((f"{k}", cell, "1")) for k, cell in enumerate(cells)]
    return "\n".join([mark.join(("time_s", "voltage_V", "speed_rad_s")), *rows, ""])


def swapped(number: float) -> str:
    return f"{number:,}".translate(str.maketrans(",.", ".,"))


MARKED = {
    "quoted": table([f'"{v:,}"' for v in SPEED]),
    "quoted where needed": table([f'"{v:,}"' if abs(v) > 1000 else str(v) for v in SPEED]),
    "far below": table([*map(str, SPEED[:1] * 300), '"1,234.5"']),
    "semicolons": table([f"{v:,}" for v in SPEED], ";"),
    "tabs": table([f"{v:,}" for v in SPEED], "\t"),
    "points between thousands": table([swapped(v) for v in SPEED], ";"),
    "quoted points": table([f'"{swapped(v)}"' for v in SPEED]),
    "apostrophes": table([f"{v:,}".replace(",", "'") for v in SPEED]),
    "narrow blanks": table([f"{v:,}".replace(",", "\u202f") for v in SPEED], ";"),
    "blanks, decimal commas, and whole numbers": table(
        [f"{v:,}".translate(str.maketrans(",.", " ,")) for v in SPEED], ";"
    ).replace(";1\n", ";1 000\n"),
    "beside words": table([f"{swapped(v)};on" for v in SPEED], ";").replace("voltage_V", "voltage_V;state"),
}


@pytest.mark.parametrize("name", MARKED)
def test_marks_between_thousands_are_left_out(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, found = simulated(tmp_path, capsys, "log.csv", MARKED[name])
    assert found == ([950.5] * 300 + [1234.5] if name == "far below" else SPEED)


PLAIN = {
    "blanks between columns": table([f"{v:.3f}" for v in SPEED], " ").replace(" 1\n", " 123.456\n").replace(".", ","),
    "powers of ten": table([f"{v:.7e}" for v in SPEED], ";").replace(".", ","),
    "an address above": "Address;192.168.100.200\nLength;1 000\n" + table([*map(str, SPEED)], ";"),
    "a number above": "1.234.567;0\n" + table([*map(str, SPEED)], ";"),
}


@pytest.mark.parametrize("name", PLAIN)
def test_numbers_without_marks_are_read_as_they_stand(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert simulated(tmp_path, capsys, "log.csv", PLAIN[name])[1] == SPEED


def test_a_torn_row_is_no_matter_of_thousands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said, _ = simulated(tmp_path, capsys, "log.csv", table([*map(str, SPEED)]) + "6,1.5,250,3.5\n")
    assert "line 8: has 4 values" in said and "complete the row" in said


@pytest.mark.parametrize(
    "text",
    [
        table(['"1,234"', '"2,345"', '"950"', '"3,456"']),
        table([f'"{v},525"' for v in range(1, 6)]),
        table(["1,234", "2,345", "950", "3,456"], ";"),
        table([*map(str, range(5)), "1,234.5"]),
        table(["1.234", "2.345", "3.456"], ";").replace("\n0;", "\n0,1;").replace("\n1;", "\n1,1;"),
        table(["1,234", "2,345", "3,456"], ";").replace("\n0;", "\n0.1;").replace("\n1;", "\n1.1;"),
    ],
)
def test_a_comma_that_may_be_either_is_refused_with_the_cure(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, found = simulated(tmp_path, capsys, "log.csv", text)
    assert not found and "thousands" in said and "delete" not in said, said


DECIDED = {
    "a number of the column has a point": (table(['"1,234"', "950.5", '"2,345"']), [1234.0, 950.5, 2345.0]),
    "a number of the column has a comma": (table(["1.234", "950,5", "2.345"], ";"), [1234.0, 950.5, 2345.0]),
    "another column of commas has points": (table([f'"{v},525"' for v in (1, 2, 3)]).replace(",1\n", ",0.5\n"), None),
    "fractions begin below one": (table(['"1,234"', '"0,500"', '"2,250"']), [1.234, 0.5, 2.25]),
    "far below": (table(["1,234"] * 300 + ["0,5"], ";"), [1.234] * 300 + [0.5]),
}


@pytest.mark.parametrize("name", DECIDED)
def test_other_numbers_decide_what_a_lone_comma_or_point_is(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, right = DECIDED[name]
    assert simulated(tmp_path, capsys, "log.csv", text)[1] == (right or [1525.0, 2525.0, 3525.0])


@pytest.mark.parametrize("failed", ["OVLD", "", "--", "#N/A"])
@pytest.mark.parametrize("mark", [",", ";"])
def test_a_column_whose_last_readings_failed_is_no_column_of_words(
    failed: str, mark: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, found = simulated(tmp_path, capsys, "log.csv", table([*map(str, range(20)), *[failed] * 4], mark))
    assert not found and "line 22, column voltage_V" in said and ("delete the row" in said), said


@pytest.mark.parametrize("failed", ["OVLD", "#N/A", "-nan(ind)"])
def test_decimal_commas_part_no_columns_where_the_last_readings_failed(
    failed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [f"{k},5;{failed if k > 19 else k};1,5" for k in range(23)]
    text = "\n".join(["time_s;voltage_V;speed_rad_s", *rows])
    said, found = simulated(tmp_path, capsys, "log.csv", text)
    assert not found and f"line 22, column voltage_V: is {failed!r}" in said, said


def test_a_column_of_mostly_words_is_named_where_it_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, found = simulated(tmp_path, capsys, "log.csv", table([*map(str, range(20)), *["OVLD"] * 30]))
    assert not found and "voltage_V is no column of numbers, it holds 'OVLD' in 30 of 50 rows" in said, said


def test_a_renamed_column_of_words_is_named_as_the_project_calls_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "log.csv").write_text(
        table([*["OVLD"] * 9]).replace("voltage_V", "u, state").replace("OVLD", "OVLD,on")
    )
    (tmp_path / "p.toml").write_text(
        PROJECT.format(file="log.csv").replace("[plant]", '[recordings.rename]\nu = "voltage_V"\n[plant]', 1)
    )
    asked = ["simulate", str(tmp_path / "p.toml"), str(tmp_path / "log.csv"), "--out", str(tmp_path / "out.csv")]
    assert main(asked) == 2
    said = capsys.readouterr().err
    assert "column voltage_V is no column of numbers, it holds 'OVLD'; write numbers there" in said, said
    (tmp_path / "p.toml").write_text(PROJECT.format(file="log.csv"))
    assert main(asked) == 2
    said = capsys.readouterr().err
    assert "column voltage_V is missing" in said and "without numbers: u (holds 'OVLD'), state (holds 'on')" in said


SAMPLES = [{"time_s": 0.1 * k, "voltage_V": speed, "speed_rad_s": 1.5} for k, speed in enumerate(SPEED)]


def lines_of(samples: list[dict[str, object]]) -> str:
    return "".join(json.dumps(each) + "\n" for each in samples)


@pytest.mark.parametrize("name", ["log.jsonl", "log.ndjson", "log.log"])
@pytest.mark.parametrize("more", [{}, {"state": "on"}, {"ok": True}, {"imu": {"x": [1, 2]}}])
def test_objects_of_json_are_rows(
    name: str, more: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    turned = [
        dict(reversed([*each.items(), *more.items()])) if each["time_s"] else {**each, **more} for each in SAMPLES
    ]
    assert simulated(tmp_path, capsys, name, lines_of(turned))[1] == SPEED


@pytest.mark.parametrize(
    ("third", "says"),
    [
        ({**SAMPLES[2], "voltage_V": None}, "line 3, column voltage_V: is empty"),
        ({**SAMPLES[2], "voltage_V": float("nan")}, "line 3, column voltage_V: is nan"),
        ({**SAMPLES[2], "voltage_V": "1,234.5"}, "line 3, column voltage_V: is '1;234.5', not a number"),
        ({"time_s": 0.2, "speed_rad_s": 1.0}, "line 3: lacks voltage_V"),
        ({**SAMPLES[2], "extra": 1.0}, "line 3: adds extra"),
        (None, "line 3: is no object in JSON"),
    ],
)
def test_an_object_that_is_no_row_is_named_by_its_line(
    third: dict[str, object] | None, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = [json.dumps(each) for each in SAMPLES]
    lines[2] = '{"time_s": 0.2, "vol' if third is None else json.dumps(third)
    said, found = simulated(tmp_path, capsys, "log.jsonl", "\n".join(lines))
    assert not found and says in said, said


ROWS = [list(each.values()) for each in SAMPLES]
BY_NAME = {name: [each[name] for each in SAMPLES] for name in SAMPLES[0]}
DOCUMENTS = {
    "a list": json.dumps(SAMPLES),
    "a list in many lines": json.dumps(SAMPLES, indent=1),
    "an object a line in a list": "[\n" + ",\n".join(json.dumps(each) for each in SAMPLES) + "\n]\n",
    "columns": json.dumps(BY_NAME),
    "columns in many lines": json.dumps(BY_NAME, indent=2),
    "lists below their names": "\n".join(json.dumps(each) for each in ([*SAMPLES[0]], *ROWS)),
    "a list of lists": json.dumps([[*SAMPLES[0]], *ROWS]),
    "a list longer than a row may be": json.dumps([{**each, "note": "x" * 20_000} for each in SAMPLES]),
    "lines below what a board says": "rst:0x1\nready [3]\n" + lines_of(SAMPLES),
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_one_json_text_is_rows(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said, found = simulated(tmp_path, capsys, "log.json", DOCUMENTS[name])
    assert found == SPEED, said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"time_s": 1, "time_s": 2}\n' * 4, "line 1: names time_s twice"),
        (json.dumps({**BY_NAME, "voltage_V": SPEED[1:]}), "lists of different lengths: time_s 6, voltage_V 5"),
        (json.dumps([*SAMPLES[:2], {**SAMPLES[2], "voltage_V": None}, *SAMPLES[3:]]), "sample 3, column voltage_V"),
        (json.dumps([*SAMPLES[:3], 7]), "sample 4: is no object in JSON"),
        ("\n".join(json.dumps(each) for each in ([*SAMPLES[0]], *ROWS[:3], [1.0])), "line 5: has 1 values for 3"),
        (f'ready\n{lines_of(SAMPLES[:3])}{{"time_s"', "line 5: is no object in JSON"),
        (json.dumps(SAMPLES)[:-9], "write each sample in a line of its own"),
        ("[" * 90_000, "is no object in JSON"),
        (json.dumps({"time_s": 1.0}), "has 1 rows"),
        ("[]", "is empty"),
        ("[1, 2]", "no rows"),
        ("[\n" + ",\n".join([json.dumps(SAMPLES[0], indent=1)] * 300_000) + "\n]", "is one document of"),
    ],
)
def test_other_json_is_refused_with_a_sentence(
    text: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said, found = simulated(tmp_path, capsys, "log.jsonl", text)
    assert not found and says in said, said
