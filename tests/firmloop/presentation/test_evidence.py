"""`firmloop run --evidence DIR`: what is required rests on what was judged, and a second run names what differs."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main
from tests.firmloop.conftest import PROJECT

FIXED = PROJECT.replace('number = "float32"', 'number = "fixed"\nbits = 32\nmax_error_V = 0.01').replace(
    "ki = 0.5", "ki = 0.5\nu_max = 7.3"
)


@pytest.fixture(autouse=True, scope="module")
def without_cppcheck() -> Iterator[None]:
    """The same evidence on every machine that runs this."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shutil, "which", lambda name, found=shutil.which: None if name == "cppcheck" else found(name))
        yield


@pytest.fixture(scope="module")
def floating(tmp_path_factory: pytest.TempPathFactory, recorded_files: dict[str, str]) -> Path:
    """A project in floating point that was walked once, with its evidence in the folder `filed`."""
    folder = tmp_path_factory.mktemp("floating")
    for name, text in recorded_files.items():
        (folder / name).write_text(text)
    project = folder / "tank_heater.toml"
    project.write_text(PROJECT)
    assert walked(project)[0] == 0
    return project


def walked(project: Path, *more: str) -> tuple[int, dict[str, Any]]:
    out, place = project.parent / "out", project.parent / "filed"
    arguments = ["run", str(project), "--out", str(out), "--steps", "500", "--evidence", str(place), *more]
    return main(arguments), filed(project)


def filed(project: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((project.parent / "filed" / "evidence.json").read_text())
    return found


def test_every_requirement_rests_on_claims(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project.write_text(FIXED)
    status, found = walked(project)
    assert status == 0
    asked, claims = found["requirements"], found["claims"]
    assert asked["signals.output"]["says"] == "output output stays from -12 to 12 V"
    assert asked["signals.output"]["claims"][:2] == ["ranges: intervals", "ranges: z3"]
    assert claims["ranges: z3"]["result"] == "proven" and claims["ranges: z3"]["version"]
    assert asked["controller.u_max"] == {
        "says": "output output is at most 7.3 V",
        "status": "met",
        "claims": asked["signals.output"]["claims"],
    }
    assert asked["arithmetic.max_error_V: output"]["status"] == "met"
    assert claims["same bits: host"]["result"] == "agrees" and "differences" in claims["same bits: host"]["detail"]
    named = {name for one in asked.values() for name in one["claims"]}
    assert named <= set(claims)
    assert {key for key, one in asked.items() if one["status"] != "met"} == {"C: MISRA"}
    assert "signals.reference" in found["assumptions"] and found["misra"]["deviations"]["10.1"]["reason"]
    assert found["misra"]["deviations"]["10.1"]["hits"] is None
    said = capsys.readouterr().out
    assert "open: C: MISRA" in said and "filed/evidence.html" in said
    page = (project.parent / "filed" / "evidence.html").read_text()
    assert "SHA-256" in page and str(project.parent) not in page and "max_error_V" in page


def test_hashes_are_those_of_the_files(floating: Path) -> None:
    found, folder = filed(floating), floating.parent
    assert len(found["files"]) > 5
    for name, digest in found["files"].items():
        assert hashlib.sha256((folder / "out" / name).read_bytes()).hexdigest() == digest, name
    assert found["spdx"]["sha256"] == found["files"][found["spdx"]["file"]]
    recorded = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.csv")}
    assert found["recordings"] == recorded


def test_floating_point_claims_no_range(floating: Path) -> None:
    found = filed(floating)
    assert found["requirements"]["signals.output"]["status"] == "open"
    assert found["claims"]["ranges: intervals"]["result"] == "unknown"


def test_a_second_run_names_what_differs_and_keeps_what_is_filed(
    floating: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = floating.parent / "filed"
    first = {path.name: path.read_bytes() for path in place.iterdir()}
    assert set(first) == {"evidence.json", "evidence.html"}
    changed = PROJECT.replace("ki = 0.5", "ki = 0.6").replace("low = -12, high = 12", "low = -10, high = 12")
    floating.write_text(changed)
    status, kept = walked(floating, "--seed", "2")
    said = capsys.readouterr().out
    assert status == 1 and kept == json.loads(first["evidence.json"])
    assert "requirements / signals.output / says: output output stays from -12 to 12 V -> output" in said
    assert "program / id: " in said and "project / sha256: " in said and "seed 1" in said and "seed 2" in said
    assert {path.name for path in place.iterdir()} == {*first, "evidence_new.json", "evidence_new.html"}
    floating.write_text(PROJECT)
    status, _ = walked(floating)
    assert status == 0 and {path.name: path.read_bytes() for path in place.iterdir()} == first
    assert "it is what was filed there before" in capsys.readouterr().out


def test_what_is_no_evidence_is_refused_before_anything_runs(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = project.parent / "filed"
    place.mkdir()
    (place / "evidence.json").write_text("[]")
    assert main(["run", str(project), "--out", str(project.parent / "out"), "--evidence", str(place)]) == 2
    assert "is no evidence that this firmloop reads; move it away" in capsys.readouterr().err
    assert not (project.parent / "out").exists()
