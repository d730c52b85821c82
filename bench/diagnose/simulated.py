"""Write a simulated case: recordings of bench/diagnose/truth.c, a project with its nominal plant, and the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.diagnose.blind_cases import draw_case, write_recordings
from bench.diagnose.hidden import Hidden, Truth, same_function, write_truth
from bench.diagnose.visible import shows
from firmloop.identify.plants.attach import parameters_of
from firmloop.identify.recordings.recording import read_recording
from firmloop.project.project import read_project
from firmloop.stages.plant import plant_of


def write(seed: int, stratum: str, tests: int, folder: Path) -> None:
    """Write one case with one or two train recordings, by its seed, and `tests` test recordings."""
    case = draw_case(seed, stratum)
    trains = int(np.random.default_rng([seed, 80]).integers(1, 3))
    train = [f"train_{k + 1}" for k in range(trains)]
    roles = (*train, *(f"test_{k + 1}" for k in range(tests)))
    label = write_recordings(case, folder, folder / "noise_free", roles)
    plant = plant_of(read_project(folder / "project.toml"))
    outputs = [signal.name for signal in plant.outputs]
    recordings = [read_recording(folder / f"{role}.csv", {}) for role in train]
    drives = [recording.columns[plant.inputs[0].name] for recording in recordings]
    visible, outside = shows(case, drives, label["noise"])
    hidden = []
    for name, told in label["effects"].items():
        output = label["outputs"][name]
        names = [p.name for p in parameters_of(plant, name, output)]
        figures = {p: value for p in names for word, value in told.items() if p.startswith(word)}
        assert len(figures) == len(told), (name, names, told)
        hidden.append(Hidden(name, output, figures, same_function(name, outputs), visible[name]))
    about = {key: label[key] for key in ("machine", "sensors", "excitation", "closed", "colored", "size")}
    about = {**about, "train": trains, "test": tests}
    truth = Truth("simulated", seed, tuple(hidden), label["outside"], outside, label["plant"], label["noise"], about)
    write_truth(truth, folder)
