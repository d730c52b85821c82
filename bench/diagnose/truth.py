"""Run the truth of the simulated cases: trajectories of bench/diagnose/truth.c, seen through sensors of its own."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from firmloop.identify.simulation.compiler import shared_library

Array = NDArray[np.float64]
FINE = 100  # substeps per row
PARAMETERS = (
    "is_motor R L ke kt J b coulomb static stribeck positive negative load_ratio bristle bristle_level "
    "drag load step step_time gravity gravity_phase cogging cogging_n cogging_phase ripple ripple_n ripple_phase "
    "stop stop_stiffness spring cubic coupling coupling_damping coupled_inertia gap kt_saturation heat_rise heat_time "
    "brush l_saturation dead_zone limit slew delay supply sag "
    "angle_damping periodic periodic_hz gain_asymmetry hysteresis hysteresis_reach "
    "inertia_wave thinning thinning_time outage"
).split()
COLUMNS = ("current", "speed", "position")


@dataclass(frozen=True, slots=True)
class Sensor:
    """What stands between a true quantity and its column: `fault` names the effect, `size` its parameters."""

    fault: str
    size: Mapping[str, float]


@cache
def _library() -> ctypes.CDLL:
    text = Path(__file__).with_name("truth.c").read_text(encoding="utf-8")
    library = ctypes.CDLL(str(shared_library({"truth.c": text}, ["truth.c"], ("-std=c99", "-O2"))))
    pointer = ctypes.c_void_p
    library.truth_run.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_double, *[pointer] * 5]
    library.truth_run.restype = ctypes.c_int
    return library


def run(
    values: Mapping[str, float],
    command: Array,
    step: float,
    gains: Array | None,
    torque: Array,
    fine: int = FINE,
) -> tuple[Array, Mapping[str, Array]]:
    """Return the input (n,) as it was applied, and the true quantities (n * fine,) on the fine grid."""
    unknown = set(values) - set(PARAMETERS)
    assert not unknown, unknown
    row = np.array([float(values.get(name, 0.0)) for name in PARAMETERS])
    drive = np.array(command, dtype=np.float64)
    out = np.zeros((len(drive) * fine, 3))
    push = np.ascontiguousarray(torque)
    loop = None if gains is None else np.ascontiguousarray(gains)
    status = _library().truth_run(
        len(drive),
        fine,
        step,
        row.ctypes.data,
        drive.ctypes.data,
        None if loop is None else loop.ctypes.data,
        push.ctypes.data,
        out.ctypes.data,
    )
    if status:
        raise ArithmeticError(f"the truth diverged: {dict(values)}")
    return drive, dict(zip(COLUMNS, out.T.copy(), strict=True))


def read(
    quantity: str,
    fine: Mapping[str, Array],
    step: float,
    rows: int,
    fault: Sensor | None,
    skew: float,
    substeps: int = FINE,
) -> Array:
    """Return one output (n,) at the rows, through its fault, without noise and without rounding."""
    h = step / substeps
    grid = np.arange(len(fine[quantity])) * h
    moments = np.arange(rows) * step * (1.0 + skew)
    values = fine[quantity]
    name, size = (fault.fault, fault.size) if fault is not None else ("", {})
    if name == "eccentric_encoder":
        values = values + size["amplitude"] * np.sin(fine["position"] + size["phase"])
    if name == "sensor_lag":
        share = h / size["time_constant"]
        keep = float(np.exp(-share))
        late = (1.0 - keep) / share  # exact for what is straight within a substep: the end of it alone is h/2 early
        values = lfilter([1.0 - late, late - keep], [1.0, -keep], values)
    if name == "sensor_delay":
        moments = moments - size["delay"]
    seen = np.interp(moments, grid, values)
    if name == "sensor_offset":
        seen = seen + size["offset"]
    if name == "sensor_gain":
        seen = seen * size["gain"]
    if name == "sensor_rectified":
        seen = np.abs(seen)
    if name == "sensor_saturation":
        seen = np.clip(seen, -size["limit"], size["limit"])
    if name == "sensor_wrap":
        seen = folded(seen, size["range"])
    return np.asarray(seen)


def folded(values: Array, reach: float) -> Array:
    """Return readings (n,) as a sensor of that range shows them, which wraps at its ends."""
    return np.asarray((values + reach / 2.0) % reach - reach / 2.0)
