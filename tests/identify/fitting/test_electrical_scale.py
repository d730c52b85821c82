"""A voltage or current that is logged by a factor too large is told where no output can show it: in the parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmloop.identify.fitting.checks.electrical_scale import off_by, says, told_by_rows
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from tests.identify.fitting.test_three_phases import ROWS, H, log

VALUES = {"R_ohm": 0.36, "Ld_H": 0.2e-3, "Lq_H": 0.33e-3, "flux_Wb": 6.4e-3, "J_kg_m2": 4.8e-6, "b_N_m_s_rad": 1e-5}
AXES, BRIDGES = ("voltage_d_V", "voltage_q_V"), ("duty_a", "duty_b", "duty_c", "supply_V", "angle_rad")
OFF = dict(zip(VALUES, (1.09, 0.92, 0.95, 1.05, 0.9, 3.0), strict=True))  # what a data sheet is


def given(inputs: tuple[str, ...] = AXES) -> Plant:
    outputs = ["current_d_A", "current_q_A", "speed_rad_s"]
    values = {name: OFF[name] * value for name, value in VALUES.items()}
    return make_plant("pmsm", inputs, outputs, {**values, "pole_pairs": 4.0})


def found(voltage: float, current: float) -> dict[str, float]:
    """Return what a fit finds where voltages and currents are logged so many times too large."""
    powers = {"R_ohm": (1, -1), "Ld_H": (1, -1), "Lq_H": (1, -1), "flux_Wb": (1, 0)}
    return {
        name: VALUES[name] * voltage**v * current**i for name, v, i in ((n, *powers.get(n, (1, 1))) for n in VALUES)
    }


@pytest.mark.parametrize("factor", [0.1, 0.5, 1.5, 2.0, 1000.0])
def test_voltages_and_currents_that_are_off_are_told_by_what_the_parameters_share(factor: float) -> None:
    for index, quantity in enumerate(("voltage", "current")):
        seen = off_by(given(), found(*((factor, 1.0) if index == 0 else (1.0, factor))))
        assert seen is not None and seen[0] == quantity
        assert abs(math.log(seen[1] / factor)) < 0.1


@pytest.mark.parametrize("phases", [False, True])
def test_the_rows_tell_the_parameters_before_any_fit(phases: bool) -> None:
    left = ("d_A", "q_A", "c_A") if phases else ("a_A", "b_A", "c_A")
    columns = {name: value for name, value in log(4).items() if name[8:] not in left}
    recording = make_recording(np.arange(ROWS) * H, columns, "log.csv", "")
    told = told_by_rows(given(), [recording])
    assert {name: told[name] / VALUES[name] for name in told} == pytest.approx(
        dict.fromkeys(("R_ohm", "Ld_H", "Lq_H", "flux_Wb", "J_kg_m2"), 1.0), rel=0.05
    )
    still = make_recording(np.arange(ROWS) * H, {**columns, "speed_rad_s": np.zeros(ROWS)}, "log.csv", "")
    far = make_recording(np.arange(ROWS) * H, {**columns, "position_rad": 57.3 * columns["position_rad"]}, "", "")
    assert told_by_rows(given(), [still]) == {}
    assert not phases or "J_kg_m2" not in told_by_rows(given(), [far])  # in a frame that is none


def test_a_data_sheet_that_is_off_is_no_supply() -> None:
    assert off_by(given(), found(1.0, 1.0)) is None
    for name in ("R_ohm", "flux_Wb", "J_kg_m2"):
        assert off_by(given(), {**found(1.0, 1.0), name: 3.0 * VALUES[name]}) is None
    assert off_by(given(), {name: value for name, value in found(2.0, 1.0).items() if name != "J_kg_m2"}) is None


def test_what_says_it_names_the_columns_the_factor_and_the_line() -> None:
    assert "voltage_d_V and voltage_q_V look about 2 times too large" in says(given(), "voltage", 2.0)
    assert "supply_V looks about 1000 times too large (in thousandths of" in says(given(BRIDGES), "voltage", 1000.0)
    assert 'supply_V = { name = "supply_V", scale = 0.001 }' in says(given(BRIDGES), "voltage", 1000.0)
    told = says(given(), "current", 0.25)
    assert "current_d_A and current_q_A look about 0.25 times" in told
    assert "J_kg_m2 0.25 times and R_ohm, Ld_H, Lq_H 4 times" in told
