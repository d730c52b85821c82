"""Say where a finding fails by far on the test recordings: they judge it, and choose nothing."""

from __future__ import annotations

from dataclasses import replace

from firmloop.diagnose.finding import Finding
from firmloop.diagnose.rival import HELD

FAR = 20.0  # residual over noise on unseen recordings from which nothing that was fitted holds there
WORSE = 10.0  # times the residual on those that were fitted


def with_doubt(finding: Finding) -> Finding:
    """Return the finding, with a note where train and test contradict each other."""
    test, train = finding.test, finding.train
    if test is None or test.after is None or train.after is None:
        return finding
    if test.after < FAR or test.after < WORSE * train.after:
        return finding
    if test.refit is not None and test.after < HELD * test.refit:
        return finding
    said = (
        f"the test recordings do not follow from what the train recordings tell: {test.after:.3g} times the noise is "
        f"left there, {train.after:.3g} times here; another machine, unit or regime, so check that all are of one plant"
    )
    return replace(finding, notes=(*finding.notes, said), says=(*finding.says, f"Note: {said}."))
