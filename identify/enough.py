"""Refuse recordings that are too short for the model that is asked of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.experiment import Experiment
from identify.linear import linearize
from identify.plant import IdentifyError, Plant

_BY_PARAMETER = 5  # readings: fewer, and an interval rests on a guess of the noise
_BY_STATE = 2  # readings for each initial state, of which every window has its own
_SETTLED = 3.0  # time constants: within 5 % of the final value
_DRIFTS = 100.0  # recordings: a time constant as long as that is none
_NOISE_FREE = 1e-6  # of a state's largest slope: a pole of zero and what rounding makes of it


def check_rows(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where there are too few readings for the unknowns."""
    parts = [made for windows in recordings for made in windows]
    free, states = sum(parameter.free for parameter in plant.parameters), len(plant.states) * len(parts)
    outputs = len(plant.outputs)
    rows = sum(len(made.target) for made in parts)
    needed = -(-(_BY_PARAMETER * free + _BY_STATE * states) // outputs)
    if rows < needed:
        sources = ", ".join(dict.fromkeys(made.source for made in parts))
        raise IdentifyError(
            f"{sources}: {rows} rows are too few for {plant.kind}: {free} free parameters and {states} initial states "
            f"need at least {needed} rows of {outputs} output{'s' if outputs > 1 else ''} ({_BY_PARAMETER} readings "
            f"for each parameter, {_BY_STATE} for each state); record longer, or fix parameters with free = false"
        )


def check_span(plant: Plant, recordings: Sequence[Sequence[Experiment]]) -> None:
    """Raise IdentifyError where a gain is wanted and the recordings end before the fitted plant can show it.

    Where some of the dynamics are given, what was asked may be a ratio of the gain and those: a mass, say.
    """
    if not all(parameter.free for parameter in plant.parameters if parameter.name != "delay_s"):
        return
    if not any(parameter.name == "gain" for parameter in plant.parameters):
        return
    poles = np.linalg.eigvals(linearize(plant).a)
    poles = poles[np.abs(poles) > _NOISE_FREE * np.max(np.abs(poles), initial=0.0)]
    decays = -np.real(poles)
    if not len(decays) or np.min(decays) <= 0.0:
        return
    slowest = 1.0 / float(np.min(decays))
    parts = [made for windows in recordings for made in windows]
    spans = [float(made.course.time[made.course.end - 1] - made.course.time[made.course.first]) for made in parts]
    longest = int(np.argmax(spans))
    if slowest > _DRIFTS * spans[longest]:
        raise IdentifyError(
            f"{parts[longest].source}: the output drifts and does not settle within its {spans[longest]:.3g} s, so "
            f"that {plant.kind} has no gain; take the drift out with [recordings.conditioning] detrend, record longer, "
            "or fix gain with free = false"
        )
    if spans[longest] < slowest:
        raise IdentifyError(
            f"{parts[longest].source}: {spans[longest]:.3g} s are too short for {plant.kind}: its slowest time "
            f"constant comes out as {slowest:.2g} s, so that its gain lies beyond what was recorded; record at least "
            f"{_SETTLED * slowest:.2g} s ({_SETTLED:.0f} time constants), or fix gain with free = false"
        )
