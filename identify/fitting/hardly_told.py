"""Say which parameters the recordings hardly tell, and which of those they only tell together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.fitting.covariance import Uncertainty
from firmloop.identify.plants.plant import Parameter, Plant

Array = NDArray[np.float64]

POOR = 0.5  # relative half-width of a 95 % interval, from which a parameter is hardly known
MISSING = (
    "what is left moves slowly, as noise of a sensor does not: ask firmloop diagnose what is missing before you record "
    "more"
)
_TOGETHER = 0.98  # correlation of two estimates, from which five times less is left of each once the other is known


def hardly_told(plant: Plant, free: Sequence[int], found: Uncertainty, slow: bool) -> tuple[str, ...]:
    """Say which of the `free` parameters (indices) of a fitted plant are blind, or cannot be told from 0.

    Where what is left is `slow`, it widens the intervals, and no further recording would narrow them.
    """
    said = []
    cure = f"{MISSING}, or fix it with free = false" if slow else "excite the plant more, or fix it with free = false"
    names = [plant.parameters[free[k]].name for k in found.blind]
    if len(names) == 1:
        said.append(
            f"{names[0]} leaves no trace in these recordings, so that its value means nothing; fix it with free = false"
        )
    elif names:
        said.append(
            f"{', '.join(names)} cannot be told apart from these recordings: {found.combinations} combination(s) of "
            f"them change no output, and no intervals are given; fix {found.combinations} of them with free = false, "
            f"record another output, or choose a simpler kind"
        )
    together = told_together(found.covariance, [plant.parameters[index] for index in free])
    if together:
        said.append(
            f"{', '.join(together[:-1])} and {together[-1]} are only known together: in these recordings a change of "
            "one undoes that of another; fix one with free = false, record another output, or drive the plant where "
            "they differ"
        )
    for index in free:
        parameter = plant.parameters[index]
        interval, unit = parameter.interval_95, f" {parameter.unit}" if parameter.unit else ""
        if parameter.name in together:
            continue
        if interval is not None and parameter.low == 0.0 == interval[0]:
            said.append(f"{parameter.name} cannot be told from 0 (95 % interval up to {interval[1]:.3g}{unit}); {cure}")
        elif interval is not None and parameter.low < 0.0 and parameter.may_be_zero:
            said.append(
                f"{parameter.name} cannot be told from 0 (95 % interval {interval[0]:.2g} to {interval[1]:.2g} "
                f"{parameter.unit}".rstrip()
                + f"); {cure}"
            )
    return tuple(said)


def hardly_known(parameter: Parameter) -> bool:
    """Tell whether a fitted parameter is known to no better than `POOR`; not of one that leaves no trace."""
    return parameter.deviation is not None and 1.96 * parameter.deviation > POOR * abs(parameter.value)


def told_together(covariance: Array, parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Return the parameters, of which `covariance` (f, f) is one, that are hardly known alone, but well with another.

    Their estimates are correlated: the one is known once the other is.
    """
    spread = np.sqrt(np.diag(covariance))
    poor = np.array([hardly_known(each) for each in parameters], dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.abs(covariance / np.outer(spread, spread)) > _TOGETHER
    np.fill_diagonal(alike, False)
    known = np.any(alike & poor[None, :], axis=1) & poor
    return tuple(p.name for p, each in zip(parameters, known, strict=True) if each)
