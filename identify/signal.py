"""A Signal: one named physical quantity with its unit and its range."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Signal:
    """One physical quantity; `low` and `high` are in `unit`."""

    name: str
    unit: str
    low: float
    high: float
