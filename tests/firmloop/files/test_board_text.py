"""What a board prints is read: Teleplot's lines, single quotes, and rows between which it has said something."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.recording import Recording, read_recording
from firmloop.scope.lines import teleplot
from firmloop.stages.board.channels import Channel

NAMES = ("time_s", "voltage_V", "speed_rad_s")
ROWS = [(0.002 * k, 6.0 - 0.25 * k, 3.5 * k - 1.0) for k in range(12)]


def read(path: Path, text: str) -> Recording:
    path.write_text(text)
    return read_recording(path, {})


def table(rows: list[str], head: str = ",".join(NAMES)) -> str:
    return "\n".join([head, *rows]) + "\n"


PLAIN = [",".join(map(repr, row)) for row in ROWS]


def same(made: Recording) -> None:
    assert made.time.tolist() == pytest.approx([row[0] for row in ROWS])
    for k, name in enumerate(NAMES[1:], 1):
        assert made.columns[name].tolist() == [row[k] for row in ROWS]


def stamped(k: int) -> str:
    ms, volt, speed = 1e3 * ROWS[k][0], *ROWS[k][1:]
    return f">voltage_V:{ms:g}:{volt!r}§V\n>speed_rad_s:{ms:g}:{speed!r}§rad/s|g"


TELEPLOT = {
    "a stamp a value": "\n".join(map(stamped, range(12))),
    "words of the program between": "boot\r\n" + "\r\n".join(f"{stamped(k)}\r\nloop {k}" for k in range(12)),
    "a text beside": "\n".join(f"{stamped(k)}\n>state:{2 * k}:run|t" for k in range(12)),
    "several samples a line": "\n".join(
        f">{name}:" + ";".join(f"{1e3 * row[0]:g}:{row[c]!r}" for row in ROWS[k : k + 4])
        for k in (0, 4, 8)
        for c, name in enumerate(NAMES[1:], 1)
    ),
}


@pytest.mark.parametrize("kind", TELEPLOT)
def test_lines_of_teleplot_are_a_recording(kind: str, tmp_path: Path) -> None:
    made = read(tmp_path / "log.txt", TELEPLOT[kind])
    same(made)
    assert "is Teleplot text" in made.notes[0]


def test_what_the_scope_prints_for_teleplot_is_read_back(tmp_path: Path) -> None:
    channels = [
        Channel(name, name, unit, -10.0, 100.0, None) for name, unit in (("voltage_V", "V"), ("speed_rad_s", "rad/s"))
    ]
    values = np.array([[row[0] / 0.002, *row[1:]] for row in ROWS])
    same(read(tmp_path / "seen.txt", "\n".join(teleplot(channels, 0.002, values))))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\n".join(f">{n}:{v!r}" for row in ROWS for n, v in zip(NAMES[1:], row[1:], strict=True)), "period_s"),
        ("\n".join(f">a:{2 * k}:1.5\n>b:{2 * k + 1}:2.5" for k in range(12)), "line 2: has no a at 1 ms: 24 of 24"),
        ("\n".join(f">a:{'' if k == 7 else f'{k}:'}1.5" for k in range(12)), "line 8: has a stamp, or has none"),
    ],
)
def test_teleplot_text_that_is_no_table_is_refused(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(IdentifyError, match=words):
        read(tmp_path / "log.txt", text)


QUOTED = {
    "names": table(PLAIN, "'time_s','voltage_V','speed_rad_s'"),
    "names and semicolons": table([row.replace(",", ";") for row in PLAIN], "'time_s';'voltage_V';'speed_rad_s'"),
    "numbers": table([",".join(f"'{cell}'" for cell in row.split(",")) for row in PLAIN]),
}


@pytest.mark.parametrize("kind", QUOTED)
def test_single_quotes_are_no_part_of_a_name_or_a_number(kind: str, tmp_path: Path) -> None:
    same(read(tmp_path / "log.csv", QUOTED[kind]))


@pytest.mark.parametrize("mark", [",", ";"])
def test_words_between_rows_are_left_aside_and_named_at_once(mark: str, tmp_path: Path) -> None:
    rows = [row.replace(",", mark) for row in PLAIN]
    said = [*rows[:4], "[WARN] i2c timeout, retry", *rows[4:8], "free heap: 23144", *rows[8:]]
    made = read(tmp_path / "log.csv", table(said, mark.join(NAMES)))
    same(made)
    assert "2 lines are between rows and no row, left aside: line 6 '[WARN] i2c timeout, retry', 11 'free" in str(
        made.notes
    )


def test_rows_that_are_torn_are_refused_all_at_once(tmp_path: Path) -> None:
    rows = [row.rpartition(",")[0] if k in (3, 7, 9) else row for k, row in enumerate(PLAIN)]
    words = r"line 5: has 2 values where the header names 3 columns, and 2 more are not whole \(line 9, 11\)"
    with pytest.raises(IdentifyError, match=words):
        read(tmp_path / "log.csv", table(rows))
