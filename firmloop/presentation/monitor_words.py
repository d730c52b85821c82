"""Tell what was seen of a running controller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.scaling import to_physical

if TYPE_CHECKING:
    from firmloop.quantize.program import Program
    from firmloop.stages.board.monitoring import Seen, Setting

BARS = " .:-=+*#%@"  # of the terminal's plot, from low to high
PLOT_WIDTH = 60


def about_settings(program: Program, settings: Sequence[Setting], seen: Seen) -> list[str]:
    """Say from when on each parameter had its new value."""
    units = {parameter.name: parameter.unit or "1" for parameter in program.parameters}
    return [
        f"{entry['name']} set to {entry['value']:.6g} {units[str(entry['name'])]} from {entry['time_s']:.6g} s on"
        for entry in set_document(program, settings, seen)
    ]


def set_document(program: Program, settings: Sequence[Setting], seen: Seen) -> list[dict[str, str | float]]:
    """Return what `--json` says of the same."""
    parameters = {parameter.name: parameter for parameter in program.parameters}
    first = int(seen.rows["step"][0])
    return [
        {
            "name": setting.name,
            "value": float(to_physical(parameters[setting.name], setting.value)[0]),
            "time_s": max(0, step - first) * program.period,
        }
        for setting, step in zip(settings, seen.set_from, strict=True)
    ]


def sparks(values: NDArray[np.float64]) -> str:
    """Draw a column in one line of characters: the mean of each stretch, from its lowest to its highest value."""
    means = np.array([part.mean() for part in np.array_split(values, min(PLOT_WIDTH, len(values)))])
    span = float(np.ptp(means)) or 1.0
    places = ((means - means.min()) / span * (len(BARS) - 1)).round().astype(int)
    return "".join(BARS[place] for place in places)
