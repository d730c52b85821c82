"""The smoother of missing torques: what it sees is finite, or nothing is seen."""

from __future__ import annotations

import numpy as np

from firmloop.diagnose.model.disturbance_smoother import latent
from firmloop.diagnose.model.disturbed_plant import tracker
from firmloop.diagnose.policy import QUICK_WALK
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.recording import make_recording

TWO_BODIES = {
    "kind": "ode",
    "states": ["w1_rad_s", "w2_rad_s", "twist_rad"],
    "inputs": ["torque_N_m"],
    "outputs": {"w1_rad_s": "w1_rad_s", "w2_rad_s": "w2_rad_s"},
    "derivatives": {
        "w1_rad_s": "(torque_N_m - b*w1_rad_s - k*twist_rad - c*(w1_rad_s - w2_rad_s))/J1",
        "w2_rad_s": "(k*twist_rad + c*(w1_rad_s - w2_rad_s))/J2",
        "twist_rad": "w1_rad_s - w2_rad_s",
    },
    "balances": {"w1_rad_s": {"kind": "torque", "per": "1/J1"}, "w2_rad_s": {"kind": "torque", "per": "1/J2"}},
}
PARAMETERS = {"J1": 0.002612918, "J2": 0.000373491, "k": 1.486272, "c": 0.002131752, "b": 0.003044875}


def test_a_smoother_that_diverges_shows_nothing() -> None:
    """What tells the two bodies' torques apart is so little that the seventh digit decides how it ends."""
    noise, found = [0.2257, 0.2317], []
    for digit in range(80):
        values = {name: value * (1.0 + 1e-7 * digit) for name, value in PARAMETERS.items()}
        plant = plant_from_table({**TWO_BODIES, "parameters": values})
        made = tracker(plant, plant.balances, 0.004, noise, [QUICK_WALK, QUICK_WALK])
        if made is not None:
            found.append((float(np.max(np.abs(np.linalg.eigvals(made.back)))), digit, plant))
    time, rng = np.arange(1428) * 0.004, np.random.default_rng(1)
    columns = {name: rng.standard_normal(1428) for name in ("torque_N_m", "w1_rad_s", "w2_rad_s")}
    seen = latent(max(found)[2], make_recording(time, columns, "drawn", ""), noise)
    assert seen is None or all(np.all(np.isfinite(each)) for each in (seen.states, *seen.disturbances))
