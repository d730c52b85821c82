"""Refuse a drive whose direction stands in another column: pwm beside dir, or the two inputs of a bridge."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.guess import Guessed
from firmloop.identify.recordings.table import RawTable

Array = NDArray[np.float64]

_RATHER = 0.25  # of what the drive leaves without a direction: with one it has to leave less


def refuse_without_direction(
    drive: Guessed, outputs: Sequence[Guessed], table: RawTable, file: str, explains: Callable[[Array, Array], float]
) -> None:
    """Refuse a drive that is never negative, and tells the output far better with a direction that is recorded, too.

    `explains` returns the share of a signal that a drive explains; a position is asked about by its speed.

    Raises
    ------
    IdentifyError
        with what to write into one column.
    """
    whole = table.with_states(table.states)
    held = dict(zip(whole.names, whole.columns, strict=True))
    pushes, read = held[drive.foreign], held[outputs[0].foreign]
    if drive.drives <= 0 or np.min(pushes) < 0.0 or not np.any(pushes):
        return

    def left(signal: Array) -> float:
        return 1.0 - max(explains(signal, read), explains(signal, np.gradient(read)))

    plain, named = left(pushes), {drive.foreign, *(each.foreign for each in outputs)}
    for name, other in held.items():
        if name in named or np.min(other) == np.max(other):
            continue
        ways = np.unique(other)
        if len(ways) == 2 and left(np.where(other == ways[1], pushes, -pushes)) < _RATHER * plain:
            words = f" ({table.states[name][1]})" if name in table.states else ""
            raise IdentifyError(
                f"{file}: {drive.foreign} has no sign, and its direction stands in {name}{words}: "
                f"{outputs[0].foreign} follows it only with a minus where {name} is {ways[0]:g} (or, turned around, "
                f"where it is {ways[1]:g}); write it so, in one column, and leave {name} out"
            )
        turns = np.min(other) == 0.0 and not np.any(pushes * other)
        if turns and left(pushes - other) < _RATHER * min(plain, left(other)):
            one, two = sorted((drive.foreign, name))
            raise IdentifyError(
                f"{file}: {one} and {two} push in opposite directions, one at a time, as the inputs of a bridge: write "
                f"{one} - {two} in one column, and leave both out"
            )
