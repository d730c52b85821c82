"""Count how many of 60 simulated faults `identify` tells, and of how many of 60 sound recordings it complains.

python -m bench.host.identify_told [SEED]            (some minutes)
"""

from __future__ import annotations

import sys

from bench.host.identify_faults import Scene, faulty, sound
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.checks import first_causes, told
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.fit import estimate, judge
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import NONE
from firmloop.identify.recordings.recording import make_recording


def said_of(scene: Scene) -> list[tuple[str, str]]:
    """Return what the checks say, (check, sentence) each; a refusal counts as `refused`."""
    plant = plant_from_table(scene.table)
    recording = make_recording(scene.time, dict(scene.columns), "run.csv", "")
    try:
        fitted = estimate(plant, [recording], [], NONE)
        remarks = told(Evidence(plant, (recording,), NONE, fitted))
        if not first_causes(remarks):
            judge(fitted, [recording], NONE)
    except IdentifyError as error:
        return [("refused", str(error))]
    return [(one.check, one.says) for one in remarks]


def main() -> int:
    """Print every surprise and the two counts."""
    right, false = 0, 0
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    wrong, good = faulty(first), sound(first)
    for scene in wrong:
        said = said_of(scene)
        hit = any(check in scene.expected for check, _ in said)
        right += hit
        if not hit:
            print(f"NOT TOLD: {scene.name}: {said}", flush=True)
    for scene in good:
        said = said_of(scene)
        false += bool(said)
        if said:
            print(f"FALSE: {scene.name}: {said}", flush=True)
    print(f"{right} of {len(wrong)} faults told, {false} of {len(good)} sound recordings told")
    return 0 if right >= 57 and false == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
