"""How often is a true constant of a permanent-magnet machine inside its 95 % interval? Benches and logs drawn anew.

    python -m bench.host.synchronous_coverage [REPEATS]

Right is 93 to 97 % of 300. First the standard tests on simulated benches: steps with a held rotor, a
run-up and its end.
Then `identify` on a log of voltages, currents of two phases, speed and position, with the dead time of the bridges.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping

import numpy as np

from bench.host.coverage import shares
from firmloop.identify.bench_tests.datasheets import sheets
from firmloop.identify.bench_tests.standard_tests import Measured
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from tests.motor_benches import FLUX, LD, LOST, LQ, PAIRS, B, J, R, bench

TRUTH = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "dead_time.voltage_V": LOST, "J_kg_m2": J, "b_N_m_s_rad": B}
OUTPUTS = ("current_a_A", "current_b_A", "speed_rad_s", "position_rad")
NOISE = (0.02, 0.02, 0.5, 1e-3)
ROWS, STEP = 800, 1e-4  # s


def tested(repeats: int) -> Mapping[str, float]:
    """Return the share of benches whose standard tests hold each true value."""
    tests, held = sheets()["pmsm"].tests, dict.fromkeys(TRUTH, 0)
    for seed in range(repeats):
        found = {"pole_pairs": Measured(float(PAIRS), None), "flux_Wb": Measured(FLUX, None)}
        made = bench(np.random.default_rng(seed))
        for name, test in (("d", "locked_d"), ("q", "locked_q"), ("run", "run_up")):
            columns = dict(made[name])
            found |= tests[test].run(make_recording(columns.pop("time_s"), columns, "bench", ""), found)
        for name, truth in TRUTH.items():
            held[name] += abs(found[name].value - truth) < 1.96 * (found[name].deviation or 0.0)
    return {name: count / repeats for name, count in held.items()}


def machine() -> Plant:
    """Return the machine with the dead time of its bridges, all constants free."""
    values = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX, "J_kg_m2": J, "b_N_m_s_rad": B}
    free: dict[str, object] = {name: {"value": value, "free": True} for name, value in values.items()}
    return plant_from_table(
        {
            "kind": "pmsm",
            "inputs": ["voltage_d_V", "voltage_q_V"],
            "outputs": list(OUTPUTS),
            "parameters": {**free, "pole_pairs": PAIRS},
            "effects": [{"name": "dead_time", "voltage_V": {"value": LOST, "free": True}}],
        }
    )


def identified(repeats: int) -> Mapping[str, float]:
    """Return the share of logs whose fit holds each true value."""
    plant = machine()
    held = np.repeat(np.random.default_rng(3).uniform(-1.0, 1.0, (ROWS // 40, 2)), 40, axis=0) * (1.5, 6.0)
    drive = {"voltage_d_V": held[:, 0], "voltage_q_V": held[:, 1]}
    moments = np.arange(ROWS) * STEP
    clean = simulate(plant, make_recording(moments, drive, "truth", ""), None)

    def draw(seed: int) -> Recording:
        noisy = clean + np.random.default_rng(seed).normal(size=clean.shape) * NOISE
        return make_recording(moments, {**drive, **dict(zip(OUTPUTS, noisy.T, strict=True))}, "", "")

    return shares(plant, draw, plant, repeats)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    for title, measure in (("standard tests", tested), ("identify", identified)):
        began = time.perf_counter()
        words = ", ".join(f"{name} {share:.1%}" for name, share in measure(count).items())
        print(f"{title}: {words} ({count} repeats, {time.perf_counter() - began:.0f} s)", flush=True)
