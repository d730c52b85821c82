"""What a term without a name may follow: each coordinate is what its physics says."""

from __future__ import annotations

import numpy as np
import scipy

from firmloop.diagnose.discrepancy.coordinates import Carried, Warmth, interrupted

STEP = 1e-3
TIME = np.arange(4000) * STEP


def test_a_carried_mass_takes_the_power_that_its_kinetic_energy_gains() -> None:
    place, speed = 3.0 * np.sin(2.0 * TIME), 6.0 * np.cos(2.0 * TIME)
    made = Carried("acceleration, by angle", (place,), periodic=True, speeds=(speed,), step=STEP)
    power = -made.columns(0) * speed[:, None]
    energy = 0.5 * made.shapes(place) * speed[:, None] ** 2
    gained = scipy.integrate.cumulative_trapezoid(power, dx=STEP, axis=0)
    np.testing.assert_allclose(gained, energy[1:] - energy[0], atol=0.02)  # of 18


def test_what_is_warm_has_moved_and_cools_at_rest() -> None:
    speed = np.where(TIME < 2.0, 5.0, 0.0)
    speed[-1] = 5.0
    warm = Warmth("speed, by its heat of late", (speed,), STEP).columns(0)
    assert np.all(np.diff(warm[:2000], axis=0) > 0.0)  # the longer it moves, the warmer
    assert np.all(warm[2000:-1] == 0.0)  # nothing is proportional to a speed of none
    assert np.all(np.diff(warm[-1] / warm[1999]) > 0.0)  # what cools over a longer time has kept more


def test_a_drive_that_fails_is_found_where_it_does_and_nowhere_in_noise() -> None:
    rng = np.random.default_rng(7)
    drive = 10.0 * np.sin(3.0 * TIME)
    fails = (np.arange(4000) % 500 < 20) & (np.abs(drive) > 4.0)
    noise = rng.normal(0.0, 0.2, 4000)
    found = interrupted("voltage_V", [drive], [noise - drive * fails])
    assert found is not None
    np.testing.assert_array_equal(found.columns(0)[:, 0] != 0.0, fails)
    assert found.searched == 2 * np.count_nonzero(np.diff(fails.astype(int), prepend=0) > 0)
    assert interrupted("voltage_V", [drive], [noise]) is None
