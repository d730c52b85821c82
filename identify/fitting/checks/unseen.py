"""A test recording that the fit misses by far more than those it was fitted to: what train has told fails there."""

from __future__ import annotations

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.fitting.scores import Scores

_CARRIES = 3.0  # times the worst of train, in its unit and against how far it moves, to which what holds carries over
_GOOD = 95.0  # per cent of a fit, above which none has collapsed


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each output of each test recording."""
    assert evidence.fit is not None
    found = []
    for score in evidence.fit.test:
        for output in evidence.fit.plant.outputs:
            held, told = score.scores[output.name], [one.scores[output.name] for one in evidence.fit.train]
            missed = f"{output.name} of {score.source} is missed by {held.rmse:.3g} {output.unit}".rstrip() + " rms, "
            if held.fit_percent < 0.0:
                found.append(
                    missed + "by more than its mean would: what the train recordings tell does not hold there; see "
                    "that all are of one plant, unit and range of the input, or put one like it into train"
                )
            elif all(_collapses(held, one) for one in told):
                times = held.rmse / max(one.rmse for one in told)
                found.append(
                    missed + f"{times:.2g} times what is left of any train recording: what they tell holds there in "
                    "part only; put one like it into train, or let diagnose say what is missing"
                )
    return tuple(found)


def _collapses(held: Scores, told: Scores) -> bool:
    """Tell whether a fit that leaves `told` leaves far more, beyond what comes of moving farther or less."""
    farther = held.rmse > _CARRIES * told.rmse and 100.0 - held.fit_percent > _CARRIES * (100.0 - told.fit_percent)
    return farther and held.fit_percent < _GOOD


CHECK = Check("unseen", look, (), True)
