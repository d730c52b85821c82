"""An angle whose reading wraps at a turn is told with the key that unrolls it; what only moves quickly is not."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest

from firmloop.identify.fitting.checks.wrapped import look
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import conditioning_from_table
from firmloop.identify.recordings.recording import Recording

TIME = np.arange(2000) * 1e-3
ANGLE = 9.0 * np.sin(2.0 * TIME) + 0.002 * np.random.default_rng(1).normal(size=len(TIME))
VALUES = {"J_kg_m2": 0.01, "b_N_m_s_rad": 0.1, "torque_per_unit": 1.0}


def said(angle: np.ndarray, time: np.ndarray = TIME) -> tuple[str, ...]:
    columns = {"voltage_V": np.sign(np.sin(9.0 * time)), "position_rad": angle}
    plant = make_plant("rotary_stage", "voltage_V", ["position_rad"], VALUES)
    recording = Recording(time, MappingProxyType(columns), (), "log.csv", "")
    return look(Evidence(plant, (recording,), conditioning_from_table({}), None))


@pytest.mark.parametrize("lowest", [0.0, -np.pi, 1.0])
def test_an_angle_within_one_turn_is_said_to_wrap(lowest: float) -> None:
    (sentence,) = said(lowest + (ANGLE - lowest) % (2.0 * np.pi))
    assert "position_rad of log.csv leaps by a whole turn" in sentence and "wraps = 360" in sentence


def test_where_rows_are_missing_it_may_have_gone_anywhere() -> None:
    kept = np.flatnonzero((TIME % 0.5) < 0.35)
    (sentence,) = said(ANGLE[kept] % (2.0 * np.pi), TIME[kept])
    assert "wraps = 360" in sentence


@pytest.mark.parametrize("angle", [ANGLE, 3.0 * np.sign(ANGLE), np.round(ANGLE), 0.0 * TIME])
def test_an_angle_that_goes_on_or_leaps_otherwise_is_met_with_silence(angle: np.ndarray) -> None:
    assert said(angle) == ()


COUNTS = np.round(ANGLE / (2.0 * np.pi) * 1000.0)


@pytest.mark.parametrize(
    ("reading", "line"),
    [
        (np.degrees(ANGLE) % 360.0, 'unit = "deg", wraps = 360 }'),
        ((ANGLE / (2.0 * np.pi)) % 1.0, 'unit = "rev", wraps = 1 }'),
        (COUNTS % 1000, "scale = 0.006283185307, wraps = 1000 }"),
        (COUNTS % 256, "scale = 0.02454369261, wraps = 256 }"),
        ((COUNTS + 512) % 1024 - 512, "scale = 0.006135923152, wraps = 1024 }"),
    ],
)
def test_an_angle_that_wraps_at_no_turn_in_rad_is_said_in_its_unit(reading: np.ndarray, line: str) -> None:
    (sentence,) = said(reading)
    assert f'position_rad = {{ name = "position_rad", {line}' in sentence
    assert "at no turn in rad" in sentence


def test_a_reading_that_wraps_elsewhere_is_told_by_how_much() -> None:
    (sentence,) = said(ANGLE % 2.5)
    assert "leaps by 2.49817 from" in sentence and "counts" not in sentence
