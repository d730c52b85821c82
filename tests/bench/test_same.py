"""Circumstances of the diagnosis benchmark change what they say and nothing else."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

from bench.diagnose import nulls, simulated
from bench.diagnose.same import (
    compared,
    copied,
    difference,
    with_columns_turned,
    with_lines_turned,
    with_tests_turned,
    without_tests,
)
from firmloop.identify.recordings.recording import read_recording


def test_changed_projects_say_the_same(tmp_path: Path) -> None:
    simulated.write(2, "null", 2, tmp_path / "case")
    before = tomllib.loads((tmp_path / "case" / "project.toml").read_text(encoding="utf-8"))
    turned = copied(tmp_path / "case", tmp_path / "turned")
    text = turned.read_text(encoding="utf-8")
    with_lines_turned(turned)
    assert tomllib.loads(turned.read_text(encoding="utf-8")) == before
    assert turned.read_text(encoding="utf-8") != text
    with_tests_turned(turned)
    after = tomllib.loads(turned.read_text(encoding="utf-8"))["recordings"]["test"]
    assert after == before["recordings"]["test"][::-1]
    without_tests(turned)
    assert "test" not in tomllib.loads(turned.read_text(encoding="utf-8"))["recordings"]
    with_columns_turned(turned)
    one, two = (read_recording(tmp_path / name / "train_1.csv", {}) for name in ("case", "turned"))
    assert list(one.columns) != list(two.columns)
    assert all((two.columns[name] == column).all() for name, column in one.columns.items())


def test_a_difference_is_named() -> None:
    def written(**changed: object) -> dict[str, str]:
        found = {"verdict": "explained", "fit": {"train": 1, "test": 2}, "simulation_rms": {}, **changed}
        return {"diagnosis.json": json.dumps(found), "project.toml": "[plant]\nkind = 'dc_motor'\n"}

    assert difference(written(), written(), True) == ""
    assert difference(written(), written(fit={"train": 1}), True) == "diagnosis.json"
    assert difference(written(), written(fit={"train": 1}), False) == ""
    assert difference(written(), written(verdict="ambiguous"), False) == "verdict"
    assert difference(written(), {"status": 2}, False) == "another end"


def test_half_the_speed_leads_to_the_same_bytes(tmp_path: Path) -> None:
    nulls.write(6, tmp_path / "case")
    assert compared(tmp_path / "case", tmp_path, ["at half speed"]) == {"at half speed": ""}
