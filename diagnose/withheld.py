"""Say which output of which recording an explanation simulates worse than the plain refit, and by how much."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from firmloop.diagnose.finding import Finding
from firmloop.diagnose.search.harmless import Harm


def withheld(finding: Finding, harmed: Mapping[str, Sequence[Harm]]) -> Finding:
    """Return the finding where its explanation does harm to recordings of "train" or "test"."""
    if harms := harmed["train"]:
        why = (
            f"begun where the readings of {_files(harms)} say, what explains it leads a simulation further off"
            f"{_figures(harms)}, as where a start that is read a hair off ends elsewhere."
        )
    else:
        harms = harmed["test"]
        why = (
            f"what explains the train recordings simulates {_files(harms)} worse{_figures(harms)}. Something differs "
            "between these recordings; take one more like that into train."
        )
    return replace(finding, says=(f"The written project is the plain refit: {why}", *finding.says))


def _files(harms: Sequence[Harm]) -> str:
    return ", ".join(dict.fromkeys(Path(each.source).name for each in harms))


def _figures(harms: Sequence[Harm]) -> str:
    """Write down what both plants miss there; the other outputs of the file may come nearer all the same."""
    one = len({each.source for each in harms}) == 1
    told = [("" if one else f"{Path(each.source).name}: ") + _misses(each) for each in harms]
    return f" ({'; '.join(told)})"


def _misses(each: Harm) -> str:
    if not math.isfinite(each.written):
        return f"{each.output.name}, which cannot be simulated {each.begun}"
    unit = f" {each.output.unit}" if each.output.unit not in ("", "1") else ""
    return f"{each.output.name} by {each.written:.3g}{unit} rms {each.begun}, the refit by {each.refit:.3g}{unit}"
