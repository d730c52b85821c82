"""Read one recording back from every format and dialect, by the command line: `python -m bench.host.formats`.

`firmloop simulate` copies the columns of a recording that the plant does not give, each number as it was read. They
are equal to what was written (the time to 1 ps, what is in mV to one rounding), or the file is refused with a sentence.
The exit status is 1 where one is neither.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main as firmloop
from tests.firmloop.columns import plain_file as plain
from tests.firmloop.files.test_dialects import DIALECTS, EXPORTS, STAMPS
from tests.firmloop.files.test_marks_and_objects import DOCUMENTS, MARKED, SAMPLES, SPEED
from tests.firmloop.files.test_readings_with_units import LINES, OURS
from tests.firmloop.files.test_recorders import RECORDERS, renamed
from tests.identify.recordings.test_measurement_formats import COLUMNS, WRITERS, mcap_of
from tests.identify.recordings.test_recording_files import mat73, npz, write_parquet

Array = np.ndarray
PROJECT = """schema = 1
name = "copied"
[recordings]
{rename}
[plant]
kind = "first_order"
input = "{drive}"
outputs = ["unseen"]
[plant.parameters]
gain = {{ value = 1.0, free = true }}
time_constant_s = {{ value = 1.0, free = true }}
delay_s = {{ value = 0.0, free = false }}
"""
TOLERANCE = 1e-12  # s, of time stamps that a format counts in ticks


def put(content: str | bytes) -> Callable[[Path], object]:
    """Return what writes a file that holds this."""
    return partial(_put, content if isinstance(content, bytes) else content.encode())


def _put(content: bytes, path: Path) -> None:
    path.write_bytes(content)


def _put_mcap(topics: Mapping[str, tuple[Array, Mapping[str, Array]]], path: Path) -> None:
    path.write_bytes(mcap_of(topics))


def written() -> Iterator[tuple[str, str, Callable[[Path], object], str, Mapping[str, Array]]]:
    """Yield each way: its name, its file, who writes it, [recordings.rename], and what has to come back."""
    for name, write in WRITERS.items():
        yield name, name, write, "", COLUMNS
    arrays = dict(COLUMNS)
    signals = {name: values for name, values in COLUMNS.items() if name != "time_s"}
    yield "npz", "r.npz", put(npz(**arrays)), "", COLUMNS
    yield "MATLAB 7.3", "r.mat", put(mat73(**arrays)), "", COLUMNS
    yield "Parquet", "r.parquet", partial(write_parquet, columns=arrays), "", COLUMNS
    topic = {"/motor": (COLUMNS["time_s"], signals)}
    yield "MCAP, JSON", "r.mcap", partial(_put_mcap, topic), "", COLUMNS
    columns = {"time_s": plain.TIME, "voltage_V": plain.VOLT}
    for name, (content, _) in DIALECTS.items():
        yield name, "r.csv", put(content), "", columns
    for name, content in STAMPS.items():
        yield f"stamps, {name}", "r.csv", put(content), "", columns
    sampled = {"time_s": np.array([each["time_s"] for each in SAMPLES]), "voltage_V": np.array(SPEED)}
    for name, content in DOCUMENTS.items():
        yield f"JSON, {name}", "r.json", put(content), "", sampled
    for name, content in MARKED.items():
        if name != "far below":  # which repeats its first row
            marked = {"time_s": np.arange(len(SPEED)), "voltage_V": np.array(SPEED)}
            yield f"thousands, {name}", "r.csv", put(content), "", marked
    for name, (content, rename, _) in EXPORTS.items():
        file = "r.lvm" if name.startswith("LabVIEW") else "r.csv"
        lines = f"[recordings.rename]\n{rename}"
        yield f"export, {name}", file, put(content), lines, columns
    for name, (content, volt, time, _) in RECORDERS.items():
        yield f"recorder, {name}", "r.csv", put(content), renamed(volt, time), columns
    for name, content in LINES.items():
        yield f"units behind the readings, {name}", "r.csv", put(content), OURS, columns


def read_back(folder: Path, file: str, rename: str, wanted: Mapping[str, Array]) -> str:
    """Return "equal", the sentence of a refusal, or what is wrong."""
    rules = tomllib.loads(rename).get("recordings", {}).get("rename", {})
    foreign = {rule["name"] if isinstance(rule, dict) else rule: name for name, rule in rules.items()}
    (folder / "p.toml").write_text(PROJECT.format(rename=rename, drive="voltage_V"))
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        status = firmloop(["simulate", str(folder / "p.toml"), str(folder / file), "--out", str(folder / "out.csv")])
    if status:
        return f"refused: {said.getvalue().strip()}" if status in (2, 3) else f"WRONG: exit {status}"
    lines = (folder / "out.csv").read_text().splitlines()
    converted = b"mV" in (folder / file).read_bytes()
    names, rows = lines[0].split(","), np.array([line.split(",") for line in lines[1:]], dtype=float)
    for name, values in wanted.items():
        place = names.index(name if name in names else foreign.get(name, name))
        found = rows[:, place]
        if name == "time_s":
            close = np.allclose(found, values, 0, TOLERANCE)
        elif converted:
            close = bool(np.all(np.abs(found - values) <= np.spacing(np.abs(values))))
        else:
            close = np.array_equal(found, values)
        if not close:
            return f"WRONG: {name} is {np.abs(found - values).max():.3g} away"
    return "equal"


def main() -> int:
    counts = {"equal": 0, "refused": 0, "WRONG": 0, "not installed": 0}
    for name, file, write, rename, wanted in written():
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made)
            try:
                write(folder / file)
                found = read_back(folder, file, rename, wanted)
            except pytest.skip.Exception as lacking:
                found = f"not installed: {lacking.msg}"
        counts[found.partition(":")[0]] += 1
        if found != "equal":
            print(f"  {name}: {found}")
    print(", ".join(f"{count} {word}" for word, count in counts.items()))
    return int(counts["WRONG"] > 0)


if __name__ == "__main__":
    sys.exit(main())
