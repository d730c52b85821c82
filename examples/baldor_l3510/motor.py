"""A motor that is consistent with the L3510's datasheet: circuit by least squares, then simulated starts."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares

from examples.baldor_l3510 import stated
from firmloop.identify.bench_tests.revolving_field import Running, at_load, breakdown, running
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate

Array = NDArray[np.float64]

KNOWN = {
    "main_R_ohm": stated.R_MAIN,
    "aux_R_ohm": stated.R_AUX,
    "pole_pairs": stated.POLES / 2,
    "capacitance_F": stated.C_START,
    "frequency_Hz": stated.HERTZ,
}
SWITCH = {"switch_open_rad_s": 0.75 * stated.SYNCHRONOUS, "switch_close_rad_s": 0.45 * stated.SYNCHRONOUS}


@functools.cache
def circuit() -> tuple[Mapping[str, float], float]:
    """Fit leakage, rotor, magnetizing inductance, turns ratio and friction (W) to the datasheet.

    Residuals are in shares of what a datasheet may be off: 1.5 rpm, 2 % of a current, 0.015 of a power factor, 3 % of
    the locked-rotor and breakdown figures. The stator's two windings lie in the same slots: their leakages are held
    near the square of the turns ratio, within 20 %.
    """

    def values(logs: Array) -> tuple[dict[str, float], float]:
        leakage, rotor, mutual, turns, aside, friction = (float(x) for x in np.exp(logs))
        found = {"main_L_H": leakage, "rotor_L_H": leakage, "rotor_R_ohm": rotor, "magnetizing_L_H": mutual}
        return {**KNOWN, **found, "turns_ratio": turns, "aux_L_H": aside}, friction

    def residuals(logs: Array) -> Array:
        value, friction = values(logs)
        parts: list[float] = []
        for share, factor, _, rpm, amps in stated.LOAD:
            try:
                point = at_load(value, stated.VOLTS, share * stated.POWER, friction)
            except ValueError:
                return np.full(23, 10.0)
            parts += [
                (point.speed * 30 / math.pi - rpm) / 1.5,
                (point.line / amps - 1) / 0.02,
                (point.power_factor - factor / 100) / 0.015,
            ]
        start, top = running(value, stated.VOLTS, 1.0, True), breakdown(value, stated.VOLTS)
        parts += [
            (start.line / stated.START_AMPS - 1) / 0.03,
            (start.torque / stated.LOCKED_TORQUE - 1) / 0.03,
            (start.power_factor - stated.START_PF) / 0.02,
            (top.torque / stated.BREAKDOWN_TORQUE - 1) / 0.03,
            math.log(value["aux_L_H"] / (value["turns_ratio"] ** 2 * value["main_L_H"])) / 0.2,
        ]
        return np.array(parts)

    start = np.log([1.2e-3, 0.6, 0.06, 1.7, 4e-3, 80.0])
    return values(least_squares(residuals, start, xtol=1e-6, ftol=1e-6).x)


def loaded(share: float, warm: float = 1.0) -> Running:
    """Return the running point at a share of the rated load with every resistance times `warm`."""
    value, friction = circuit()
    hot = {name: value[name] * warm for name in ("main_R_ohm", "rotor_R_ohm")}
    return at_load({**value, **hot}, stated.VOLTS, share * stated.POWER, friction)


def start_up(inertia: float, capacitance: float = stated.C_START, seconds: float = 2.0) -> tuple[Array, Array]:
    """Simulate a start from rest at 115 V without load: time (s) and speed (rad/s)."""
    value, friction = circuit()
    plant = make_plant(
        "single_phase_induction_motor",
        "voltage_rms_V",
        ["speed_rad_s"],
        {
            **value,
            **SWITCH,
            "capacitance_F": capacitance,
            "J_kg_m2": inertia,
            "b_N_m_s_rad": friction / stated.SYNCHRONOUS**2,
            "load_N_m_s2_rad2": 0.0,
            "rise_K_per_W": 0.0,
            "heating_time_s": 1e3,
        },
    )
    time = np.arange(round(seconds * 1000)) * 1e-3
    rows = make_recording(time, {"voltage_rms_V": np.full(len(time), stated.VOLTS)}, "simulated", "")
    return time, simulate(plant, rows, None)[:, 0]


def settled(inertia: float) -> float:
    """Return when the simulated start stays within 2 % of its final speed, s."""
    time, speed = start_up(inertia, seconds=4.0)
    return float(time[np.flatnonzero(np.abs(speed / speed[-1] - 1) > 0.02)[-1] + 1])


@functools.cache
def inertia_of_start() -> float:
    """Return the inertia (kg m^2) with which the start settles at the published time."""
    return float(brentq(lambda j: settled(j) - stated.SETTLED, 0.01, 0.2, xtol=1e-4))


def second_order_fit(time: Array, speed: Array) -> tuple[float, float, float]:
    """Fit gain (rad/s), natural frequency and damping ratio of the standard form to a start by least squares."""

    def model(values: Array) -> Array:
        gain, natural, damping = np.exp(values)
        roots = natural * (-damping + np.array([1, -1]) * np.sqrt(complex(damping**2 - 1)))
        apart = roots[0] - roots[1] if abs(roots[0] - roots[1]) > 1e-6 else 1e-6
        shape = 1 + (roots[1] * np.exp(roots[0] * time) - roots[0] * np.exp(roots[1] * time)) / apart
        return np.asarray(gain * shape.real - speed)

    found = np.exp(least_squares(model, np.log([speed[-1], 6.0, 0.8])).x)
    return float(found[0]), float(found[1]), float(found[2])
