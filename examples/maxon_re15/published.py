"""What the RE 15 study prints: its table 1, and where it says the same again in words."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Printed:
    """One row of table 1, figures as printed."""

    rise: str  # s
    overshoot: str  # %
    settling: str  # s
    error: str  # %, in steady state


TABLE = {
    "open loop, order 1": Printed("0.35", "22.8", "1.42", "8.5"),
    "closed loop, order 1": Printed("0.16", "7", "0.62", "0.7"),  # the 7 as far as it is legible
    "open loop, order 2": Printed("0.39", "24.6", "1.5", "8.7"),
    "closed loop, order 2": Printed("0.18", "2.9", "0.6", "0.3"),
}
ABSTRACT = Printed("0.18", "3.1", "", "")
CONCLUSION = Printed("0.18", "2.9", "0.6", "0.3")
SAMPLING_KHZ = "10"
