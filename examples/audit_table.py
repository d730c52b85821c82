"""What an audit of a published study prints: one row for each published figure, its verdict, and why."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
OFFERED = "method"  # where a row tells what firmloop has for a method of the study
REPRODUCED, NOT_REPRODUCED, STATED = "reproduced", "not reproduced", "stated, not checkable"


@dataclass(frozen=True, slots=True)
class Row:
    """One published figure; `ours` is what `computed` gave, from the study's stated inputs or the simulated motor.

    A row without a computation has no verdict on the figure: it is stated, and cannot be checked.
    """

    where: str
    figure: str
    published: str
    ours: str
    verdict: str
    why: str
    computed: Callable[[], object] | None = None

    @property
    def reproduced(self) -> bool:
        """Tell whether the published figure came out."""
        return self.verdict == REPRODUCED


def rounding(printed: str) -> float:
    """Return half a unit of the last printed digit: as far as rounding may have moved the figure."""
    return 0.5 * 10.0 ** -len(printed.partition(".")[2])


def compared(where: str, figure: str, printed: str, unit: str, computed: Callable[[], float], why: str) -> Row:
    """Compute a printed number: it is reproduced within the rounding of its own digits."""
    ours = computed()
    ours = 0.0 if abs(ours) < 1e-4 * rounding(printed) else ours
    verdict = REPRODUCED if abs(float(printed) - ours) <= 1.0001 * rounding(printed) else NOT_REPRODUCED
    return Row(where, figure, f"{printed} {unit}".strip(), f"{ours:.4g} {unit}".strip(), verdict, why, computed)


def judged(where: str, figure: str, published: str, computed: Callable[[], tuple[str, bool]], why: str) -> Row:
    """Compute what a statement is about: the text to show, and whether the statement holds by it."""
    ours, holds = computed()
    return Row(where, figure, published, ours, REPRODUCED if holds else NOT_REPRODUCED, why, computed)


def stated(where: str, figure: str, published: str, why: str) -> Row:
    """Return the row of a figure that rests on what the study does not give."""
    return Row(where, figure, published, "-", STATED, why)


def repeated(where: str, figure: str, printed: str, elsewhere: str, place: str) -> Row:
    """Hold a figure against another place of the study: the same again proves nothing, another one contradicts."""
    if printed == elsewhere:
        return stated(where, figure, printed, f"the same as in {place}")
    return judged(where, figure, printed, lambda: (elsewhere, printed == elsewhere), f"contradicted by {place}")


def implied(where: str, figure: str, published: str, computed: Callable[[], str], why: str) -> Row:
    """Return the row of a figure that cannot be checked, with what it would mean or what a consistent one would be."""
    return Row(where, figure, published, computed(), STATED, why, computed)


def document(title: str, notes: Sequence[str], rows: Sequence[Row]) -> str:
    """Write the report as Markdown."""
    figures = [row for row in rows if row.where != OFFERED]
    count = ", ".join(
        f"{sum(row.verdict == verdict for row in figures)} {verdict}"
        for verdict in (REPRODUCED, NOT_REPRODUCED, STATED)
    )
    head = (
        f"{len(figures)} published figures and statements: {count}; each with the reason. Reproduced is what comes out "
        f"within the rounding of the printed figure. Below them {len(rows) - len(figures)} methods that the study uses "
        "or proposes."
    )
    lines = [f"# {title}", "", head, "", *notes, ""]
    lines += ["| where | figure | published | ours | verdict | why |", "|---|---|---|---|---|---|"]
    for row in rows:
        cells = (row.where, row.figure, row.published, row.ours, row.verdict, row.why)
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def step_figures(time: Array, response: Array, final: float) -> dict[str, float]:
    """Rise time 10-90 %, settling 2 % and 5 % (s), overshoot (%) of a response from rest towards `final`."""
    share = response / final
    reach = [float(np.interp(level, np.maximum.accumulate(share), time)) for level in (0.1, 0.9)]
    found = {"rise": reach[1] - reach[0], "overshoot": 100 * max(0.0, float(share.max()) - 1)}
    for band in (2, 5):
        outside = np.flatnonzero(np.abs(share - 1) > band / 100)
        found[f"settling_{band}"] = (
            float(time[outside[-1] + 1]) if len(outside) and outside[-1] + 1 < len(time) else 0.0
        )
    return found


def second_order_step(time: Array, natural: float, damping: float) -> Array:
    """Return the unit step of wn^2/(s^2 + 2 zeta wn s + wn^2), damping below 1."""
    damped = natural * math.sqrt(1 - damping**2)
    swing = np.cos(damped * time) + damping * natural / damped * np.sin(damped * time)
    return 1 - np.exp(-damping * natural * time) * swing


def overshoot(damping: float) -> float:
    """Return the overshoot in % of the standard second-order form (Franklin, Powell, Emami-Naeini, section 3.4)."""
    return 100 * math.exp(-math.pi * damping / math.sqrt(1 - damping**2)) if damping < 1 else 0.0


def damping_of(percent: float) -> float:
    """Return the damping ratio that gives an overshoot of `percent`."""
    swing = math.log(percent / 100)
    return -swing / math.hypot(math.pi, swing)


def run(describe: str, made: Callable[[], str], draw: Callable[[Path], Sequence[str]]) -> None:
    """Print the report; with --out write it and the figures there."""
    parser = argparse.ArgumentParser(description=describe)
    parser.add_argument("--out", type=Path, help="folder for report.md and the figures")
    given = parser.parse_args()
    text = made()
    print(text, end="")
    if given.out:
        given.out.mkdir(parents=True, exist_ok=True)
        shown = "".join(f"\n![{name}]({name})\n" for name in draw(given.out))
        (given.out / "report.md").write_text(text + shown, encoding="utf-8")
