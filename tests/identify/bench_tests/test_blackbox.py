"""Black-box models find a known plant again, agree with a fit of its physics, and say their limits."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

from firmloop.identify.bench_tests.blackbox import (
    Record,
    SampledModel,
    check_records,
    continuous,
    fit_arx,
    fit_n4sid,
    fit_oe,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording

PERIOD = 0.02
W, ZETA, GAIN = 6.0, 0.5, 2.0
(ABOVE,), BELOW, _ = scipy.signal.cont2discrete(([GAIN * W**2], [1, 2 * ZETA * W, W**2]), PERIOD)


def record(seed: int, noise: float, rows: int = 1200, late: int = 0) -> Record:
    random = np.random.default_rng(seed)
    drive = np.repeat(random.choice([-3.0, 3.0], rows // 8 + 1), 8)[:rows]
    output = scipy.signal.lfilter(np.concatenate([np.zeros(late), ABOVE]), BELOW, drive)
    return Record(f"run{seed}", drive, output + noise * random.standard_normal(rows))


def figures(model: SampledModel) -> tuple[float, float, float]:
    """Natural frequency, damping, gain."""
    made = continuous(model, PERIOD)
    poles = np.linalg.eigvals(made.a)
    natural = float(np.sqrt(np.real(np.prod(poles))))
    gain = float(-made.c @ np.linalg.solve(made.a, made.b))
    return natural, float(-np.real(poles[0])) / natural, gain


@pytest.mark.parametrize("method", [fit_arx, fit_oe, fit_n4sid])
@pytest.mark.parametrize("late", [0, 3])
def test_clean_data_give_the_plant_back(method, late):
    found = method([record(1, 0.0, late=late)], 2, late)
    assert figures(found) == pytest.approx((W, ZETA, GAIN), rel=1e-4)
    assert continuous(found, PERIOD).delay == pytest.approx(late * PERIOD)


def test_output_error_agrees_with_the_physical_fit_and_the_library():
    """Three ways to one plant: within two intervals of the fit of a second-order lag."""
    one = record(2, 0.1)
    columns = {"voltage_V": one.drive, "speed_rad_s": one.output}
    recording = make_recording(np.arange(len(one.drive)) * PERIOD, columns, "run", "")
    table = {
        "gain": 1.0,
        "natural_frequency_rad_s": 5.0,
        "damping_ratio": 0.7,
        "delay_s": {"value": 0.0, "free": False},
    }
    told = fit(make_plant("second_order", "voltage_V", ["speed_rad_s"], table), [recording], [], NONE)
    natural, damping, gain = figures(fit_oe([one], 2, 0))
    ours = {"gain": gain, "natural_frequency_rad_s": natural, "damping_ratio": damping}
    library = dict(
        zip(("natural_frequency_rad_s", "damping_ratio", "gain"), figures(fit_n4sid([one], 2, 0)), strict=True)
    )
    for parameter in told.plant.parameters[:3]:
        low, high = parameter.interval_95
        assert low <= ours[parameter.name] <= high, parameter.name
        assert library[parameter.name] == pytest.approx(parameter.value, rel=0.1), parameter.name


def test_output_error_takes_several_recordings_with_starts_of_their_own():
    records = [
        record(3, 0.05),
        Record("late", *(part[400:] for part in (record(4, 0.05).drive, record(4, 0.05).output))),
    ]
    assert figures(fit_oe(records, 2, 0)) == pytest.approx((W, ZETA, GAIN), rel=0.01)


def test_too_short_and_too_poor_recordings_are_refused():
    with pytest.raises(IdentifyError, match="60 rows are too few for a model of order 4"):
        check_records([record(1, 0.0, rows=60)], 4, 0)
    steady = Record("still", np.full(500, 2.0), np.ones(500))
    with pytest.raises(IdentifyError, match=r"excites 1 directions.*order 3"):
        check_records([steady], 3, 0)


@pytest.mark.parametrize(("pole", "words"), [(1.01, "unstable"), (1 + 1e-9, r"1 \+ 1e-09 in z"), (-0.5, "no")])
def test_a_model_that_no_plant_has_is_refused(pole, words):
    with pytest.raises(IdentifyError, match=words):
        continuous(SampledModel(np.array([[pole]]), np.ones(1), np.ones(1), 0), PERIOD)
