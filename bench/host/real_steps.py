"""How honest are intervals of step-response models on a real motor? Estimates from disjoint pieces of one recording.

    FIRMLOOP_RECORDINGS=... python -m bench.host.real_steps [PIECES]

No truth is known there, but each piece has to predict the others: of two disjoint pieces the estimates differ by less
than 1.96 times the root of both variances in 95 % of the pairs, where intervals are right and the model is. The bench
is the motor of a ball and hoop: random steps, held for 5 s each, read at 10 Hz. The last row is a lag with a drag that
grows with the square of the speed, which `firmloop diagnose` finds in this recording.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Mapping

import numpy as np

from bench.diagnose.real_machines import ROOT
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.attach import parameters_of
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import Recording, make_recording, read_recording

FILE = ROOT / "ball_and_hoop_dc_motor" / "randomStepSequence.csv"
DRIVE, OUTPUT, HOLD = "motor_cmd_norm", "tacho_V", 50  # rows that a level is held
NO_DELAY = {"value": 0.0, "free": False}
MODELS: Mapping[str, tuple[str, Mapping[str, object]]] = {
    "first order": ("first_order", {"gain": 12.0, "time_constant_s": 1.5, "delay_s": NO_DELAY}),
    "first order, delay": ("first_order", {"gain": 12.0, "time_constant_s": 1.5, "delay_s": 0.05}),
    "second order": (
        "second_order",
        {"gain": 12.0, "natural_frequency_rad_s": 2.0, "damping_ratio": 1.5, "delay_s": NO_DELAY},
    ),
    "process": (
        "process",
        {
            "gain": 12.0,
            "time_constant_s": 1.5,
            "second_time_constant_s": 0.1,
            "zero_time_constant_s": NO_DELAY,
            "delay_s": NO_DELAY,
        },
    ),
    "first order, drag": ("first_order", {"gain": 12.0, "time_constant_s": 1.5, "delay_s": NO_DELAY}),
}


def model(name: str) -> Plant:
    """Return the plant of a row."""
    kind, parameters = MODELS[name]
    bare = make_plant(kind, DRIVE, [OUTPUT], parameters)
    if not name.endswith("drag"):
        return bare
    (known,) = parameters_of(bare, "quadratic_drag", None)
    effect = {"name": "quadratic_drag", known.name: {"value": 0.01, "free": True}}
    table = {"kind": kind, "input": DRIVE, "outputs": [OUTPUT], "parameters": parameters, "effects": [effect]}
    return plant_from_table(table)


def pieces(whole: Recording, count: int) -> list[Recording]:
    """Cut a recording into equal pieces, each of which begins with a step."""
    rows = len(whole.time) // HOLD // count * HOLD
    cut = []
    for first in range(0, rows * count, rows):
        part = slice(first, first + rows)
        columns = {name: values[part] for name, values in whole.columns.items()}
        cut.append(make_recording(whole.time[part] - whole.time[first], columns, f"row {first}", ""))
    return cut


def main() -> int:
    """Print one line a model."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    parts = pieces(read_recording(FILE, {}), count)
    print(f"{FILE.parent.name}: {count} disjoint pieces of {len(parts[0].time)} rows; pairs that agree, of 95 %")
    for name in MODELS:
        begun, refused = time.perf_counter(), 0
        found: dict[str, list[tuple[float, float]]] = {}
        fits = []
        for part in parts:
            try:
                fitted = fit(model(name), [part], [], NONE)
            except IdentifyError:
                refused += 1
                continue
            fits.append(fitted.train[0].scores[OUTPUT].fit_percent)
            for parameter in fitted.plant.parameters:
                if parameter.free and parameter.deviation is not None:
                    found.setdefault(parameter.name, []).append((parameter.value, parameter.deviation))
        words = []
        for key, values in found.items():
            pairs = list(itertools.combinations(values, 2))
            held = sum(abs(a - b) < NORMAL_95 * np.hypot(s, t) for (a, s), (b, t) in pairs)
            spread = np.std([value for value, _ in values], ddof=1) / np.median([size for _, size in values])
            middle = np.median([value for value, _ in values])
            words.append(f"{key} {middle:.3g}: {held} of {len(pairs)}, spread {spread:.2g} deviations")
        print(
            f"{name}: fit {np.median(fits):.1f} %; {'; '.join(words)}"
            + (f"; {refused} pieces refused" if refused else "")
            + f" ({time.perf_counter() - begun:.0f} s)",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
