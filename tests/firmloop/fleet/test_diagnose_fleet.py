"""`firmloop diagnose --fleet`: the machine that is different is named, nothing is lost, no cluster changes a byte."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from firmloop.cli import main
from tests.conftest import Once
from tests.firmloop.fleet.heaters import CHANGED, GAINS, write_heaters

ROOT = Path(__file__).parents[3]
RECORDINGS = len(GAINS) + 4
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in (str(ROOT), *sys.path) if path)}


@pytest.fixture(scope="module")
def bench(once: Once) -> Path:
    """The project, its fleet, and the results of one run, which no test changes."""

    def fill(folder: Path) -> None:
        project = write_heaters(folder)
        assert main(["diagnose", str(project), "--fleet", str(folder / "fleet"), "--out", str(folder / "out")]) == 1

    return once("fleet", fill)


def results(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "machines").rglob("*.json")}


def test_the_machine_that_changed_is_named_with_figure_and_date(bench: Path) -> None:
    found = json.loads((bench / "out" / "fleet.json").read_text())
    (different,) = found["different"]
    assert (different["machine"], different["since"]) == (CHANGED, f"{CHANGED}/week_10.csv")
    assert different["recordings"] == [f"{CHANGED}/week_{week}.csv" for week in (10, 11)]
    gain = different["departures"][0]
    assert gain["figure"] == "gain" and gain["ci95"][0] < 4.2 < gain["ci95"][1] and gain["p"] < 0.05
    assert found["typical"]["gain"]["median"] == pytest.approx(3.0, rel=0.02)
    assert (found["recordings"], found["machines"], found["failed"]) == (RECORDINGS, len(GAINS) + 1, {})


def test_the_figures_stand_in_a_table_and_on_a_page(bench: Path) -> None:
    with (bench / "out" / "fleet.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == RECORDINGS * 3 and {row["figure"] for row in rows} >= {"gain", "time_constant_s"}
    page = (bench / "out" / "fleet.html").read_text()
    assert CHANGED in page and page.count("<svg") == 3 and str(bench) not in page


@pytest.mark.skipif(find_spec("pyarrow") is None, reason="pyarrow is not installed")
def test_parquet_holds_what_the_csv_holds(bench: Path) -> None:
    from pyarrow import parquet

    table = parquet.read_table(bench / "out" / "fleet.parquet").to_pylist()
    with (bench / "out" / "fleet.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["value"]) for row in rows] == [row["value"] for row in table]
    assert [row["machine"] for row in rows] == [row["machine"] for row in table]


def test_a_second_run_takes_what_is_there(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    shutil.copytree(bench / "out", out)
    before = {path: path.stat().st_mtime_ns for path in (out / "machines").rglob("*.json")}
    again = ["diagnose", str(bench / "heater.toml"), "--fleet", str(bench / "fleet"), "--out", str(out)]
    assert main(again) == 1
    assert f"taken from an earlier run: {RECORDINGS} of {RECORDINGS} recordings" in capsys.readouterr().out
    assert before == {path: path.stat().st_mtime_ns for path in (out / "machines").rglob("*.json")}


@pytest.mark.skipif(os.name != "posix", reason="kills as POSIX does")
def test_nothing_is_lost_when_it_is_killed(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["diagnose", str(bench / "heater.toml"), "--fleet", str(bench / "fleet"), "--out", str(tmp_path)]
    command = [sys.executable, "-m", "firmloop", *arguments, "--workers", "1"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, env=ENVIRONMENT, cwd=ROOT)
    limit = time.monotonic() + 120
    while len(results(tmp_path)) < 3:
        assert process.poll() is None and time.monotonic() < limit
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()
    kept = results(tmp_path)
    assert 3 <= len(kept) < RECORDINGS and not (tmp_path / "fleet.json").exists()
    assert main([*arguments, "--workers", "1"]) == 1  # a second would load all the libraries for a few recordings
    assert f"taken from an earlier run: {len(kept)} of {RECORDINGS} recordings" in capsys.readouterr().out
    assert results(tmp_path) == results(bench / "out")
    assert (tmp_path / "fleet.json").read_bytes() == (bench / "out" / "fleet.json").read_bytes()


@pytest.mark.skipif(os.name != "posix", reason="kills as POSIX does")
def test_a_worker_that_dies_fails_one_recording(bench: Path, tmp_path: Path) -> None:
    """The worker of the last recording is killed from outside; a further run does what is left."""
    fleet = tmp_path / "fleet"
    fleet.mkdir()
    (fleet / "a.csv").write_bytes((bench / "fleet" / "heater_1.csv").read_bytes())
    out = tmp_path / "out"
    arguments = ["diagnose", str(bench / "heater.toml"), "--fleet", str(fleet), "--out", str(out), "--workers", "1"]
    process = subprocess.Popen(
        [sys.executable, "-m", "firmloop", *arguments], stderr=subprocess.PIPE, env=ENVIRONMENT, cwd=ROOT, text=True
    )
    children = Path(f"/proc/{process.pid}/task")
    if not children.is_dir():
        process.kill()
        pytest.skip("the children of a process are found in /proc")
    worker = next(_children(process))
    os.kill(worker, signal.SIGKILL)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 3 and "a.csv was not diagnosed: its process ended with status -9" in said
    assert not results(out) and json.loads((out / "fleet.json").read_text())["failed"]
    assert main(arguments) == 0 and len(results(out)) == 1


def _children(process: subprocess.Popen[str]) -> Iterator[int]:
    limit = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < limit:
        for path in Path(f"/proc/{process.pid}/task").glob("*/children"):
            yield from map(int, path.read_text().split())
        time.sleep(0.02)


def test_a_changed_recording_is_diagnosed_again(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet, out = tmp_path / "fleet", tmp_path / "out"
    fleet.mkdir()
    for name in ("heater_1.csv", "heater_2.csv"):
        (fleet / name).write_bytes((bench / "fleet" / name).read_bytes())
    arguments = ["diagnose", str(bench / "heater.toml"), "--fleet", str(fleet), "--out", str(out)]
    arguments += ["--workers", "1"]  # a second would load all the libraries again, for a recording or two
    assert main(arguments) == 0
    assert "every figure was not compared: 2 machines could be used; to compare takes 5" in capsys.readouterr().out
    (fleet / "heater_2.csv").write_bytes((bench / "fleet" / "heater_3.csv").read_bytes())
    assert main(arguments) == 0 and "1 of 2 recordings" in capsys.readouterr().out
    (out / "machines" / "heater_1.csv.json").write_text("{")  # as if another program had written it
    assert main(arguments) == 0 and "1 of 2 recordings" in capsys.readouterr().out


def test_a_recording_that_cannot_be_used_stops_no_other(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet = tmp_path / "fleet"
    fleet.mkdir()
    (fleet / "good.csv").write_bytes((bench / "fleet" / "heater_1.csv").read_bytes())
    (fleet / "bad.csv").write_text("time_s,voltage_V,temperature_C\n0,1,2\n1,1\n2,1,2\n")
    arguments = ["diagnose", str(bench / "heater.toml"), "--fleet", str(fleet), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--workers", "1"]) == 0
    said = capsys.readouterr().out
    assert "not used: bad.csv: bad.csv" in said and "Traceback" not in said
    members = json.loads((tmp_path / "out" / "fleet.json").read_text())["members"]
    assert [(one["machine"], one["verdict"]) for one in members] == [("bad", "refused"), ("good", "no_mismatch")]
    (fleet / "good.csv").unlink()  # what looked at no machine has found none alike
    assert main([*arguments, "--workers", "1"]) == 2
    assert "none of its recordings could be used" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("fleet", "says"),
    [
        ("empty", "there is no recording"),
        ("nowhere/*.csv", "there is no recording"),
        ("twins", "a.npz is of machine a, and so is another file or folder there"),
    ],
)
def test_a_wrong_fleet_is_told(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], fleet: str, says: str
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "twins").mkdir()
    for name in ("a.csv", "a.npz"):
        (tmp_path / "twins" / name).touch()
    where = str(tmp_path / fleet)
    assert main(["diagnose", str(bench / "heater.toml"), "--fleet", where, "--out", str(tmp_path / "out")]) == 2
    assert says in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_workers_are_for_a_fleet(bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["diagnose", str(bench / "heater.toml"), "--out", str(tmp_path / "out"), "--workers", "2"]
    assert main(arguments) == 2 and "add --fleet DIR" in capsys.readouterr().err


@pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed: pip install 'firmloop[dask]'")
def test_two_workers_of_dask_say_the_same(bench: Path, tmp_path: Path) -> None:
    code = (
        "from distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        "    kept = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)\n"
        "    print(kept.scheduler_address, flush=True)\n"
        "    input()\n"
    )
    script = tmp_path / "cluster.py"
    script.write_text(code)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    cluster = subprocess.Popen([sys.executable, str(script)], **pipes, env=ENVIRONMENT, cwd=ROOT, text=True)
    try:
        assert cluster.stdout is not None
        address = cluster.stdout.readline().strip()
        arguments = ["diagnose", str(bench / "heater.toml"), "--fleet", str(bench / "fleet"), "--out"]
        assert main([*arguments, str(tmp_path / "out"), "--dask", address]) == 1
        assert results(tmp_path / "out") == results(bench / "out")
    finally:
        cluster.communicate("\n", timeout=60)


@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed: pip install 'firmloop[ray]'")
def test_ray_says_the_same(bench: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "firmloop", "diagnose", str(bench / "heater.toml"), "--fleet"]
    command += [str(bench / "fleet"), "--out", str(tmp_path), "--ray", "local"]
    assert subprocess.run(command, env=ENVIRONMENT, cwd=ROOT, check=False).returncode == 1
    assert results(tmp_path) == results(bench / "out")


@pytest.mark.parametrize(("library", "name"), [("distributed", "dask"), ("ray", "ray")])
def test_a_client_that_is_missing_is_named(
    bench: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    library: str,
    name: str,
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    arguments = [
        "diagnose",
        str(bench / "heater.toml"),
        "--fleet",
        str(bench / "fleet"),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*arguments, f"--{name}", "tcp://127.0.0.1:1"]) == 3
    assert f"pip install 'firmloop[{name}]'" in capsys.readouterr().err
