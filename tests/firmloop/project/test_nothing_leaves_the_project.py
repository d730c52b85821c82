"""Whatever a stranger's project, recording, result folder or delivery holds: nothing runs, nothing outside changes."""

from __future__ import annotations

import gzip
import html
import io
import json
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from firmloop.cli import main
from tests.firmloop.conftest import PROJECT

COMMANDS = ("$(touch RAN)", "`touch RAN`", '"; touch RAN; "', "x\nall:\n\ttouch RAN", "$<SHELL:touch RAN>")
MARKUP = ("<script>RAN()</script>", "*/ RAN(); /*", "??/\nRAN();", "x\\\nRAN();", "{{ RAN }}", "%n%n%s", "x'+RAN+'")
PLACES = {
    "name": ('"tank_heater"', "{}"),
    "kind of a plant": ('kind = "first_order"', "kind = {}"),
    "kind of a controller": ('kind = "pid"', "kind = {}"),
    "input": ('input = "voltage_V"', "input = {}"),
    "output": ('["temperature_C"]', "[{}]"),
    "parameter": ("gain = {", "{} = {{"),
    "signal": ("reference = {", "{} = {{"),
    "unit": ('"V", low', "{}, low"),
    "number": ('"float32"', "{}"),
    "target": ('["host"]', "[{}]"),
    "recording": ('["train.csv"]', "[{}]"),
    "test": ('["test.csv"]', "[{}]"),
}
FILES = ("$(touch RAN)", "`touch RAN`", '" RAN "', "a\nint RAN;", "x*\\\nRAN", "<script>RAN()<!--", "%s%n", "{{RAN}}")


class Runs:
    """Unpickled, it runs a command."""

    def __reduce__(self) -> tuple[Callable[[str], int], tuple[str]]:
        return os.system, ("touch RAN",)


