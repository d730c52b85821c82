"""What `[plant]` lacks is told with an example that its kind can be driven by."""

from __future__ import annotations

from pathlib import Path

import pytest

from firmloop.cli import main

PROJECT = 'schema = 1\nname = "axis"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "{}"\n{}\n'


@pytest.mark.parametrize(
    ("kind", "line", "example"),
    [
        ("pmsm", 'outputs = ["speed_rad_s"]', 'inputs = ["voltage_d_V", "voltage_q_V"]'),
        ("linear_stage", 'outputs = ["speed_m_s"]', 'input = "force_N"'),
        ("three_phase_induction_motor", 'outputs = ["speed_rad_s"]', 'input = "voltage_rms_V"'),
        ("linear_stage", 'input = "force_N"', 'outputs = ["position_m"]'),
        ("first_order", 'outputs = ["temperature_C"]', 'input = "voltage_V"'),
    ],
)
def test_what_is_missing_is_shown_as_the_kind_takes_it(
    kind: str, line: str, example: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(PROJECT.format(kind, line))
    (tmp_path / "log.csv").write_text("time_s,a\n0,1\n")
    assert main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    key = example.partition(" ")[0]
    assert f"[plant] '{key}' is missing; write for instance: {example}\n" in capsys.readouterr().err
