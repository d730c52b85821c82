"""`firmloop tune` compares the rules that the project asks for, and says which do not fit."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from firmloop.cli import main


def test_tune_leaves_a_table(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project.write_text(
        project.read_text().replace("delay_s = { value = 0.0", "delay_s = { value = 0.3")
        + '\n[tuning]\nrules = ["simc", "amigo", "lqr"]\n[tuning.simc]\ntau_c_s = 0.7\n[tuning.lqr]\nterms = "pid"\n'
    )
    assert main(["tune", str(project), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "simc" in said and "amigo" in said and "not for this plant" in said and "single lag" in said
    with (tmp_path / "out" / "tuning.csv").open() as stream:
        rows = {row["rule"]: row for row in csv.DictReader(stream)}
    assert list(rows) == ["simc", "amigo", "lqr"]
    theta = 0.3 + 0.025
    assert float(rows["simc"]["kp"]) == pytest.approx(1.0 / (0.7 + theta))
    assert 1.2 < float(rows["amigo"]["ms"]) < 1.6
    document = json.loads((tmp_path / "out" / "tuning.json").read_text())
    assert document["rules"][0]["margins"]["stable"] is True


@pytest.mark.parametrize(
    ("added", "words"),
    [
        ('[tuning]\nrules = ["zigler"]\n', "no tuning rule"),
        ("[tuning.simc]\ntau = 1\n", "did you mean 'tau_c_s'"),
        ("[tuning.simc]\ntau_c_s = -1\n", "above 0"),
        ('[tuning]\nrule = ["simc"]\n', "did you mean 'rules'"),
    ],
)
def test_tune_refuses(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], added: str, words: str
) -> None:
    project.write_text(project.read_text() + "\n" + added)
    assert main(["tune", str(project), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_design_takes_every_rule_by_its_name(project: Path, tmp_path: Path) -> None:
    text = project.read_text().replace("kp = 0.8\nki = 0.5", 'tune = "amigo"')
    project.write_text(text)
    assert main(["design", str(project), "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "design.json").read_text())["tuned_by"] == "amigo"


def test_a_schedule_tells_its_margins_at_each_point(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SIMC answers a plant of twice the gain by half the gain: the same margins, which no other pairing has."""
    points = 'points = [{ at = 0, tune = "simc" }, { at = 9, tune = "simc", plant = { gain = 2.0 } }]'
    text = project.read_text().replace('kind = "pid"', 'kind = "gain_schedule"\nschedule_on = "level"')
    text = text.replace("kp = 0.8\nki = 0.5\n", points + "\n")
    project.write_text(text.replace("output = {", 'level = { unit = "m", low = 0, high = 9 }\noutput = {'))
    assert main(["design", str(project), "--out", str(tmp_path / "out")]) == 0
    assert "at each operating point" in capsys.readouterr().out
    first, second = json.loads((tmp_path / "out" / "design.json").read_text())["operating_points"]
    assert (first["at"], second["at"]) == ("level 0 m", "level 9 m")
    assert first["phase_margin_deg"] == pytest.approx(second["phase_margin_deg"])
    assert main(["tune", str(project), "--out", str(tmp_path / "tuned")]) == 2
    assert "take kind = " in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["design", "generate"])
def test_a_key_of_the_rule_that_only_tune_reads_is_not_passed_over(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    """The loop would be tuned by the rule's default, beside a table that holds the same rule as it was asked for."""
    rule = '\n[tuning.pole_placement]\nnatural_frequency_rad_s = 3.0\nterms = "pi"\n'
    project.write_text(project.read_text().replace("kp = 0.8\nki = 0.5", 'tune = "pole_placement"') + rule)
    assert main([verb, str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "[tuning.pole_placement] natural_frequency_rad_s = 3.0" in said and "in [controller], too" in said


@pytest.mark.parametrize(("kp", "unstable"), [(0.8, False), (400.0, True)])
def test_generate_tells_of_a_loop_that_is_unstable_around_the_plant(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kp: float, unstable: bool
) -> None:
    text = project.read_text().replace("delay_s = { value = 0.0", "delay_s = { value = 0.3")
    project.write_text(text.replace("kp = 0.8", f"kp = {kp}"))
    assert main(["generate", str(project), "--out", str(tmp_path / "out")]) == 0
    assert ("around [plant] is UNSTABLE" in capsys.readouterr().out) is unstable
