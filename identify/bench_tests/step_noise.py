"""What the noise of one step response leaves open of the figures read off it, by drawing it anew.

A parametric bootstrap (Efron and Tibshirani, An Introduction to the Bootstrap, section 6.5): the smoothed curve gets as
much white noise as the response has, and is read again. What a rule gets wrong of a plant that is not its own, and what
differs from trial to trial, is not in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from firmloop.identify.bench_tests.step_response import StepResponse, redrawn
from firmloop.identify.error import IdentifyError
from firmloop.identify.normal import NORMAL_95

Reader = Callable[[StepResponse], Mapping[str, float]]

DRAWS, SEED = 200, 1  # 200 tell a deviation to 5 %


def noise_halves(response: StepResponse, readers: Mapping[str, Reader], draws: int) -> dict[str, dict[str, float]]:
    """Return half widths of 95 % intervals by reader and figure; none of a reader that a draw leaves without a model.

    NaN where a figure is infinite or missing in a draw.
    """
    random = np.random.default_rng(SEED)
    found: dict[str, list[Mapping[str, float]]] = {name: [] for name in readers}
    for _ in range(draws):
        drawn = redrawn(response, random)
        for name, read in readers.items():
            try:
                found[name].append(read(drawn))
            except IdentifyError:
                continue
    return {
        name: {key: _half([one[key] for one in several]) for key in several[0]} if len(several) == draws else {}
        for name, several in found.items()
    }


def _half(values: list[float]) -> float:
    return NORMAL_95 * float(np.std(values)) if all(map(math.isfinite, values)) else math.nan
