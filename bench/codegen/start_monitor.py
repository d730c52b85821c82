"""Conceal an aged capacitor in simulated starts, and let the generated monitor find it and the end of the start.

    python -m bench.codegen.start_monitor   100 healthy and 100 aged starts, in every format; `--quick` takes a tenth

Each start is simulated at 10 kHz with its own phase and size of the mains, load, inertia, winding temperature and
capacitor, and sampled at 1 kHz with noise on all three signals. The monitor has watched the motor rest for up to half a
second before, so that each start meets other random digits. What runs is the bit-exact program. The start truly ends
when the speed first passes that at which the centrifugal switch opens. Exit status 1 below the bars.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.induction_truth import L3510
from firmloop.design.kinds import kinds
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.verify.reference import run
from firmloop.verify.scaling import to_physical, to_raw

Array = NDArray[np.float64]

CASES = 100
FINE, COARSE, SECONDS, REST = 1e-4, 10, 1.2, 0.5  # s, rows a sample, s, s at most
AGED = 0.9  # of the rated capacitance
NOISE = (2.0, 0.3, 1.0)  # V, A, rad/s rms: about 1 % of the mains, of the start current, and of the speed
ALLOWED = 0.020  # s
MOTOR = {
    **L3510,
    "aux_L_H": 4.98e-3,
    "rotor_R_ohm": 0.683,
    "magnetizing_L_H": 0.0621,
    "turns_ratio": 1.795,
    "frequency_Hz": {"value": 60.0, "free": False},
}


@dataclass(frozen=True, slots=True)
class Start:
    """One start as the monitor sees it, and the truth about it."""

    rows: Array  # (n, 3) voltage, auxiliary current, speed
    capacitance: float  # F
    ended: float  # s


def start(random: np.random.Generator, share: float) -> Start:
    """Simulate one start of a capacitor of `share` times its rated value, give or take 2 %."""
    warm = 1 + 0.00393 * random.uniform(-15.0, 40.0)  # around the 25 degC of the datasheet
    own = {
        "capacitance_F": share * 340e-6 * random.uniform(0.98, 1.02),
        "J_kg_m2": 0.055 * random.uniform(0.8, 1.25),
        "load_N_m_s2_rad2": random.uniform(0.0, 1e-4),
        **{key: MOTOR[key] * warm for key in ("main_R_ohm", "aux_R_ohm", "rotor_R_ohm")},
    }
    time = np.arange(round(SECONDS / FINE)) * FINE
    volts = 115.0 * random.uniform(0.95, 1.05) * math.sqrt(2)
    voltage = volts * np.sin(120 * math.pi * time + random.uniform(0, 2 * math.pi))
    plant = make_plant("single_phase_induction_motor", "voltage_V", ["speed_rad_s", "aux_current_A"], {**MOTOR, **own})
    speed, current = simulate(plant, make_recording(time, {"voltage_V": voltage}, "simulated", ""), None).T
    ended = float(time[int(np.argmax(speed > MOTOR["switch_open_rad_s"]))])
    # The voltage of a row is held until the next one: what drove the current read here is half a row old.
    rows = np.stack([voltage, current, speed], axis=1)[::COARSE]
    most, rest = round(REST / FINE / COARSE), int(random.integers(REST / FINE / COARSE))
    running = np.repeat([[0.0, 0.0, rows[-1, 2]]], most - rest, axis=0)  # so that all last equally long
    rows = np.concatenate([np.zeros((rest, 3)), rows, running])
    ended += rest * FINE * COARSE
    return Start(rows + random.normal(size=rows.shape) * NOISE, own["capacitance_F"], ended)


def watch(arithmetic: str, starts: list[Start]) -> tuple[Array, NDArray[np.uint32]]:
    """Return the outputs (case, n, 3) and the status word (case, n) of the program."""
    kind = kinds()["start_monitor"]
    program = lower(kind.design(kind.example).law, arithmetic)
    raw = np.stack(
        [np.stack([to_raw(value, one.rows[:, k]) for k, value in enumerate(program.inputs)], axis=-1) for one in starts]
    )
    trace = run(program, raw)
    shown = [to_physical(value, trace.outputs[..., k]) for k, value in enumerate(program.outputs)]
    return np.stack(shown, axis=-1), trace.status


def main() -> int:
    """Print one line per format."""
    count = CASES // 10 if "--quick" in sys.argv else CASES
    random = np.random.default_rng(7)
    healthy, aged = ([start(random, share) for _ in range(count)] for share in (1.0, AGED))
    table = kinds()["start_monitor"].example.table
    print("format     aged flagged  false alarms  regime in 20 ms  worst ms  capacitor error %  in its interval")
    missed = False
    for arithmetic in ARITHMETICS:
        shown, status = watch(arithmetic, healthy + aged)
        low = (status[:, -1] & 2) != 0
        starting = (status & 1) != 0
        last = starting.shape[1] - 1 - np.argmax(starting[:, ::-1], axis=1)
        late = (last + 1) * FINE * COARSE - np.array([one.ended for one in healthy + aged])
        truth = np.array([one.capacitance for one in healthy + aged])
        n, half = shown[:, -1, 0], shown[:, -1, 1]
        found = 1 / (table["inductance_H"] * n**2)
        natural = 1 / np.sqrt(table["inductance_H"] * truth)
        timely = int(np.sum(np.abs(late) <= ALLOWED))
        inside = float(np.mean(np.abs(n - natural) <= half))
        print(
            f"{arithmetic:9} {int(low[count:].sum()):>5} of {count:<5} {int(low[:count].sum()):>5} of {count:<5} "
            f"{timely:>7} of {2 * count:<5} {1e3 * float(np.max(np.abs(late))):>8.1f} "
            f"{100 * float(np.sqrt(np.mean((found / truth - 1) ** 2))):>12.2f} {100 * inside:>14.0f} %"
        )
        missed |= low[count:].sum() < 0.95 * count or low[:count].sum() > 0.02 * count or timely < 0.95 * 2 * count
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
