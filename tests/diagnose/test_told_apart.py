"""Effects that were mistaken for one another, or that took another along, by the seed of their case."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.blind_cases import draw_case, write_case
from firmloop.cli import main


@pytest.mark.parametrize(
    ("seed", "verdict", "names"),
    [
        pytest.param(170029, "explained", {"load_torque"}, id="a load from the first row on is no step"),
        pytest.param(180020, "explained", {"end_stop"}, id="a stop is looked for where a recorded speed leads"),
        pytest.param(240033, "explained", {"coulomb_friction"}, id="a peak at rest that train does not show"),
        pytest.param(
            250070, "explained", {"sensor_offset"}, id="a constant that noise follows", marks=pytest.mark.slow
        ),
        pytest.param(230062, "unknown_physics", set(), id="two names for one shape", marks=pytest.mark.slow),
        pytest.param(
            240044,
            "explained",
            {"eccentric_encoder", "presliding_friction"},
            id="an angle that holds the error of its encoder",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            260033,
            "explained",
            {"clock_skew", "sensor_offset"},
            id="one output that is missed far less",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            260083,
            "explained",
            {"load_torque", "sensor_wrap"},
            id="a range that a load had bent",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            180006,
            "ambiguous",
            {"input_delay", "sensor_delay", "sensor_lag"},
            id="a fifth of a row late, far below the noise",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            180039, "explained", {"backlash"}, id="a clock that a bad fit asked for", marks=pytest.mark.slow
        ),
        pytest.param(
            190031,
            "explained",
            {"hardening_spring", "input_saturation"},
            id="what a polished simulation does without",
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_what_is_named(seed: int, verdict: str, names: set[str], tmp_path: Path) -> None:
    write_case(draw_case(seed), tmp_path / "case", tmp_path / "labels")
    assert main(["diagnose", str(tmp_path / "case" / "project.toml"), "--out", str(tmp_path / "out")]) == 1
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (said["verdict"], {each["name"] for each in said["effects"]}) == (verdict, names)
