"""Logs that name each value are read, with the stamp of the log where no value is a time; words alone are told so."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import Recording, read_recording

ROWS = [(1.5 + 0.25 * k, 0.8 if k % 3 else 0.2, 25.0 + k) for k in range(20)]
LOGS = {
    "ESP-IDF": ["I (29) boot: ESP-IDF v5.1", *(f"I ({1e3 * t:.0f}) PID: duty={u} heat: {y} C" for t, u, y in ROWS)],
    "ESP-IDF with a line that is torn": [
        *(f"I ({1e3 * t:.0f}) PID: duty={u}, heat={y}" for t, u, y in ROWS),
        "I (9000) PID: duty=0.8, n=3",
    ],
    "Klipper": [
        "Start printer at Sun Nov  9 12:00:00 2025 (1762686000.0 100.0)",
        *(f"Stats {t}: mcu: freq=72 bed: target=60 heat={y} duty={u} fan: target=1 rpm=9" for t, u, y in ROWS),
    ],
    "ROS": [f"[INFO] [{1.7e9 + t:.6f}] [node]: duty={u} heat={y}" for t, u, y in ROWS],
    "a syslog": [f"Nov 29 09:00:{t:05.2f} host run[7]: duty={u} heat={y}" for t, u, y in ROWS],
    "bars and a time": [f"time_s: {t} | duty: {u} | heat: {y}" for t, u, y in ROWS],
    "units without a blank": [f"time_s={t}s duty={u} heat={y}C" for t, u, y in ROWS],
}


def read(path: Path, lines: list[str], rename: dict[str, str]) -> Recording:
    path.write_text("\n".join(lines))
    return read_recording(path, rename)


@pytest.mark.parametrize("kind", LOGS)
def test_a_log_that_names_each_value_is_a_recording(kind: str, tmp_path: Path) -> None:
    made = read(tmp_path / "log.txt", LOGS[kind], {})
    assert (made.time - made.time[0]).tolist() == pytest.approx([t - ROWS[0][0] for t, *_ in ROWS], abs=1e-5)
    assert made.columns["duty"].tolist() == [u for _, u, _ in ROWS]
    assert made.columns["heat"].tolist() == [y for *_, y in ROWS]
    assert "a name before each value" in made.notes[0]


def test_two_values_of_one_name_are_told_apart_by_their_sections(tmp_path: Path) -> None:
    made = read(tmp_path / "log.txt", LOGS["Klipper"], {})
    assert {"bed_target", "fan_target"} <= set(made.columns)


def test_the_lines_of_a_log_are_not_told_to_leave_themselves_out(tmp_path: Path, capsys) -> None:
    """They were `so are 200 of 200 rows: ... leave I (300) PID: on out of the file`."""
    for name, lines in {
        "words": [f"I ({k}) PID: step {k} done" for k in range(30)],
        "numbers": [f"I ({1e3 * t:.0f}) PID: {u},{y}" for t, u, y in ROWS],
    }.items():
        (tmp_path / f"{name}.log").write_text("\n".join(lines))
        assert main(["init", str(tmp_path / f"{name}.log"), "--out", str(tmp_path / "p.toml")]) == 2
        said = capsys.readouterr().err
        assert "out of the file" not in said and ("below a header" in said or "has no header" in said), said


@pytest.mark.parametrize("broken", ["duty=0.8, he=3", "duty=0.840.55, heat=3"])
def test_lines_without_a_stamp_that_lack_a_value_are_named(tmp_path: Path, broken: str) -> None:
    lines = [f"duty={u}, heat={y}" for _, u, y in ROWS]
    lines[7] = broken
    with pytest.raises(IdentifyError, match="line 8: does not name duty, heat, as most lines do"):
        read(tmp_path / "log.txt", lines, {})
