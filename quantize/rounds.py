"""What fixed point does with the places that a result has no room for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Dropping:
    """The operations that drop places, and by how many units in the last place they are wrong at most."""

    start: str  # of a sum of products
    end: str
    product: str
    shift: str
    error: float


ROUNDINGS = {
    "nearest": Dropping("acc", "high", "mul_shift", "shr", 0.5),
    "floor": Dropping("acc_down", "high_down", "mul_down", "asr", 1.0),
}
