"""Diagnose concealed physics and print the score: `python -m bench.diagnose.blind --cases 200 --first 0`."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.blind_cases import draw_case, write_case
from bench.diagnose.truth import folded
from firmloop.diagnose.contact import grown, past_contacts
from firmloop.diagnose.hypothesis import Cause, Point, Scene, entered, first_point, make_scene
from firmloop.diagnose.refit import Fitted
from firmloop.diagnose.refit import fit as refit
from firmloop.diagnose.rival import relative, unseen_residuals
from firmloop.diagnose.run import Diagnosis
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.noise import white
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import read_recording
from firmloop.identify.simulation.compiler import ToolError
from firmloop.project.project import read_project
from firmloop.project.table import ProjectError
from firmloop.stages.data import read_data
from firmloop.stages.diagnosing import diagnosed
from firmloop.stages.plant import plant_of

Array = NDArray[np.float64]

_STEPS, _TURNS = 40, 4  # of a refit, and refits with the sizes that the last one left
_PATIENCE = 80.0  # million steps of simulation past contacts
EQUATIONS = {
    "friction": "torque",
    "drag": "torque",
    "load_": "torque",
    "torque": "torque",
    "stop": "torque",
    "spring": "torque",
    "coupling": "torque",
    "backlash": "torque",
    "heating": "voltage",
    "brush": "voltage",
    "inductance": "voltage",
    "sensor": "sensor",
    "eccentric": "sensor",
    "clock": "timing",
}
ONE_FUNCTION = (  # effects that one sensor alone cannot tell apart where initial states are free, and which sensors
    ({"input_delay", "sensor_delay"}, ("speed", "position")),
    ({"load_torque", "sensor_offset"}, ("speed",)),
)


@dataclass(frozen=True, slots=True)
class Scored:
    """One case: what was hidden, what was said, and the figures of the table."""

    seed: int
    label: Mapping[str, Any]
    said: Mapping[str, Any]
    seconds: float
    visible: float  # of the hidden effect that shows least, see _visible
    unseen: float | None  # residual on test over the noise there, which the truth itself leaves


def equation_of(name: str) -> str:
    """Return where an effect enters, by the table of the contract."""
    return next((equation for word, equation in EQUATIONS.items() if word in name), "actuator")


def work(seed: int) -> Scored:
    """Make, diagnose and label one case."""
    with tempfile.TemporaryDirectory() as place:
        folder, labels = Path(place) / "case", Path(place) / "labels"
        write_case(draw_case(seed), folder, labels)
        begin = time.process_time()
        try:
            project = read_project(folder / "project.toml")
            found = diagnosed(project, read_data(project), _quiet)
            said: Mapping[str, Any] = found.finding.as_dict()
        except (IdentifyError, ProjectError, ToolError, ArithmeticError) as error:
            found = None
            said = {"verdict": "refused", "effects": [], "error": str(error), "fit": {}, "location": None}
        seconds = time.process_time() - begin
        label = json.loads((labels / "label.json").read_text(encoding="utf-8"))
        hidden = label["effects"] or label["outside"]
        unseen = None if found is None else _unseen(found, label)
        return Scored(seed, label, said, seconds, _visible(plant_of(project), labels, label) if hidden else 0.0, unseen)


def _unseen(found: Diagnosis, label: Mapping[str, Any]) -> float:
    """Return what is left of the unseen recording over its own noise: of one that drifts, each has another."""
    scene, shown = found.search.scene, found.shown
    sizes = [label["noise_of_test"][signal.name] for signal in scene.plant.outputs]
    return relative(unseen_residuals(scene, shown.fitted, shown.noises), sizes)


def _quiet(fraction: float, label: str) -> None:
    """Report progress to nobody."""


def _visible(plant: Plant, labels: Path, label: Mapping[str, Any]) -> float:
    """Return what a diagnosis could see of the hidden effect that shows least: residual over noise, largest output.

    The plant and all other hidden effects, as they truly are, are refitted to the noise-free recording without it.
    Steps and jumps of a reading, which are no part of the fit, show by what they do to that reading.
    """
    clean = read_recording(labels / "train.csv", {})
    noises = {signal.name: max(label["noise"][signal.name], 1e-12) for signal in plant.outputs}
    scene = make_scene(plant, [clean], [], np.zeros(len(noises)))
    seen = []
    for left_out in label["effects"] or ("",):
        output = label["outputs"].get(left_out)
        if left_out == "sensor_quantization":
            rounding = label["effects"][left_out]["resolution"] / np.sqrt(12.0)
            seen.append(rounding / np.sqrt(max(noises[output] ** 2 - rounding**2, 1e-24)))
        elif left_out == "sensor_wrap":
            values = clean.columns[output]
            wrapped = folded(values, label["effects"][left_out]["range"])
            seen.append(np.sqrt(np.mean((wrapped - values) ** 2)) / noises[output])
        else:
            left = _left(scene, [name for name in label["effects"] if name != left_out], label, list(noises.values()))
            seen.append(max(np.sqrt(np.mean(left**2, axis=0)) / list(noises.values())))
    return float(min(seen))


def _left(scene: Scene, names: Sequence[str], label: Mapping[str, Any], noises: Sequence[float]) -> Array:
    """Return what the best refit leaves (n, r) beside the effects called `names`.

    A value that has no label begins mid-grid; where that leaves something to see, also with the plant as it truly is,
    at all of the grid, and where bodies meet the best is led past the kinks of that.
    """
    causes = [
        each for each in scene.causes if each.effect.name in names and each.output == label["outputs"][each.effect.name]
    ]
    grids = [_grid(scene, cause, label["effects"][cause.effect.name]) for cause in causes]
    middle = [grid[len(grid) // 2] for grid in grids]
    found = [_refitted(scene, causes, middle, noises)]
    if _shown(found[0], noises) < 1.0:
        return found[0].residuals[0]
    found.append(_refitted(scene, causes, middle, noises, label["plant"]))
    tried = [middle]
    for k in range(max(map(len, grids), default=0)):
        starts = [grid[k % len(grid)] for grid in grids]
        if starts not in tried:
            tried.append(starts)
            found.append(_refitted(scene, causes, starts, noises))
    best = min(found, key=lambda each: _shown(each, noises))
    sizes = [white(float(size)) for size in np.maximum(np.sqrt(np.mean(best.residuals[0] ** 2, axis=0)), noises)]
    return past_contacts(scene, grown(scene, best, sizes), sizes, _PATIENCE).residuals[0]


def _grid(scene: Scene, cause: Cause, told: Mapping[str, float]) -> list[dict[str, float]]:
    """Return the grid of a cause with the values that its label tells; one start where it has none."""
    known = {
        key: value
        for key, each in zip(cause.keys, cause.parameters, strict=True)
        for word, value in told.items()
        if each.name.startswith(word)
    }
    return [{**start, **known} for start in scene.starts[cause.label]] or [known]


def _shown(fitted: Fitted, noises: Sequence[float]) -> float:
    """Return the residual rms over the noise, of the output where that is largest."""
    return float(max(np.sqrt(np.mean(fitted.residuals[0] ** 2, axis=0)) / noises))


def _refitted(
    scene: Scene,
    causes: Sequence[Cause],
    starts: Sequence[Mapping[str, float]],
    noises: Sequence[float],
    plant: Mapping[str, float] = MappingProxyType({}),
) -> Fitted:
    """Refit the plant, from given values or those of `plant`, and causes from their starts to the one recording."""
    begin = first_point(scene, scene.train)
    values: Mapping[str, float] = {**begin.values, **plant}
    for cause, start in zip(causes, starts, strict=True):
        values = entered(values, cause, start)
    point, found = Point(values, begin.starts), []
    sizes = np.std([scene.train[0].columns[signal.name] for signal in scene.plant.outputs], axis=1)
    there = refit(scene, scene.train, causes, point, [white(float(size)) for size in sizes], 0)
    sizes = np.fmin(sizes, np.sqrt(np.mean(there.residuals[0] ** 2, axis=0)))  # beside more, a small effect is none
    for _ in range(_TURNS):  # a fine sensor is followed once the coarse ones have led near
        flat = [white(float(size)) for size in np.maximum(sizes, noises)]
        found.append(refit(scene, scene.train, causes, point, flat, _STEPS))
        point, sizes = found[-1].point, np.sqrt(np.mean(found[-1].residuals[0] ** 2, axis=0))
    return min(found, key=lambda each: _shown(each, noises))


def table(results: Sequence[Scored]) -> list[str]:
    """Return the lines of the score."""
    singles = [r for r in results if len(r.label["effects"]) == 1]
    seen = [r for r in singles if r.visible >= 1.0]
    nulls = [r for r in results if not r.label["effects"] and not r.label["outside"]]
    outside = [r for r in results if r.label["outside"]]
    lines = [
        f"cases {len(results)}: {len(singles)} single ({len(seen)} visible), {len(nulls)} null, {len(outside)} outside"
    ]
    lines.append(_share("single, visible: exactly named", [_exact(r) for r in seen]))
    lines.append(_share("single, visible: exactly named, or the set of what is one function", [_told(r) for r in seen]))
    lines.append(_share("single, visible: truth in the ambiguous set", [_covered(r) for r in seen]))
    lines.append(_share("single, all: named wrongly", [_wrong(r) for r in singles]))
    lines.append(_share("single, visible: silent", [r.said["verdict"] == "no_mismatch" for r in seen]))
    for color in (False, True):
        chosen = [r.said["verdict"] == "no_mismatch" for r in nulls if r.label["colored"] == color]
        lines.append(_share(f"nothing concealed, {'colored' if color else 'white'}: silent", chosen))
    for which, word in ((outside, ""), ([r for r in outside if r.visible >= 1.0], ", visible")):
        unknown = [r.said["verdict"] == "unknown_physics" for r in which]
        lines.append(_share(f"not in the library{word}: unknown_physics", unknown))
    for count, word in ((2, "pairs"), (3, "triples")):
        many = [r for r in results if len(r.label["effects"]) == count]
        lines.append(_share(f"{word} exact", [_exact(r) for r in many]))
        lines.append(_share(f"{word} exact, each effect visible", [_exact(r) for r in many if r.visible >= 1.0]))
        told = [_told(r) for r in many if r.visible >= 1.0]
        lines.append(_share(f"{word} exact, each effect visible, or the set of what is one function", told))
    placed = [
        equation_of(next(iter(r.label["effects"]))) == str(r.said["location"]["equation"]).replace("force", "torque")
        for r in seen
        if r.said["location"] and not _one_function(r)
    ]
    lines.append(_share("equation right, where it is not one function", placed))
    errors, covers = _parameters([r for r in seen if _exact(r)])
    if errors:
        lines.append(f"parameter error: median {100 * float(np.median(errors)):.2f} %, {len(errors)} parameters")
        lines.append(_share("95 % interval covers", covers))
        every = _parameters([r for r in results if _exact(r)])[1]
        lines.append(_share("95 % interval covers, several and below the noise too", every))
    after = [r.said["fit"]["test"]["after"] for r in seen if r.said["fit"].get("test", {}).get("after")]
    if after:
        lines.append(
            f"unseen residual / noise of train: median {np.median(after):.3f}, p90 {np.quantile(after, 0.9):.3f}"
        )
    own = [r.unseen for r in seen if r.unseen is not None]
    if own:
        lines.append(f"unseen residual / noise there: median {np.median(own):.3f}, p90 {np.quantile(own, 0.9):.3f}")
    # A name alone is a set of one, as where the bar was measured first.
    for verdicts, word in ((("explained", "ambiguous"), "sets of one and more"), (("ambiguous",), "ambiguous sets")):
        sets = [r for r in seen if r.said["verdict"] in verdicts]
        size = f", mean size {np.mean([len(r.said['effects']) for r in sets]):.2f}" if sets else ""
        lines.append(_share(f"{word}: hold the truth", [_covered(r) for r in sets]) + size)
    seconds = [r.seconds for r in results]
    lines.append(f"time per case: median {np.median(seconds):.2f} s, p90 {np.quantile(seconds, 0.9):.2f} s of one core")
    lines.append(_share("refused", [r.said["verdict"] == "refused" for r in results]))
    return lines


def confusion(results: Sequence[Scored]) -> list[str]:
    """Return what was said for what, where that differs."""
    counts: Counter[tuple[str, str]] = Counter()
    for r in results:
        hidden = " + ".join(sorted(r.label["effects"])) or r.label["outside"] or "nothing"
        if r.label["effects"] and r.visible < 1.0:
            hidden += " (below the noise)"
        said = " + ".join(sorted(each["name"] for each in r.said["effects"])) or r.said["verdict"]
        if r.said["verdict"] == "ambiguous":
            said = f"ambiguous: {said}"
        if hidden != said:
            counts[hidden, said] += 1
    return [f"{count:4}  {hidden}  ->  {said}" for (hidden, said), count in sorted(counts.items())]


def _names(r: Scored) -> list[str]:
    return sorted(each["name"] for each in r.said["effects"])


def _exact(r: Scored) -> bool:
    return bool(r.said["verdict"] == "explained" and _names(r) == sorted(r.label["effects"]))


def _told(r: Scored) -> bool:
    """Tell whether a name is exact, or the set is all that one sensor can say: the same function by two names."""
    return _exact(r) or _one_function(r)


def _one_function(r: Scored) -> bool:
    first, *others = r.label["sensors"]
    sets = [names for names, alone in ONE_FUNCTION if first in alone and not others]
    hidden, said = set(r.label["effects"]), set(_names(r))
    same = {name for names in sets if names & hidden for name in names}
    return r.said["verdict"] == "ambiguous" and hidden < said <= hidden | same


def _covered(r: Scored) -> bool:
    return set(r.label["effects"]) <= set(_names(r))


def _wrong(r: Scored) -> bool:
    return bool(r.said["verdict"] == "explained" and not set(_names(r)) <= set(r.label["effects"]))


def _parameters(results: Sequence[Scored]) -> tuple[list[float], list[bool]]:
    """Compare the first parameter of every effect, which is the one that says how much."""
    errors, covers = [], []
    for r in results:
        for effect in r.said["effects"]:
            for name, value in r.label["effects"][effect["name"]].items():
                key = next((key for key in effect["parameters"] if key.startswith(name)), None)
                if key is None or "phase" in name:
                    continue
                found = effect["parameters"][key]
                errors.append(abs(found["value"] - value) / max(abs(value), 1e-30))
                if found["ci95"] is not None:
                    covers.append(bool(found["ci95"][0] <= value <= found["ci95"][1]))
    return errors, covers


def _share(what: str, hits: Sequence[bool]) -> str:
    if not hits:
        return f"{what}: no such case"
    return f"{what}: {sum(hits)} of {len(hits)} ({100.0 * sum(hits) / len(hits):.1f} %)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--detail", action="store_true", help="one line per case on stderr")
    asked = parser.parse_args()
    results = []
    with ProcessPoolExecutor(asked.processes) as pool:
        for r in pool.map(work, range(asked.first, asked.first + asked.cases)):
            results.append(r)
            if asked.detail:
                hidden = ", ".join(sorted(r.label["effects"])) or r.label["outside"] or "-"
                line = (
                    f"{r.seed:5} {hidden:40} size {r.label['size']:<5} seen {r.visible:8.2f} {r.label['machine']} "
                    f"{'/'.join(r.label['sensors'])} {r.label['excitation']} {'closed ' if r.label['closed'] else ''}"
                    f"{'colored' if r.label['colored'] else 'white'} -> {r.said['verdict']} {_names(r)} "
                    f"{r.said['fit'].get('train')} unseen {r.said['fit'].get('test', {}).get('after')} own {r.unseen} "
                    f"{r.seconds:.1f} s {r.said.get('error', '')}"
                )
                print(line, file=sys.stderr, flush=True)
    print("\n".join(table(results)))
    print("\nwhat was hidden -> what was said, where they differ")
    print("\n".join(confusion(results)))


if __name__ == "__main__":
    main()
