"""What an audit of a published study prints: one row for each published figure, reproduced or not, and why."""

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


@dataclass(frozen=True, slots=True)
class Row:
    """One published figure; `ours` is what its own stated inputs and formula give, or what a consistent value is."""

    where: str
    figure: str
    published: str
    ours: str
    reproduced: bool
    why: str


def compared(where: str, figure: str, published: float, ours: float, unit: str, digits: int, why: str) -> Row:
    """Compare a printed number with its formula: they agree within half a unit of the last of its `digits`."""
    step = 10.0 ** (math.floor(math.log10(abs(published))) + 1 - digits) if published else 10.0**-digits
    agrees = abs(published - ours) <= 0.5001 * step
    return Row(where, figure, f"{published:g} {unit}".strip(), f"{ours:.4g} {unit}".strip(), agrees, why)


def missing(where: str, figure: str, published: str, why: str, ours: str = "-") -> Row:
    """Return the row of a figure that rests on data the study does not give, or that cannot be."""
    return Row(where, figure, published, ours, False, why)


def document(title: str, notes: Sequence[str], rows: Sequence[Row]) -> str:
    """Write the report as Markdown."""
    figures = [row for row in rows if row.where != OFFERED]
    good = sum(row.reproduced for row in figures)
    head = (
        f"{len(figures)} published figures and statements: {good} reproduced, {len(figures) - good} not reproducible, "
        f"each with the reason. Below them {len(rows) - len(figures)} methods that the study uses or proposes."
    )
    lines = [f"# {title}", "", head, "", *notes, ""]
    lines += ["| where | figure | published | ours | verdict | why |", "|---|---|---|---|---|---|"]
    for row in rows:
        verdict = "reproduced" if row.reproduced else "not reproducible"
        verdict = "offered" if row.where == OFFERED else verdict
        cells = (row.where, row.figure, row.published, row.ours, verdict, row.why)
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