@pytest.fixture
def here(project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stranger's folder, which the user stands in, beside what is the user's own."""
    folder = project.parent
    project.rename(folder / "p.toml")
    own = folder.parent / "own"
    own.mkdir()
    (own / "kept.txt").write_text("9137 is secret\n")
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def untouched(here: Path) -> Callable[[], None]:
    own = {path: path.read_bytes() for path in (here.parent / "own").iterdir()}

    def check() -> None:
        assert {path: path.read_bytes() for path in (here.parent / "own").iterdir()} == own
        assert not list(here.parent.rglob("RAN"))

    return check


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("text", [*COMMANDS, *MARKUP])
def test_a_text_of_a_project_is_refused_or_only_text(
    place: str, text: str, here: Path, untouched: Callable[[], None], capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = PLACES[place]
    assert PROJECT.count(old) == 1
    (here / "p.toml").write_text(PROJECT.replace(old, new.format(json.dumps(text))))
    assert main(["run", "p.toml", "--out", "out"]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1 and said.startswith("firmloop: "), said
    assert not (here / "out").exists()
    untouched()


def test_the_name_of_a_file_is_only_a_name_in_all_that_is_written(here: Path, untouched: Callable[[], None]) -> None:
    recorded = json.dumps([f"{name}.csv" for name in FILES[2:6]])
    few = "".join((here / "train.csv").read_text().splitlines(keepends=True)[:121])
    for name in FILES:
        (here / f"{name}.csv").write_text(few)
    for name in FILES:
        (here / f"{name}.toml").write_text(PROJECT.replace('["train.csv"]', recorded))
        assert main(["generate", f"./{name}.toml", "--out", f"out/{len(name)}"]) == 0
    for verb in ("run", "diagnose"):
        assert main([verb, f"./{FILES[3]}.toml", "--out", f"out/{verb}"]) == 0
    for file in (here / "out").rglob("*"):
        written = file.read_text() if file.is_file() else ""
        if file.suffix == ".html":
            assert not [name for name in FILES if name != html.escape(name, quote=False) and name in written], file
        elif file.suffix not in (".json", ".csv"):  # texts that are quoted as their format asks
            told = [line for line in written.splitlines() if "RAN" in line and "recordings" not in line]
            assert all(line.startswith(("#", " *", "train =")) for line in told), (file, told)
    untouched()


@pytest.mark.parametrize("name", FILES)
def test_a_project_is_begun_for_a_file_of_any_name_or_refused(
    name: str, here: Path, untouched: Callable[[], None]
) -> None:
    (here / "train.csv").rename(here / f"{name}.csv")
    status = main(["init", f"./{name}.csv", "--out", "new.toml"])
    assert status == (2 if "\n" in name else 0)
    assert status or main(["identify", "new.toml", "--out", "out"]) == 0
    untouched()


@pytest.mark.parametrize("kept", ["tank_heater", "tank_heater/src", "tank_heater/test"])
def test_a_link_to_a_folder_among_older_results_is_not_followed(
    kept: str, here: Path, untouched: Callable[[], None], capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "out" / kept).parent.mkdir(parents=True)
    (here / "out" / kept).symlink_to(here.parent / "own")
    for verb, *more in (["generate"], ["verify", "--steps", "50"], ["run", "--steps", "50"], ["prove"]):
        assert main([verb, "p.toml", "--out", "out", *more]) == 2
        assert f"--out out: {kept} is a link there; move it away" in capsys.readouterr().err
    untouched()


def test_links_to_files_among_older_results_are_replaced(here: Path, untouched: Callable[[], None]) -> None:
    links = [here / "out" / name for name in ("verdict.json", "report.html", "project.toml")]
    links += [here / "out" / "tank_heater" / "src" / "tank_heater.c"]
    links[-1].parent.mkdir(parents=True)
    for link in links:
        link.symlink_to(here.parent / "own" / "kept.txt")
    assert main(["run", "p.toml", "--out", "out", "--steps", "50"]) == 0
    assert not [link for link in links if link.is_symlink()]
    untouched()


@pytest.mark.parametrize(
    "words",
    [["design", "p.toml", "--out", "out"], ["verify", "p.toml", "--out", "o", "--steps", "50", "--junit", "pipe"]],
)
def test_a_pipe_or_device_where_a_file_is_to_be_stays_what_it_is(
    words: list[str], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For root the file had taken the place of /dev/null or /dev/stdout."""
    (here / "out").mkdir()
    pipes = here / "pipe", here / "out" / "project.toml"
    for pipe in pipes:
        os.mkfifo(pipe)
    assert main(words) == 2
    assert "is a pipe or a device there" in capsys.readouterr().err
    assert all(pipe.is_fifo() for pipe in pipes)


@pytest.mark.parametrize("name", [".out.abcd1234", "out.lock", ".project.abcd1234"])
def test_a_link_that_is_called_like_a_leftover_is_not_swept(
    name: str, here: Path, untouched: Callable[[], None]
) -> None:
    (here / name).symlink_to(here.parent / "own")
    assert main(["generate", "p.toml", "--out", "out"]) == 0
    untouched()


def packed(here: Path, kind: str) -> str:
    """Write a recording whose format could run something or lead to another file, and return its name."""
    rows = np.loadtxt(here / "train.csv", delimiter=",", skiprows=1)
    columns = dict(zip(("time_s", "voltage_V", "temperature_C"), rows.T, strict=True))
    secret = here.parent / "own" / "kept.txt"
    if kind == "objects.npz":
        np.savez(here / kind, **(columns | {"temperature_C": np.array([Runs()] * 400, dtype=object)}))
    elif kind in ("pickle.npz", "pickle.mat", "pickle.parquet", "pickle.h5"):
        (here / kind).write_bytes(pickle.dumps(Runs()))
    elif kind == "slip.npz":
        with zipfile.ZipFile(here / kind, "w") as archive:
            for name, values in (columns | {"../../own/RAN": rows[:, 0], f"{here.parent}/RAN": rows[:, 0]}).items():
                block = io.BytesIO()
                np.save(block, values)
                archive.writestr(f"{name}.npy", block.getvalue())
    elif kind == "slip.csv.gz":
        with (here / kind).open("wb") as raw, gzip.GzipFile("../../own/RAN", "wb", fileobj=raw) as stream:
            stream.write((here / "train.csv").read_bytes())
    elif kind == "words.mat":
        scipy.io.savemat(here / kind, columns | {"temperature_C": np.array(["RAN"] * 400, dtype=object)})
    else:
        with h5py.File(here / kind, "w") as file:
            file.update({name: values for name, values in columns.items() if name != "voltage_V"})
            if kind == "external.h5":
                file["voltage_V"] = h5py.ExternalLink(str(secret), "/voltage_V")
            elif kind == "virtual.h5":
                layout = h5py.VirtualLayout(shape=(400,), dtype="f8")
                layout[:] = h5py.VirtualSource(str(secret), "voltage_V", shape=(400,))
                file.create_virtual_dataset("voltage_V", layout)
            else:
                file.create_dataset("voltage_V", (1,), dtype="f8", external=[(str(secret), 0, 8)])
    return kind


@pytest.mark.parametrize(
    "kind",
    "objects.npz pickle.npz pickle.mat pickle.parquet pickle.h5 slip.npz slip.csv.gz words.mat external.h5 virtual.h5 "
    "storage.h5".split(),
)
def test_a_recording_of_any_format_is_numbers_or_refused(
    kind: str, here: Path, untouched: Callable[[], None], capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "p.toml").write_text(PROJECT.replace('"train.csv"', f'"{packed(here, kind)}"'))
    status = main(["identify", "p.toml", "--out", "out"])
    assert status == (0 if kind.startswith("slip") else 2)
    assert "9137" not in capsys.readouterr().err
    untouched()


@pytest.mark.parametrize(
    "name",
    "|touch${IFS}RAN touch${IFS}RAN| http://127.0.0.1:9/x.csv file:///etc/passwd ~/x.csv $HOME/x.csv fd://0 /dev/stdin "
    "/dev/zero /proc/self/mem -".split(),
)
def test_a_recording_is_a_file_and_nothing_else(name: str, here: Path, untouched: Callable[[], None]) -> None:
    (here / "p.toml").write_text(PROJECT.replace('"train.csv"', json.dumps(name)))
    assert main(["identify", "p.toml", "--out", "out"]) == 2
    untouched()


@pytest.mark.parametrize("change", ["a Makefile", "a build script", "an include", "a link", "a name", "a header"])
def test_a_delivery_is_read_and_never_built(change: str, here: Path, untouched: Callable[[], None]) -> None:
    assert main(["generate", "p.toml", "--out", "out"]) == 0
    folder, proof = here / "out" / "tank_heater", here / "out" / "proof.json"
    source, header = folder / "src" / "tank_heater.c", folder / "src" / "tank_heater.h"
    if change == "a Makefile":
        (folder / "Makefile").write_text("all:\n\ttouch RAN\n")
        (here / "out" / "Makefile").write_text("all:\n\ttouch RAN\n")
    elif change == "a build script":
        (folder / "rust" / "build.rs").write_text('fn main() { std::fs::write("RAN", "").unwrap(); }\n')
        shutil.copy(folder / "rust" / "build.rs", here / "out" / "conftest.py")
    elif change == "a link":
        source.unlink()
        source.symlink_to(here.parent / "own" / "kept.txt")
    elif change == "a name":
        proof.write_text(proof.read_text().replace('"tank_heater"', '"../../own/kept"'))
    else:
        at = source if change == "an include" else header
        at.write_text(f'#include "{here.parent}/own/kept.txt"\n{at.read_text()}')
    assert main(["prove", "out"]) == {"a Makefile": 0, "a build script": 0, "a link": 2, "a name": 2}.get(change, 1)
    untouched()
