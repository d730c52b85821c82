"""Write fleet.html: who is different, what is typical, and every figure of every machine in a picture."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from firmloop.identify.normal import NORMAL_95
from firmloop.presentation.figures import DATA, LIMIT, MODEL, styled, svg
from firmloop.presentation.fleet.words import HEAD, TYPICAL_HEAD, different_rows, notes, typical_rows, verdict
from firmloop.presentation.page import Origin, page
from firmloop.presentation.sections import page_table

if TYPE_CHECKING:
    from firmloop.stages.fleet.compare import Compared, Typical
    from firmloop.stages.fleet.member import Member

MOST_NAMES = 40  # below the picture; of more machines, those that differ alone are named


def fleet_page(name: str, command: str, members: Sequence[Member], compared: Compared) -> str:
    """Return the page."""
    title = f"<h1>{html.escape(name)}: {html.escape(verdict(compared))}</h1>"
    return page(name, "fleet", [title, *fleet_sections(members, compared)], Origin(command, ()))


def fleet_sections(members: Sequence[Member], compared: Compared) -> list[str]:
    """Return what the page holds below its title."""
    rows = [row for one in compared.different for row in different_rows(one)]
    return [
        *(["<h2>Different from the others</h2>", page_table(HEAD, rows)] if rows else []),
        *(f"<p>{html.escape(line[0].upper() + line[1:])}.</p>" for line in notes(compared)),
        *(["<h2>What is typical</h2>", page_table(TYPICAL_HEAD, typical_rows(compared))] if compared.typical else []),
        *(_figure(one, members, compared) for one in compared.typical),
        "<h2>Each recording by itself</h2>",
        page_table(
            ("machine", "recording", "verdict", "effects", ""),
            [
                (one.machine, one.name, one.verdict.replace("_", " "), ", ".join(one.effects), one.refused)
                for one in members
            ],
        ),
    ]


def _figure(typical: Typical, members: Sequence[Member], compared: Compared) -> str:
    """Draw one figure of every recording with its interval, over the band that 95 % of the machines are in."""
    held = [(one, one.figures[typical.figure]) for one in members if typical.figure in one.figures]
    values = np.array([each.value for _, each in held])
    halves = NORMAL_95 * np.array([each.deviation or 0.0 for _, each in held])
    departing = {name for one in compared.different for name in one.departing}
    odd = np.array([one.name in departing for one, _ in held])
    places = np.arange(len(held))
    reach = NORMAL_95 * typical.between
    band = (
        (typical.centre * np.exp(-reach), typical.centre * np.exp(reach))
        if typical.logarithmic
        else (typical.centre - reach, typical.centre + reach)
    )
    with styled(8.6, 2.0) as figure:
        axes = figure.subplots()
        axes.axhspan(*band, color=LIMIT, alpha=0.25, linewidth=0)
        axes.axhline(typical.centre, color=LIMIT, linewidth=0.8)
        for shown, color in ((~odd, DATA), (odd, MODEL)):
            axes.errorbar(
                places[shown], values[shown], halves[shown], fmt=".", color=color, markersize=3, elinewidth=0.8
            )
        named = odd if len(held) > MOST_NAMES else np.ones(len(held), dtype=bool)
        axes.set_xticks(places[named], [one.machine for (one, _), shown in zip(held, named, strict=True) if shown])
        axes.tick_params(axis="x", labelrotation=90, labelsize=6.5)
        axes.set_title(f"{typical.figure}, {typical.unit}" if typical.unit else typical.figure)
        return svg(figure)
