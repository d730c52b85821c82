"""Effects in the axes of a permanent-magnet machine against fine steps of its phases, and out of noisy logs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.attach import parameters_of
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.identify.simulation.superset import starts_of

Array = NDArray[np.float64]

R, LD, LQ, FLUX, PAIRS, J, B = 0.36, 0.2e-3, 0.33e-3, 6.4e-3, 4, 4.8e-6, 1e-5
MACHINE = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX, "pole_pairs": PAIRS, "J_kg_m2": J, "b_N_m_s_rad": B}
WIRES = ("current_d_A", "current_q_A", "speed_rad_s", "position_rad")
NOISE = (0.02, 0.02, 0.5, 1e-3)
STEP, ROWS = 1e-4, 600
AXES = tuple(effect.name for effect in effects().values() if effect.place == "axes")


def drive(seed: int = 3, rows: int = ROWS) -> Array:
    """Return voltages of both axes (n, 2), held for some milliseconds."""
    held = np.repeat(np.random.default_rng(seed).uniform(-1.0, 1.0, (rows // 40 + 1, 2)), 40, axis=0)[:rows]
    return held * (1.5, 6.0)


@dataclass(frozen=True)
class Machine:
    """The machine, and what is wrong with it or with its drive: none of it by default."""

    wave: Callable[[float], float] = lambda th: 0.0  # V s/rad along q
    isat: float = math.inf
    rise: float = 0.0  # K/W
    lag: float = 1.0  # s
    ahead: Callable[[float], float] = lambda th: 0.0  # rad, electrical
    zeros: tuple[float, float] = (0.0, 0.0)  # A
    gains: tuple[float, float] = (1.0, 1.0)

    def flux(self, current: float, inductance: float) -> float:
        if math.isinf(self.isat):
            return inductance * current
        return inductance * self.isat * math.atan(current / self.isat)

    def rates(self, x: Array, voltage: complex) -> list[float]:
        """Write the machine from its flux linkages."""
        i_d, i_q, w, th, warm = x
        own = voltage * np.exp(1j * self.ahead(th))
        magnets = FLUX * (1.0 - 0.0011 * warm)
        flux_d, flux_q = self.flux(i_d, LD) + magnets, self.flux(i_q, LQ)
        slopes = [length / (1.0 + (current / self.isat) ** 2) for length, current in ((LD, i_d), (LQ, i_q))]
        torque = 1.5 * PAIRS * (flux_d * i_q - flux_q * i_d) + 1.5 * self.wave(th) * i_q
        return [
            (own.real - R * i_d + PAIRS * w * flux_q) / slopes[0],
            (own.imag - R * i_q - PAIRS * w * flux_d - w * self.wave(th)) / slopes[1],
            (torque - B * w) / J,
            w,
            (self.rise * 1.5 * R * (i_d**2 + i_q**2) - warm) / self.lag,
        ]

    def log(self, voltages: Array) -> Array:
        """Return what a drive logs (n, 4) from rest."""
        x, rows = np.zeros(5), []
        for v_d, v_q in voltages:
            stator = (x[0] + 1j * x[1]) * np.exp(1j * PAIRS * x[3])
            a, b = stator.real, (stator * np.exp(-2j * math.pi / 3)).real
            a, b = self.gains[0] * a + self.zeros[0], self.gains[1] * b + self.zeros[1]
            taken = complex(a, (a + 2 * b) / math.sqrt(3)) * np.exp(-1j * (PAIRS * x[3] + self.ahead(x[3])))
            rows.append((taken.real, taken.imag, x[2], x[3]))
            done = solve_ivp(
                lambda t, x, v=complex(v_d, v_q): self.rates(x, v), (0.0, STEP), x, "DOP853", rtol=1e-8, atol=1e-10
            )
            x = done.y[:, -1]
        return np.array(rows)


CASES: Mapping[str, tuple[Mapping[str, float], Machine]] = {
    "flux_harmonics": (
        {"amplitude_V_s_rad": 2e-3, "periods_per_rev": 24.0, "phase_rad": 0.4},
        Machine(wave=lambda th: 2e-3 * math.cos(24.0 * th + 0.4)),
    ),
    "stator_saturation": ({"current_A": 8.0}, Machine(isat=8.0)),
    "magnet_heating": ({"rise_K_per_W": 30.0, "time_constant_s": 0.02}, Machine(rise=30.0, lag=0.02)),
    "angle_offset": ({"offset_rad": 0.2}, Machine(ahead=lambda th: 0.2)),
    "angle_eccentricity": (
        {"amplitude_rad": 0.05, "phase_rad": 0.3},
        Machine(ahead=lambda th: PAIRS * 0.05 * math.sin(th + 0.3)),
    ),
    "current_offset": ({"offset_a_A": 0.3, "offset_b_A": -0.2}, Machine(zeros=(0.3, -0.2))),
    "current_gain": ({"gain_a": 1.08, "gain_b": 0.95}, Machine(gains=(1.08, 0.95))),
}


@cache
def logged_by(name: str) -> Array:
    return (CASES[name][1] if name else Machine()).log(drive())


def table(name: str, values: Mapping[str, object]) -> dict[str, object]:
    return {
        "kind": "pmsm",
        "inputs": ["voltage_d_V", "voltage_q_V"],
        "outputs": list(WIRES),
        "parameters": {key: {"value": value, "free": False} for key, value in MACHINE.items()},
        "effects": [{"name": name, **values}],
    }


def recorded(voltages: Array, logged: Array | None = None) -> Recording:
    columns = {"voltage_d_V": voltages[:, 0], "voltage_q_V": voltages[:, 1]}
    if logged is not None:
        columns |= dict(zip(WIRES, logged.T, strict=True))
    return make_recording(np.arange(len(voltages)) * STEP, columns, "log", "")


def test_every_effect_of_the_axes_is_tried() -> None:
    assert set(CASES) == set(AXES)


@pytest.mark.parametrize("name", CASES)
def test_it_is_what_fine_steps_show(name: str) -> None:
    values, _ = CASES[name]
    voltages = drive()
    truth, bare = logged_by(name), logged_by("")
    shown = simulate(plant_from_table(table(name, values)), recorded(voltages), None)
    changed = np.max(np.abs(truth - bare), axis=0)
    assert np.max(changed / np.max(np.abs(bare), axis=0)) > 0.01, "the case shows it"
    assert np.all(np.abs(shown - truth) <= 3e-4 * changed + 1e-6 * np.max(np.abs(bare), axis=0))


@pytest.mark.parametrize("name", CASES)
def test_it_is_found_in_noise(name: str) -> None:
    values, _ = CASES[name]
    voltages = drive()
    noise = np.random.default_rng(6).normal(size=(ROWS, len(WIRES))) * NOISE
    logged = recorded(voltages, logged_by(name) + noise)
    fixed = ("periods_per_rev",)
    begun = {
        key: {"value": value * 0.8 if key not in fixed else value, "free": key not in fixed}
        for key, value in values.items()
    }
    found = {p.name: p for p in fit(plant_from_table(table(name, begun)), [logged], [], NONE).plant.parameters}
    for key, value in values.items():
        one = found[f"{name}.{key}"]
        if key not in fixed:
            assert one.deviation is not None
            assert abs(one.value - value) < 3.5 * one.deviation < 0.5 * abs(value), key


def test_starts_are_of_the_size_of_what_the_phases_carry() -> None:
    logged = logged_by("")
    plant, flowing = plant_from_table({**table("", {}), "effects": []}), np.hypot(logged[:, 0], logged[:, 1]).max()
    first = {
        name: starts_of(plant, [recorded(drive(), logged)], name)[0][f"{name}.{key}"]
        for name, key in (("stator_saturation", "current_A"), ("dead_time", "voltage_V"))
    }
    assert first["stator_saturation"] == pytest.approx(flowing)
    assert first["dead_time"] == pytest.approx(0.03 * R * flowing)


def test_duties_are_turned_by_the_angle_that_was_measured() -> None:
    """Of three bridges the voltage is known in the stator, and an angle that is ahead turns it too far back."""
    rows = 200
    supply, angle = np.full(rows, 24.0), np.linspace(0.0, 9.0, rows)
    voltages = drive(7, rows)
    columns: dict[str, Array] = {"supply_V": supply, "angle_rad": angle}
    for k, one in enumerate("abc"):
        at = angle - k * 2 * math.pi / 3
        columns[f"duty_{one}"] = 0.5 + (np.cos(at) * voltages[:, 0] - np.sin(at) * voltages[:, 1]) / supply
    offset = {"name": "angle_offset", "offset_rad": 0.3}
    bridged = {**table("angle_offset", {}), "inputs": [f"duty_{k}" for k in "abc"] + ["supply_V", "angle_rad"]}
    by_duty = simulate(
        plant_from_table({**bridged, "effects": [offset]}),
        make_recording(np.arange(rows) * STEP, columns, "", ""),
        None,
    )
    by_voltage = simulate(plant_from_table(table("angle_offset", {"offset_rad": 0.3})), recorded(voltages), None)
    np.testing.assert_allclose(by_duty, by_voltage, atol=1e-7)


def test_nothing_else_has_such_axes() -> None:
    lag = make_plant("first_order", "voltage_V", ["speed_rad_s"], {"gain": 1.0, "time_constant_s": 1.0, "delay_s": 0.0})
    with pytest.raises(IdentifyError, match="stator_saturation needs axes of the plant, and first_order has none"):
        parameters_of(lag, "stator_saturation")


def test_a_sensor_that_sees_the_angle_gives_it_to_a_plant_that_has_none() -> None:
    """Of a speed alone the angle is no state, and an eccentric encoder read a constant one."""
    effect = {"name": "eccentric_encoder", "output": "speed_rad_s", "amplitude_rad": 0.05}
    shown = [
        simulate(plant_from_table({**table("", {}), "outputs": outputs, "effects": [effect]}), recorded(drive()), None)[
            :, 0
        ]
        for outputs in (["speed_rad_s"], ["speed_rad_s", "position_rad"])
    ]
    np.testing.assert_allclose(shown[0], shown[1], atol=1e-9)
