"""A duty that stands in a column of volts is asked for, where the speed alone is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.diagnose.cases import MOTOR_PROJECT, Motor

FAN = Motor(2.0, 1e-3, 0.05, 1e-4, 1e-4)


@pytest.mark.parametrize(("supply", "also"), [(24.0, "encoder"), (48.0, "encoder"), (9.5, "")])
def test_a_duty_of_1_is_asked_for_with_the_volts_of_the_supply(
    supply: float, also: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """9.5 V are near 60/(2 pi), so that revolutions per minute are as likely, and both are said."""
    random = np.random.default_rng(4)
    duty, speed, current, rows = np.repeat(random.uniform(0.0, 1.0, 20), 100), 0.0, 0.0, []
    for k, share in enumerate(duty):
        rows.append(f"{0.001 * k:.3f},{share:.5f},{speed + 0.1 * random.normal():.4f}")
        for _ in range(20):
            current += 5e-5 * (supply * share - 2.0 * current - 0.05 * speed) / 1e-3
            speed += 5e-5 * (0.05 * current - 1e-4 * speed) / 1e-4
    (tmp_path / "log.csv").write_text("\n".join(["time_s,voltage_V,speed_rad_s", *rows, ""]))
    (tmp_path / "p.toml").write_text(MOTOR_PROJECT.format(FAN, FAN.constant, FAN.inertia, FAN.friction))
    main(["identify", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")])
    said = "".join(capsys.readouterr())
    assert "is voltage_V, which never goes beyond 1, a share of the supply" in said
    assert f"scale = {float(f'{supply:.2g}'):g}" in said.replace(".0 }", " }")
    assert ("in revolutions per minute" in said) is not bool(also) and "encoder" not in said
