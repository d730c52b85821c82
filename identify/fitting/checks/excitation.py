"""An input that never changes, or holds fewer frequencies than the plant has unknowns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.hardly_told import MISSING, POOR, hardly_known, told_together
from firmloop.identify.plants.operating_point import OUTPUT
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.stillness import FEWEST

Array = NDArray[np.float64]

_SEEN = 1e-3  # of the strongest frequency's power
_A_STEP = 0.5  # of an input's range, in one row
_WIDTH = 8  # bins that one sine takes at most under a Hann window


def look(evidence: Evidence) -> tuple[str, ...]:
    """Count frequencies of the inputs against free parameters; name what is hardly known after a fit."""
    plant = evidence.given
    names = [each.name for each in plant.inputs]
    name = names[0]
    drives = [recording.columns[name] for recording in evidence.recordings]
    if not any(parameter.free for parameter in plant.parameters):
        return ()
    pushes = [[recording.columns[one] for one in names] for recording in evidence.recordings]
    still = all(np.ptp(push) == 0.0 for together in pushes for push in together)
    one_level = still and np.ptp(np.concatenate(drives)) == 0.0  # steps of several heights, one a recording, tell it
    if one_level and any(parameter.name == "gain" and parameter.free for parameter in plant.parameters):
        return (
            f"{name} is {drives[0][0]:g} in every row, so that a gain cannot be told from a level of rest: record the "
            "plant while its input changes, or fix one of the two with free = false",
        )
    free = sum(parameter.free for parameter in plant.parameters)
    if not plant.remembers and not still:
        return _levels(plant, free, drives) or _poorly(evidence)
    lines = max(sum(frequencies(push) for push in together if np.ptp(push)) for together in pushes)
    needed = -(-free // (2 * len(plant.outputs)))
    stepped = any(_steps(push) for together in pushes for push in together)
    # What moves by itself, as a decay does, is judged by its intervals.
    if lines < needed and not still and not stepped:
        hold = f"{name} holds" if len(names) == 1 else f"{' and '.join(names)} hold"
        return (
            f"{hold} {lines} frequenc{'y' if lines == 1 else 'ies'}, and {free} free parameters of "
            f"{len(plant.outputs)} output{'s' if len(plant.outputs) > 1 else ''} need {needed}: record steps or a "
            "sweep (firmloop excite makes one), or fix parameters with free = false",
        )
    return _few_rows_tell(evidence) or _poorly(evidence)


def _few_rows_tell(evidence: Evidence) -> tuple[str, ...]:
    """Say that a gain and a level of rest are told apart by the few rows before the only step.

    Not of a recording that is taken to begin at rest, and not where steps end at several levels.
    """
    plant, drives = evidence.given, [each.columns[evidence.given.inputs[0].name] for each in evidence.recordings]
    free = {each.name for each in plant.parameters if each.free}
    steps = [np.flatnonzero(np.diff(drive)) + 1 for drive in drives]
    one = all(len(each) == 1 and each[0] < FEWEST for each in steps) and len({drive[-1] for drive in drives}) == 1
    if not {"gain", OUTPUT} <= free or not one or any(each.from_rest for each in evidence.recordings):
        return ()
    drive, rows = drives[0], int(steps[0][0])
    return (
        f"{plant.inputs[0].name} changes once, from {drive[0]:g} to {drive[-1]:g} after {rows} row"
        f"{'s' if rows > 1 else ''}, which alone tell gain and {OUTPUT} apart: record longer before the step, or give "
        f"{OUTPUT} with free = false",
    )


def _levels(plant: Plant, free: int, drives: Sequence[Array]) -> tuple[str, ...]:
    """Count levels of the input: a curve without memory has no frequencies, and a value at each level."""
    levels, needed = len(np.unique(np.concatenate(drives))), -(-free // len(plant.outputs))
    if levels >= needed:
        return ()
    return (
        f"{plant.inputs[0].name} holds {levels} level{'s' if levels > 1 else ''}, and {free} free parameters of "
        f"{len(plant.outputs)} output{'s' if len(plant.outputs) > 1 else ''} need {needed}: record more levels, or fix "
        "parameters with free = false",
    )


def _poorly(evidence: Evidence) -> tuple[str, ...]:
    """Name what is hardly known after a fit."""
    poor = _hardly_known(evidence)
    if poor and evidence.fit is not None:
        too_little = (
            "the input moves the plant too little against what is left: drive it further, or longer, or ask firmloop "
            "diagnose whether that is noise"
        )
        why = MISSING if evidence.fit.slow else too_little
        return (f"{', '.join(poor)}: known to no better than {100.0 * POOR:.0f} %; {why}",)
    return ()


def frequencies(drive: Array) -> int:
    """Return how many sines an input (n,) holds at most."""
    away = (drive - drive.mean()) * np.hanning(len(drive))
    power = np.abs(np.fft.rfft(away)) ** 2
    return -(-int(np.sum(power > _SEEN * power.max())) // _WIDTH)


def _steps(drive: Array) -> bool:
    """Tell whether an input (n,) goes most of its way in one row: a step holds every frequency, wherever it stands."""
    return float(np.max(np.abs(np.diff(drive)), initial=0.0)) > _A_STEP * float(np.ptp(drive)) > 0.0


def _hardly_known(evidence: Evidence) -> list[str]:
    if evidence.fit is None:
        return []
    known = {parameter.name: parameter for parameter in evidence.fit.plant.parameters}
    free = [known[name] for name in evidence.fit.free]
    together = told_together(evidence.fit.covariance, free)  # more of the same input would not tell them apart
    return [
        each.name
        for each in free
        if each.name not in together
        and (each.logarithmic or each.name == "gain")
        and hardly_known(each)
        and not each.may_be_zero  # the fit says so already
    ]


CHECK = Check("excitation", look, (), False)
