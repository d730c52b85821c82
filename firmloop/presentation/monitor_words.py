"""Tell what was seen of a running controller."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from firmloop.stages.board.tape import steps_after
from firmloop.verify.scaling import to_physical

if TYPE_CHECKING:
    from firmloop.stages.board.channels import Channel
    from firmloop.stages.board.monitoring import Watched
    from firmloop.stages.board.tape import Tape

BARS = " .:-=+*#%@"  # of the terminal's plot, from low to high
_NO_NUMBER = "!"
PLOT_WIDTH = 60
PICTURE_WIDTH = 36  # so that a line with its value fits a terminal of 80
PICTURE = 10.0  # s that the picture of a watch looks back


def about_watched(found: Watched, every: int) -> list[str]:
    """Say what was set, how many samples came, and how the controller kept its period."""
    seen, period = found.seen, found.program.period
    units = {parameter.name: parameter.unit or "1" for parameter in found.program.parameters}
    lines = [
        f"{entry['name']} set to {entry['value']:.6g} {units[str(entry['name'])]} from {entry['time_s']:.6g} s on"
        for entry in set_document(found)
    ]
    lines.append(
        f"{len(seen.rows):,} samples of {', '.join(channel.name for channel in found.channels)}, every "
        f"{every * period:g} s; lost: {seen.lost_in_image} in the image, {seen.lost_on_line} on the line"
    )
    for name, values in found.recording.columns.items():
        lost = int(np.count_nonzero(~np.isfinite(values)))
        if lost:
            first = float(found.recording.time[~np.isfinite(values)][0])
            lines.append(f"{name}: {lost:,} samples are nan or infinite, the first at {first:.6g} s, drawn as !")
    if found.steps is not None:
        lines.append(f"the controller ran {found.steps:,} steps, {found.late} of them late")
    return lines


def set_document(found: Watched) -> list[dict[str, str | float]]:
    """Return what `--json` says of the same."""
    parameters = {parameter.name: parameter for parameter in found.program.parameters}
    first = int(found.seen.rows["step"][0])
    return [
        {
            "name": made.setting.name,
            "value": float(to_physical(parameters[made.setting.name], made.setting.value)[0]),
            "time_s": steps_after(first, made.step) * found.program.period,
        }
        for made in found.seen.made
    ]


def watch_document(found: Watched) -> dict[str, object]:
    """Return the whole of it for `--json`; what could not be asked any more is null."""
    seen = found.seen
    return {
        "samples": len(seen.rows),
        "lost": {"image": seen.lost_in_image, "line": seen.lost_on_line},
        "set": set_document(found),
        "late_steps": found.late,
        "stopped": found.stopped,
    }


def picture(tape: Tape, channels: Sequence[Channel], every: float) -> list[str]:
    """Draw the last seconds of a watch that goes on, with samples `every` s: a line a signal, with its latest value."""
    rows = tape.read(max(0, len(tape) - round(PICTURE / every)), len(tape))
    if not len(rows):
        return []
    lines = []
    for channel in channels:
        values = channel.physical(rows)
        drawn = sparks(values, PICTURE_WIDTH).ljust(PICTURE_WIDTH)
        lines.append(f"{channel.column:>22} |{drawn}| {values[-1]:.6g} {channel.unit}".rstrip())
    return lines


def sparks(values: NDArray[np.float64], width: int = PLOT_WIDTH) -> str:
    """Draw a column in one line: the mean of each stretch, from its lowest to its highest value; ! is no number."""
    largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0)) or 1.0
    parts = np.array_split(values / largest, min(width, len(values)))
    with np.errstate(invalid="ignore"):
        means = np.array([part.mean() for part in parts])
    told = means[np.isfinite(means)]
    if not len(told):
        return _NO_NUMBER * len(means)
    span = float(np.ptp(told)) or 1.0
    places = ((np.where(np.isfinite(means), means, told.min()) - told.min()) / span * (len(BARS) - 1)).round()
    drawn = (BARS[int(place)] for place in places)
    return "".join(bar if is_one else _NO_NUMBER for bar, is_one in zip(drawn, np.isfinite(means), strict=True))
