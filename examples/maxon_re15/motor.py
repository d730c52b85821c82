"""The motor that shows what consistent values look like in the RE 15 audit, in open and in closed loop.

It is an assumption of ours, named in the report; the study gives no parameter of its motor.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from examples.audit_table import step_figures
from firmloop.design.analysis.loop import Trajectory, closed_loop, margins
from firmloop.design.kinds import design
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import simulate

ASSUMED = {  # a coreless motor of 15 mm and 6 V; the study gives none of these
    "R_ohm": 3.0,
    "L_H": 1e-4,
    "ke_V_s_rad": 6e-3,
    "kt_N_m_A": 6e-3,
    "J_kg_m2": 6e-8,
    "b_N_m_s_rad": 2e-8,
}
PERIOD, VOLTS, SECONDS = 1e-4, 6.0, 2.0  # s (the study samples at 10 kHz), V, s (of its figure 1)
TIME = np.arange(round(SECONDS / PERIOD)) * PERIOD


def motor(inductance: float, resistance: float = ASSUMED["R_ohm"]) -> Plant:
    """Return the assumed motor; without inductance it is of first order."""
    values = {**ASSUMED, "R_ohm": resistance, "L_H": {"value": inductance, "free": False}}
    return make_plant("dc_motor", "voltage_V", ["speed_rad_s"], values)


def open_loop(inductance: float, resistance: float = ASSUMED["R_ohm"]) -> tuple[np.ndarray, Mapping[str, float]]:
    """Return speed and step figures of a step of the rated voltage."""
    rows = make_recording(TIME, {"voltage_V": np.full(len(TIME), VOLTS)}, "simulated", "")
    speed = simulate(motor(inductance, resistance), rows, None)[:, 0]
    return speed, step_figures(TIME, speed, float(speed[-1]))


def final() -> float:
    """Return the speed (rad/s) at which eq. 1 ends for the rated voltage."""
    r, _, k, _, _, b = ASSUMED.values()
    return VOLTS * k / (r * b + k * k)


@functools.cache
def controlled(inductance: float) -> tuple[Trajectory, Mapping[str, float], float]:
    """Tune a PI(D) by SIMC on the assumed motor: trajectory of a step to half speed, its figures and Ms."""
    plant = motor(inductance)
    wires = (Signal("reference", "rad/s", -1200.0, 1200.0), Signal("measurement", "rad/s", -1200.0, 1200.0))
    made = design(
        "pid", "re15", {"tune": "simc", "tau_c_s": 1e-3}, PERIOD, wires, (Signal("output", "V", -12.0, 12.0),), plant
    )
    linear = linearize(plant)
    path = closed_loop(made.law, linear, np.full(2000, 450.0))
    found = step_figures(path.time, path.measurement, 450.0)
    found["error"] = 100 * abs(1 - float(path.measurement[-1]) / 450.0)
    return path, found, margins(made.law, linear).sensitivity_peak
