"""What a project conditions is done, not needed, or refused; never passed over in silence."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.diagnose.data.conditioned import as_conditioned
from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.conditioning import NONE, Conditioning
from firmloop.identify.recordings.recording import Recording, make_recording
from tests.sizes import motor

TIME = np.arange(400) * 1e-3
PLANT = motor("speed_rad_s", "current_A")


def recording() -> Recording:
    columns = {"voltage_V": 2.0 + np.sin(20.0 * TIME), "speed_rad_s": TIME, "current_A": TIME}
    return make_recording(TIME, columns, "a.csv", "")


def test_an_input_loses_its_offset_and_an_output_keeps_its_own() -> None:
    (made,), notes = as_conditioned(PLANT, [recording()], Conditioning(remove_offset=("voltage_V",)))
    assert abs(float(made.columns["voltage_V"].mean())) < 1e-12
    np.testing.assert_array_equal(made.columns["speed_rad_s"], TIME)
    assert notes == ()
    (same,), _ = as_conditioned(PLANT, [recording()], NONE)
    np.testing.assert_array_equal(same.columns["voltage_V"], recording().columns["voltage_V"])


def test_what_is_not_needed_is_told() -> None:
    _, notes = as_conditioned(PLANT, [recording()], Conditioning(window_s=0.2, savgol_window=5))
    assert notes == (
        "recordings.conditioning.window_s, savgol_window not used: the search has a noise model of its own",
    )


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (Conditioning(detrend=("speed_rad_s",)), "detrend = ['speed_rad_s']"),
        (Conditioning(align=("current_A",), align_max_lag_s=0.01), "align = ['current_A']"),
        (Conditioning(line_Hz=50.0), "line_Hz = 50"),
        (Conditioning(remove_offset=("speed_rad_s",)), "remove_offset = ['speed_rad_s']"),
        (Conditioning(remove_offset=("torque_N_m",)), "torque_N_m is no signal of the plant"),
    ],
)
def test_what_would_hide_a_mismatch_is_refused(asked: Conditioning, words: str) -> None:
    with pytest.raises(IdentifyError) as caught:
        as_conditioned(PLANT, [recording()], asked)
    assert words in str(caught.value)
