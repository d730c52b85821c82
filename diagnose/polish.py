"""Take a fit by simulation error to its very end, past the kinks that limits make.

Parameters that trade with each other need more steps than a search gives. A limit has a kink in its cost at every row
that just reaches it, where a search ends too early; it starts again with each limit moved a little.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from diagnose.hypothesis import Cause, Point, Scene
from diagnose.refit import Fitted, fit
from identify.attach import with_effects
from identify.condition import NONE
from identify.experiment import experiments
from identify.noise import Noise
from identify.plant import EffectUse
from identify.problem import Point as Place
from identify.problem import make_problem, solve
from identify.simulate import constants_of, simulator

_STEPS = 60
_NUDGES = (0.97, 1.03, 0.9, 1.1)
_PATIENCE = 15.0  # s of computing


def polished(scene: Scene, fitted: Fitted, noises: Sequence[Noise]) -> Fitted:
    """Return the fit at its minimum of the plain squared error, outputs weighted by 1 / noise rms."""
    values = fitted.point.values
    uses = [
        EffectUse(
            cause.effect.name,
            cause.output,
            {each.name: values.get(key, each.neutral) for key, each in zip(cause.keys, cause.parameters, strict=True)},
            tuple(each.name for each in cause.parameters),
        )
        for cause in fitted.causes
    ]
    nominal = tuple(replace(p, value=values.get(p.name, p.value)) for p in scene.plant.parameters)
    plant = with_effects(replace(scene.plant, parameters=nominal), uses)
    engine = simulator(plant, scene.train[0].hold)
    problem = make_problem(plant, engine, [experiments(plant, recording, NONE) for recording in scene.train])
    problem = replace(problem, weights=np.array([1.0 / noise.rms for noise in noises]))
    starts = np.stack([start[: engine.states] for start in fitted.point.starts])
    constants = constants_of(plant)
    place, cost = solve(problem, Place(constants, starts), _STEPS)
    kinked = limits(fitted.causes)
    places = [k for k, p in enumerate(plant.parameters) if p.name in kinked]
    begun_at = time.process_time()
    for index in places:
        for factor in _NUDGES:
            if time.process_time() - begun_at > _PATIENCE:
                break
            nudged = place.constants.copy()
            nudged[index] *= factor
            trial, less = solve(problem, Place(nudged, place.starts), _STEPS)
            if less < cost:
                place, cost = trial, less
    moved = {p.name: float(value) for p, value in zip(plant.parameters, place.constants, strict=True)}
    begun = tuple(
        np.concatenate([near, start[engine.states :]])
        for near, start in zip(place.starts, fitted.point.starts, strict=True)
    )
    return fit(scene, scene.train, fitted.causes, Point({**values, **moved}, begun), noises, 0)


def limits(causes: Sequence[Cause]) -> set[str]:
    """Name the parameters that bound something: they are neutral where they are infinite."""
    return {
        key
        for cause in causes
        for key, each in zip(cause.keys, cause.parameters, strict=True)
        if math.isinf(each.neutral)
    }
