"""A test recording that the fit misses by more than its mean would: what train has told does not hold there."""

from __future__ import annotations

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence


def look(evidence: Evidence) -> tuple[str, ...]:
    """Ask each output of each test recording."""
    assert evidence.fit is not None
    return tuple(
        f"{output.name} of {score.source} is missed by {score.scores[output.name].rmse:.3g} {output.unit}".rstrip()
        + " rms, by more than its mean would: what the train recordings tell does not hold there; see that all are of "
        "one plant, unit and range of the input, or put one like it into train"
        for score in evidence.fit.test
        for output in evidence.fit.plant.outputs
        if score.scores[output.name].fit_percent < 0.0
    )


CHECK = Check("unseen", look, (), True)
