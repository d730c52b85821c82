"""Every excitation stays within its range and has the spectrum it is made for."""

from __future__ import annotations

import numpy as np
import pytest

from firmloop.identify.bench_tests.excitations import excitation, excitations
from firmloop.identify.bench_tests.excitations.prbs import TAPS, sequence
from firmloop.identify.error import IdentifyError

TABLE = {"low": -6.0, "high": 4.0, "period_s": 0.001, "duration_s": 2.0}


@pytest.mark.parametrize("name", excitations())
def test_within_its_range_and_as_long_as_asked(name):
    time, values = excitation({"signal": name, **TABLE})
    assert len(time) == len(values) == 2000
    assert np.all((values >= -6.0) & (values <= 4.0)) and np.ptp(values) > 8.0
    assert np.diff(time) == pytest.approx(0.001)
    again, repeated = excitation({"signal": name, **TABLE, "repeats": 3, "rest_s": 0.5})
    assert len(again) == 3 * 2500 and np.all(repeated[:500] == 0.0)
    assert np.array_equal(repeated[500:2500], values) and np.array_equal(repeated[5500:], values)


@pytest.mark.parametrize("order", TAPS)
def test_a_binary_sequence_has_maximum_length(order):
    """Its autocorrelation has two values only: the length, and -1."""
    bits = 2 * sequence(order) - 1
    spectrum = np.abs(np.fft.fft(bits)) ** 2
    own = np.round(np.real(np.fft.ifft(spectrum)))
    assert own[0] == len(bits) == 2**order - 1 and np.all(own[1:] == -1)


def test_a_multisine_has_its_lines_and_no_others():
    _, values = excitation({"signal": "multisine", **TABLE, "low_Hz": 1.0, "high_Hz": 100.0, "lines": 12})
    power = np.abs(np.fft.rfft(values - values.mean())) ** 2
    lines = np.flatnonzero(power > 1e-9 * power.max())
    assert 10 <= len(lines) <= 12 and lines[0] == 2 and lines[-1] == 200
    assert power[lines].max() == pytest.approx(power[lines].min(), rel=1e-6)
    crest = np.abs(values - (-1.0)).max() / np.std(values)
    assert crest < 2.5  # random phases give 3 and more


def test_ramps_cross_zero_with_one_slope():
    _, values = excitation({"signal": "ramps", **TABLE, "cycles": 2})
    crossings = np.flatnonzero(np.sign(values[1:-1]) * np.sign(values[2:]) < 0)
    assert len(crossings) + np.sum(values[1:-1] == 0) >= 3
    slopes = np.abs(np.diff(values))
    assert np.median(slopes) == pytest.approx(20.0 / 1000)
    assert np.sum(np.abs(slopes - np.median(slopes)) > 1e-9) <= 5


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"signal": "noise"}, "known: chirp, multisine, prbs"),
        ({"low": 5.0}, "low must be below high"),
        ({"period_s": -1}, "above 0"),
        ({"duration_s": 0.002}, "at least 8"),
        ({"order": 99}, "from 3 to 16"),
        ({"clock_s": 1e-5}, "below period_s"),
        ({"cycles": 3}, "unknown to signal = 'prbs'"),
        ({"signal": "ramps", "low": 1.0}, "go through zero"),
        ({"signal": "chirp", "high_Hz": 900.0}, "half the sampling rate"),
        ({"signal": "multisine", "low_Hz": 0.1}, "one cycle"),
    ],
)
def test_wrong_tables_are_said(changed, words):
    with pytest.raises(IdentifyError, match=words):
        excitation({"signal": "prbs", **TABLE, **changed})
