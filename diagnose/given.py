"""Begin where the plant was given: a refit may have run far away to hide what is missing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from firmloop.diagnose.descent import residual_of
from firmloop.diagnose.hypothesis import Cause, Point, Scene, entered, first_point
from firmloop.diagnose.orders import best_orders
from firmloop.diagnose.refit import Fitted, fit
from firmloop.diagnose.rival import Rival, extended, joined
from firmloop.diagnose.screen import Screened, ground, screen
from firmloop.diagnose.unfold import from_unfolded
from firmloop.identify.fitting.noise import colored, flat

_STEPS = 6  # of a trial
_MOVED, _FIRM = 0.15, 0.05  # of a parameter, as a logarithm: far from where it was given; well determined
_FAR_OFF = 1.5  # factor on a nominal parameter that has run away
_LOST = 6.0  # the same, so far that what hides behind it does not show beside what was found
_FOLD = 0.03  # of the largest reading: noise of one that is never negative
_GIVEN = 3  # causes tried beside the parameters as given


def from_given(scene: Scene, rival: Rival) -> tuple[Fitted, ...]:
    """Try the causes that help most beside the parameters as given: a refit may have run far away to hide one.

    Beside effects that were found, what has not run away stays.
    """
    sizes, found = flat(rival.noises), rival.fitted
    told: set[str] = set()
    if found.causes:
        away = runaways(scene, found, _LOST)
        calm, begin = not away, Point({**found.point.values, **away}, found.point.starts)
    else:
        told = {cause.label for cause in scene.causes if _folded(scene, cause)}
        calm = not told and not (colored(rival.noises) and _ran_away(scene, rival))
        begin = first_point(scene, scene.train)
    if calm:
        return ()
    given = fit(scene, scene.train, found.causes, begin, sizes, 0)
    under = [ground(scene, scene.train, given, sizes)]
    others = [cause for cause in scene.causes if cause not in found.causes]
    (screened,) = screen(scene, scene.train, given, others, under, best_orders(scene, given, under))
    picked = [one for k, one in enumerate(screened) if k < _GIVEN or one.cause.label in told]
    tried = [fit(scene, scene.train, *extended(given, each.cause, each.start), sizes, _STEPS) for each in picked]
    return (*tried, *(from_unfolded(scene, cause) for cause in others if cause.label in told))


def _folded(scene: Scene, cause: Cause) -> bool:
    """Tell whether a reading is never negative where the plant as given would go both ways."""
    if cause.effect.seen_by != "folds" or cause.output is None:
        return False
    index = [signal.name for signal in scene.plant.outputs].index(cause.output)
    begin = first_point(scene, scene.train)
    for k, recording in enumerate(scene.train):
        values = recording.columns[cause.output]
        ours = values - residual_of(scene, recording, begin, k)[:, index]
        top = float(values.max())
        if float(values.min()) < -_FOLD * top or not float(np.nanmin(ours)) < -10.0 * _FOLD * top:
            return False
    return True


def _ran_away(scene: Scene, nominal: Rival) -> bool:
    """Tell whether a refit has moved a parameter that the recordings determine well far from where it was given."""
    given = {p.name: p.value for p in scene.plant.parameters}
    sizes = np.maximum(np.diag(nominal.fitted.normal), 1e-300)
    for each, size in zip(nominal.fitted.coordinates, sizes, strict=False):
        if each.logarithmic and size * _FIRM**2 > 1.0:
            if abs(each.inner(nominal.fitted.point.values[each.name]) - each.inner(given[each.name])) > _MOVED:
                return True
    return False


def runaways(scene: Scene, fitted: Fitted, factor: float = _FAR_OFF) -> dict[str, float]:
    """Return the values as given of free nominal parameters that a fit has moved by a factor from there.

    An inertia that causes have taken a part of has not gone with it.
    """
    values, found = fitted.point.values, {}
    for p in scene.plant.parameters:
        taken = sum(
            values[cause.taken[0]] for cause in fitted.causes if cause.taken is not None and cause.taken[1] == p.name
        )
        if p.free and p.value > 0.0 and not 1.0 / factor < (values[p.name] + taken) / p.value < factor:
            found[p.name] = p.value
    return found


def afresh(scene: Scene, base: Fitted, screened: Screened) -> tuple[tuple[Cause, ...], Point]:
    """Add a cause, all of them from their grids and the plant as given: what ran away without it may not come back."""
    causes, _ = joined(base, screened.cause)
    begin = first_point(scene, scene.train)
    values: Mapping[str, float] = begin.values
    for cause in causes:
        grid = scene.starts[cause.label]
        values = entered(values, cause, grid[len(grid) // 2] if grid else {})
    return causes, Point(values, begin.starts)
