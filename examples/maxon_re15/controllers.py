"""The controllers that the RE 15 study names, each designed on the same model, within the same limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.twins.qp import optimum

HERE = Path(__file__).parent
PERIOD = 5e-4  # s, that of re15.toml
REFERENCE = Signal("reference", "rad/s", -1000.0, 1000.0)
MEASUREMENT = Signal("measurement", "rad/s", -1200.0, 1200.0)
OUTPUT = Signal("output", "V", -6.0, 6.0)
VOLTAGE, CURRENT = Signal("voltage", "V", -6.0, 6.0), Signal("current", "A", -4.0, 4.0)
SPEED = Signal("speed", "rad/s", -1200.0, 1200.0)
HELD = 450.0  # rad/s, where the gain schedule expects to be loaded
Table = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Contestant:
    """One controller as exact arithmetic: `program` has reference and measurement, or `watcher` makes the latter."""

    name: str
    law: Law
    program: Program
    watcher: tuple[Law, Program] | None = None  # from voltage and current to speed


def model(file: str) -> Plant:
    """Return the plant of one of the two projects, with the parameters that it starts from."""
    part = read_project(HERE / file).plant
    assert part is not None
    return plant_from_table(part.table.values)


def values(plant: Plant) -> dict[str, float]:
    """Return the parameters of a plant by name."""
    return {parameter.name: parameter.value for parameter in plant.parameters}


def static_gain(plant: Plant) -> float:
    """Return the first output per input at rest."""
    linear = linearize(plant)
    return float((linear.d - linear.c @ np.linalg.solve(linear.a, linear.b))[0, 0])


def tuned(rule: str, terms: str, plant: Plant, name: str) -> tuple[Law, Mapping[str, float]]:
    """Return a PI or PID by a tuning rule, and its gains."""
    table = {"tune": rule, "terms": terms}
    made = design("pid", name, table, PERIOD, (REFERENCE, MEASUREMENT), (OUTPUT,), plant)
    return made.law, made.gains


def contestants() -> list[Contestant]:
    """Design every controller on the model of re15.toml; only the self-tuning one starts from the lag of the sheet."""
    plant, sheet = model("re15.toml"), values(model("re15_first_order.toml"))
    slow, first = tuned("ziegler_nichols", "pi", plant, "re15_zn")
    ise, gains = tuned("ise", "pi", plant, "re15_ise")
    whole, _ = tuned("ise", "pid", plant, "re15_pid")
    calm = design(
        "pid",
        "re15_calm",
        {"tune": "simc", "terms": "pi", "tau_c_s": 5e-3},  # five times the observer's time constant
        PERIOD,
        (REFERENCE, MEASUREMENT),
        (OUTPUT,),
        plant,
    ).law
    fuzzy = {
        "kp": gains["kp"],
        "ki": gains["ki"],
        "kd": 0.0,
        "error_width": 100.0,
        "change_width": 50.0,
    }
    schedule = {
        "schedule_on": "measurement",
        "points": [400.0, HELD],
        "controllers": [_pi(gains["kp"], gains["ki"]), _pi(gains["kp"], 0.75 * gains["ki"] + 0.25 * first["ki"])],
    }
    learning = {"gain": sheet["gain"], "lag_s": sheet["time_constant_s"], "time_constant_s": 2 * PERIOD}
    watcher = design(
        "sensorless_speed",
        "re15_speed",
        {**values(plant), "bandwidth_rad_s": 1000.0},
        PERIOD,
        (VOLTAGE, CURRENT),
        (SPEED,),
        None,
    ).law
    made = [
        Contestant("PI, Ziegler-Nichols", slow, _exact(slow)),
        Contestant("PI, least ISE", ise, _exact(ise)),
        Contestant("PID, least ISE", whole, _exact(whole)),
        _designed("fuzzy PID", "fuzzy_pid", fuzzy),
        _designed("MPC, float32", "mpc", predictive(plant)),
        _designed("gain schedule", "gain_schedule", schedule),
        _designed("self-tuning", "self_tuning", learning),
        Contestant("PI, sensorless", calm, _exact(calm), (watcher, _exact(watcher))),
    ]
    return made


def predictive(plant: Plant) -> Table:
    """Weigh the speed's error and the change of the voltage; the load is estimated, so that none is left by it.

    The current settles in a tenth of a sample: the speed alone is the state.
    """
    linear = linearize(plant)
    kept = math.exp(PERIOD * float(np.max(np.linalg.eigvals(linear.a).real)))
    gain = static_gain(plant)
    return {
        "A": [[kept]],
        "B": [[gain * (1 - kept)]],
        "Q": [1.0],
        "R": 100.0,
        "horizon": 6,
        "reference": "reference",
        "u_min": OUTPUT.low,
        "u_max": OUTPUT.high,
        "observer": "kalman",
        "process_noise": [1.0],
        "measurement_noise": 1.0,
        "offset_free": True,
        "disturbance_noise": 1e-2,
        "solver": "fixed_iterations",
    }


def _pi(kp: float, ki: float) -> Table:
    return {"kp": kp, "ki": ki}


def _designed(name: str, kind: str, table: Table) -> Contestant:
    law = design(kind, f"re15_{kind}", table, PERIOD, (REFERENCE, MEASUREMENT), (OUTPUT,), None, optimum).law
    return Contestant(name, law, _exact(law))


def _exact(law: Law) -> Program:
    """Lower a law to fixed32; a search to float32: in fixed point it would see the load in a few bits only."""
    return lower(law, "float32" if law.solve else "fixed32")
