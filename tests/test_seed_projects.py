"""The two motor studies as projects: one command each from recordings to C that agrees, and what the tables say."""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from examples.baldor_l3510 import bench as l3510
from examples.baldor_l3510 import walk
from examples.maxon_re15 import bench as re15
from examples.maxon_re15 import compare
from examples.maxon_re15.controllers import contestants
from firmloop.cli import main

EXAMPLES = Path(__file__).parents[1] / "examples"
PROJECTS = ("maxon_re15/re15", "maxon_re15/re15_first_order", "baldor_l3510/l3510_g1", "baldor_l3510/l3510_g2")

EMULATED = ("maxon_re15/re15", "baldor_l3510/l3510_g2")


def figures_in(row: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", row.replace(",", ""))]


def shown(folder: str, name: str) -> list[float]:
    """Return the figures of the row of that name in a README's table."""
    (row,) = [
        line for line in (EXAMPLES / folder / "README.md").read_text().splitlines() if line.startswith(f"| {name} |")
    ]
    return figures_in(row)


def ran(project: str, out: Path, *more: str) -> dict[str, object]:
    name = project.partition("/")[2]
    assert main(["run", str(EXAMPLES / f"{project}.toml"), "--out", str(out), "--steps", "2000", *more]) == 0
    assert (out / name / "src" / f"{name}.c").is_file() and (out / "report.html").is_file()
    verdict = json.loads((out / "verdict.json").read_text())
    assert verdict["verdict"] == "agrees" and verdict["differences"] == 0
    return dict(tomllib.loads((out / "project.toml").read_text()))


@pytest.mark.parametrize("project", PROJECTS)
def test_a_study_runs_from_its_recordings_to_c_that_agrees(project: str, tmp_path: Path) -> None:
    """On this machine, and of one project of each study on the emulated microcontroller as well, where there is one."""
    emulated = project in EMULATED and all(shutil.which(tool) for tool in ("arm-none-eabi-gcc", "qemu-system-arm"))
    ran(project, tmp_path, *(() if emulated else ("--target", "host")))
    if emulated:
        assert json.loads((tmp_path / "verdict_qemu_mps2_an386.json").read_text())["verdict"] == "agrees"


def test_the_tests_find_the_motor_that_stood_on_the_bench(tmp_path: Path) -> None:
    assert main(["datasheet", str(EXAMPLES / "maxon_re15" / "re15.toml"), "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "datasheet.json").read_text())["parameters"]
    truth = {"R_ohm": re15.R, "L_H": re15.L, "ke_V_s_rad": re15.K, "b_N_m_s_rad": re15.B, "J_kg_m2": re15.J}
    for name, value in truth.items():
        assert found[name]["value"] == pytest.approx(value, rel=0.01)
        assert found[name]["origin"].endswith(" test")


@pytest.mark.parametrize(("folder", "bench"), [("maxon_re15", re15), ("baldor_l3510", l3510)])
def test_the_recordings_are_what_the_bench_makes(folder: str, bench: object) -> None:
    made = bench.files()  # type: ignore[attr-defined]
    assert {path.name for path in (EXAMPLES / folder).glob("*.csv")} == set(made)
    for name, text in made.items():
        kept = np.loadtxt(EXAMPLES / folder / name, delimiter=",", skiprows=1)
        now = np.loadtxt(text.splitlines(), delimiter=",", skiprows=1)
        assert kept == pytest.approx(now, abs=0.26)  # a count of the converter, where another libm rounds another way


def test_the_readings_in_the_project_are_those_of_the_bench() -> None:
    project = tomllib.loads((EXAMPLES / "maxon_re15" / "re15.toml").read_text())
    for name, columns in re15.readings(np.random.default_rng(re15.SEED + 1)).items():
        for key, values in columns.items():
            assert project["standard_tests"][name][key] == pytest.approx(values, rel=1e-3)


def test_every_controller_holds_the_speed_and_meets_the_load() -> None:
    """Those with a speed sensor leave no error; the one without is off by what the assumed figures of the motor are."""
    found = {one.name: compare.figures(compare.course(compare.of(one))) for one in contestants()}
    assert {"fuzzy PID", "gain schedule", "self-tuning", "PI, sensorless", "MPC, float32"} < set(found)
    for name, one in found.items():
        assert one.overshoot < 15 and one.error < (2.5 if name == "PI, sensorless" else 0.2), name
        assert one.load_ise < 30, name
        printed = figures_in(compare.line(name, one, "-"))
        assert shown("maxon_re15", name)[: len(printed)] == pytest.approx(printed, rel=0.05, abs=0.05), name
    assert found["PI, least ISE"].overshoot < found["PI, Ziegler-Nichols"].overshoot
    open_loops = [one for name, one in compare.open_and_closed() if name.startswith("open")]
    assert all(one.load_ise > 100 * found["PI, least ISE"].load_ise for one in open_loops)


def test_the_table_has_a_row_for_each_controller(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = contestants()[:2]
    monkeypatch.setattr(compare, "contestants", lambda: chosen)
    rows = [line for line in compare.table(lambda one: "17").splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[0][2:] for row in rows[-2:]] == [one.name for one in chosen]
    assert all(row.endswith("| 17 |") for row in rows[-2:])
    assert len({row.count("|") for row in rows}) == 1


def test_the_monitor_finds_each_capacitor() -> None:
    rows = [line for line in walk.table().splitlines() if " uF |" in line]
    pairs = [tuple(float(x) for x in re.findall(r"(\d+) uF", row)) for row in rows]
    assert len(pairs) == len(walk.SHARES)
    assert all(found == pytest.approx(true, rel=0.03) for true, found in pairs)
    for row in rows:
        name = row.split(" | ")[0][2:]
        assert shown("baldor_l3510", name) == pytest.approx(figures_in(row), rel=0.05, abs=0.05)
    assert "| no |" in rows[0] and all("| low |" in row for row in rows[2:])
