"""`init` reads what tools save by themselves, or says what to save instead; and it reads each file once."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

import firmloop.stages.starting.reading as reading
from firmloop.cli import main

Array = NDArray[np.float64]

TIME = 0.001 * np.arange(400)
VOLTS = np.repeat(np.random.default_rng(1).uniform(-10.0, 10.0, 20), 20)
SPEED = np.round(scipy.signal.lfilter([0.0, 0.4], [1.0, -0.98], VOLTS), 4)
NAMES = ("time_s", "voltage_V", "speed_rad_s")
ROWS = [[float(each) for each in row] for row in zip(TIME, VOLTS, SPEED, strict=True)]
OBJECTS = [dict(zip(NAMES, row, strict=True)) for row in ROWS]


def begun(*paths: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Run init on files; return its status, and all that is said."""
    status = main(["init", *map(str, paths), "--out", str(paths[0].parent / "p.toml")])
    return status, "".join(capsys.readouterr())


def scopes(*signals: dict[str, object]) -> Array:
    """Return an array of structures, as a scope of Simulink with several inputs saves them."""
    found = np.zeros((1, len(signals)), dtype=[(name, object) for name in signals[0]])
    for k, signal in enumerate(signals):
        for name, value in signal.items():
            found[0, k][name] = value
    return found


def signal(values: Array, label: str) -> dict[str, object]:
    return {"values": values[:, None], "dimensions": 1.0, "label": label}


def with_time(values: Array) -> dict[str, object]:
    return {"time": TIME, "signals": {"values": values, "label": "x"}, "blockName": "bench/To Workspace"}


@pytest.mark.parametrize(
    ("saved", "drive", "output"),
    [
        ({"voltage_V": with_time(VOLTS), "speed_rad_s": with_time(SPEED)}, "voltage_V", "speed_rad_s"),
        ({"log": with_time(np.column_stack([VOLTS, SPEED]))}, "log_1", "log_2"),
        (
            {"log": {"time": TIME, "signals": scopes(signal(VOLTS, "voltage_V"), signal(SPEED, "speed_rad_s"))}},
            "voltage_V",
            "speed_rad_s",
        ),
        ({"log": {"time": TIME, "signals": scopes(signal(VOLTS, ""), signal(SPEED, ""))}}, "log_1", "log_2"),
        (
            {"voltage_V": {"Time": TIME, "Data": VOLTS}, "speed_rad_s": {"Time": TIME, "Data": SPEED}},
            "voltage_V",
            "speed_rad_s",
        ),
    ],
)
def test_structures_with_time_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], saved: dict[str, object], drive: str, output: str
) -> None:
    scipy.io.savemat(tmp_path / "r.mat", saved)
    status, said = begun(tmp_path / "r.mat", capsys=capsys)
    assert status == 0 and f"{drive} -> {output}" in said


@pytest.mark.parametrize(
    ("saved", "words"),
    [
        (
            {"data": np.column_stack([TIME, VOLTS, SPEED])},
            "holds data, a matrix of 400 x 3, whose columns have no name",
        ),
        (
            {"time_s": TIME, "voltage_V": VOLTS + 0j, "speed_rad_s": SPEED + 0j},
            "holds complex numbers: voltage_V, speed_rad_s; save what is measured, as in voltage_V = real(voltage_V)",
        ),
        ({"U": np.column_stack([TIME, VOLTS]), "Y": np.column_stack([TIME, SPEED])}, "holds U, a matrix of 400 x 2"),
        ({"runs": np.array([(TIME, VOLTS)] * 2, dtype=[("t", "O"), ("u", "O")])}, "holds an array of structures"),
    ],
)
def test_what_has_no_names_is_said_with_the_lines_that_give_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], saved: dict[str, object], words: str
) -> None:
    scipy.io.savemat(tmp_path / "r.mat", saved)
    status, said = begun(tmp_path / "r.mat", capsys=capsys)
    assert status == 2 and words in said and "save(" in said


@pytest.mark.parametrize(
    "document",
    [
        {"device": "bench 3", "samples": OBJECTS},
        {"columns": NAMES, "index": [*range(len(ROWS))], "data": ROWS},
    ],
)
def test_samples_within_an_object_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], document: dict[str, object]
) -> None:
    (tmp_path / "r.json").write_text(json.dumps(document))
    status, said = begun(tmp_path / "r.json", capsys=capsys)
    assert status == 0 and "voltage_V -> speed_rad_s" in said


def test_lists_without_names_are_asked_for_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "r.json").write_text(json.dumps(ROWS))
    status, said = begun(tmp_path / "r.json", capsys=capsys)
    assert status == 2 and "let the first list hold the names" in said and "torn line" not in said


@pytest.mark.parametrize(("first", "timed"), [(0, True), (1, False)])
def test_a_table_without_names_and_times_is_not_asked_to_call_its_input_a_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], first: int, timed: bool
) -> None:
    rows = "\n".join(";".join(f"{each:.4f}".replace(".", ",") for each in row[first:]) for row in ROWS)
    (tmp_path / "r.csv").write_text(rows + "\n")
    status, said = begun(tmp_path / "r.csv", capsys=capsys)
    assert status == 2 and "has no header" in said
    assert ("such as time_s" in said) is timed and ("--period" in said) is not timed


def test_each_file_is_read_once_though_a_column_of_the_first_stands_still(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    once = reading.read_raw
    monkeypatch.setattr(reading, "read_raw", lambda path: (seen.append(path.name), once(path))[1])
    for name, aside in (("a.csv", 0 * TIME), ("b.csv", TIME**2)):
        rows = [
            "time_s,voltage_V,speed_rad_s,lamp",
            *(f"{t},{u},{w},{x}" for (t, u, w), x in zip(ROWS, aside, strict=True)),
        ]
        (tmp_path / name).write_text("\n".join([*rows, ""]))
    status, _ = begun(tmp_path / "a.csv", tmp_path / "b.csv", capsys=capsys)
    assert status == 0 and seen == ["a.csv", "b.csv"]


WORKSPACE = {
    **{name: np.asarray(values) for name, values in zip(NAMES, (TIME, VOLTS, SPEED), strict=True)},
    "K": np.array([3.0, 0.5]),
    "A": np.array([[1.0, 0.1], [0.0, 0.9]]),
    "wheel_rad_s": VOLTS[:-5],
}


@pytest.mark.parametrize("ending", ["mat", "npz", "h5"])
def test_what_stands_in_a_workspace_besides_is_left_aside_and_named(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"r.{ending}"
    if ending == "h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            for name, values in WORKSPACE.items():
                file[name] = values
    else:
        (scipy.io.savemat if ending == "mat" else lambda file, held: np.savez(file, **held))(path, WORKSPACE)
    status, said = begun(path, capsys=capsys)
    assert status == 0 and "voltage_V -> speed_rad_s" in said
    assert "column K has 2 rows where time_s has 400 and is not used" in said
    assert "column A is a 2x2 array and is not used" in said
    project = tmp_path / "p.toml"
    project.write_text(project.read_text().replace('outputs = ["speed_rad_s"]', 'outputs = ["wheel_rad_s"]'))
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 2
    short = "column wheel_rad_s was left aside, for it has 395 rows where time_s has 400; store it as one value a row"
    assert short in capsys.readouterr().err
