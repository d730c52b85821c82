"""Say which parameters the recordings hardly tell."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.identify.fitting.covariance import Uncertainty
from firmloop.identify.plants.plant import Plant


def hardly_told(plant: Plant, free: Sequence[int], found: Uncertainty) -> tuple[str, ...]:
    """Say which of the `free` parameters (indices) of a fitted plant are blind, or cannot be told from 0."""
    said = []
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
    for index in free:
        parameter = plant.parameters[index]
        interval, unit = parameter.interval_95, f" {parameter.unit}" if parameter.unit else ""
        if interval is not None and parameter.low == 0.0 == interval[0]:
            said.append(
                f"{parameter.name} cannot be told from 0 (95 % interval up to {interval[1]:.3g}{unit}); "
                f"excite the plant more, or fix it with free = false"
            )
        elif interval is not None and parameter.low < 0.0 and interval[0] <= 0.0 <= interval[1]:
            said.append(
                f"{parameter.name} cannot be told from 0 (95 % interval {interval[0]:.2g} to {interval[1]:.2g} "
                f"{parameter.unit}".rstrip()
                + "); excite the plant more, or fix it with free = false"
            )
    return tuple(said)
