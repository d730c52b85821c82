"""What fixed point does with the places that a result has no room for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Dropping:
    """The operations that drop places, and by how many units in the last place they are wrong at most."""

    end: str  # of a sum of products
    product: str
    shift: str
    error: float


ROUNDINGS = {
    "nearest": Dropping("high", "mul_shift", "shr", 0.5),
    "floor": Dropping("high_down", "mul_down", "asr", 1.0),
}
