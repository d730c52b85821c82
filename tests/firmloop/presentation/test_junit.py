"""`firmloop verify --junit FILE`: what continuous integration shows is what the exit status says."""

from __future__ import annotations

import json
import xml.etree.ElementTree
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import pytest

from firmloop.cli import main
from tests.firmloop.conftest import PROJECT

CLAIMS = ["same bits as the reference", "no undefined behavior"]


def verified(project: Path, out: Path, *more: str) -> tuple[int, Element]:
    report = out / "ci" / "report.xml"
    arguments = ["verify", str(project), "--out", str(out), "--steps", "500", "--junit", str(report), *more]
    status = main(arguments)
    return status, xml.etree.ElementTree.parse(report).getroot()


def cases(report: Element, ended: str) -> Sequence[str]:
    return [case.attrib["name"] for case in report.iter("testcase") if case.find(ended) is not None]


def test_what_agrees_passes(project: Path, tmp_path: Path) -> None:
    status, report = verified(project, tmp_path)
    suite = report[0]
    assert status == 0 and (report.tag, suite.tag, suite.attrib["name"]) == ("testsuites", "testsuite", "tank_heater")
    assert [suite.attrib[key] for key in ("tests", "failures", "errors", "skipped")] == ["2", "0", "0", "0"]
    assert [case.attrib["name"] for case in suite] == CLAIMS
    assert {case.attrib["classname"] for case in suite} == {"tank_heater.host"}
    assert "0 differences: agrees" in (suite[0].findtext("system-out") or "")


def test_c_that_differs_fails(project: Path, tmp_path: Path, wrong_output: None) -> None:
    status, report = verified(project, tmp_path)
    assert status == 1 and report[0].attrib["failures"] == "1"
    assert cases(report, "failure") == CLAIMS[:1]


@pytest.mark.cross
@pytest.mark.qemu
def test_a_cost_that_grows_fails(project: Path, tmp_path: Path) -> None:
    target = ["--target", "qemu_mps2_an386"]
    verified(project, tmp_path / "old", *target)
    text = (tmp_path / "old" / "cost.json").read_text()
    small = json.loads(
        text, object_hook=lambda table: {**table, **({"text_bytes": 1} if "text_bytes" in table else {})}
    )
    (tmp_path / "small.json").write_text(json.dumps(small))
    status, report = verified(project, tmp_path / "new", *target, "--baseline", str(tmp_path / "small.json"))
    assert status == 1 and cases(report, "failure") and all("text" in name for name in cases(report, "failure"))


def test_what_was_not_run_is_an_error(project: Path, tmp_path: Path) -> None:
    project.write_text(PROJECT.replace('names = ["host"]', 'names = ["nucleo_f401re"]'))
    status, report = verified(project, tmp_path, "--port", str(tmp_path / "no_port"))
    assert status == 3 and report[0].attrib["errors"] != "0"
    assert cases(report, "error") == CLAIMS[:1]
    assert "not run: " in report[0][0][0].attrib["message"]


@pytest.mark.parametrize("option", ["--junit", "--sarif"])
def test_a_report_that_cannot_be_written_is_called_by_its_own_option(
    option: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "taken").touch()
    asked = ["verify", str(project), "--out", str(tmp_path / "out"), "--steps", "50", "--target", "host"]
    assert main([*asked, option, str(tmp_path / "taken" / "report")]) == 2
    assert f"firmloop: {option} {tmp_path / 'taken'}: is a file" in capsys.readouterr().err
