"""Go on searching as long as what is left has a shape: a large effect must not hide a small one."""

from __future__ import annotations

import time

from diagnose.plain import believed
from diagnose.rank import MOST_EFFECTS, Progress, Search, further
from diagnose.shape import Shape, best_shape

LEFT = 60.0  # drop of BIC by a shape, from which an explanation is not the whole of it
_PATIENCE = 15.0  # s of computing after which nothing further is looked for


def completed(found: Search, progress: Progress) -> tuple[Search, Shape | None]:
    """Return the search that is believed, with what a shape still shows, and the shape of what it leaves over."""
    quick, found = found, believed(found, progress)
    progress(0.9, "looking for what has no name")
    shape = best_shape(found, found.best)
    begun = time.process_time()
    while (
        found is quick
        and found.gains
        and shape is not None
        and shape.gain > LEFT
        and len(found.best.fitted.causes) < MOST_EFFECTS
        and time.process_time() - begun < _PATIENCE
    ):
        more = further(found)
        rest = None if more is None else best_shape(more, more.best)
        if more is None or (rest is not None and rest.gain > shape.gain):
            break
        quick, found, shape = more, more, rest
    return found, shape
