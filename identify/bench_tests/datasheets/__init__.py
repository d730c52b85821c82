"""Datasheets: what they print, and how the figures hang together; every module of this folder with a `SHEET` is one.

A sheet says more than it has to: most figures follow from others. Each relation is one check, and where a figure is not
given, a way to it. The standard tests of the same machine are measurements in place of figures.
"""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from firmloop.identify.bench_tests.quantity import in_si
from firmloop.identify.bench_tests.standard_tests import Measured
from firmloop.identify.bench_tests.unit_slips import Slip, unit_slip
from firmloop.identify.error import IdentifyError


@dataclass(frozen=True, slots=True)
class Relation:
    """`figure` follows from `needs`, in their order, by `formula`; `says` is the formula, `source` where it stands."""

    figure: str
    needs: tuple[str, ...]
    formula: Callable[..., float]
    says: str
    source: str


@dataclass(frozen=True, slots=True)
class StandardTest:
    """`run` takes lists of `readings` by name, or a Recording where `recorded`; then what is `needed` and known."""

    readings: tuple[str, ...]
    needed: tuple[str, ...]
    run: Callable[[Any, Mapping[str, Measured]], Mapping[str, Measured]]

    @property
    def recorded(self) -> bool:
        """Whether it takes a recording."""
        return self.readings == RECORDING


RECORDING = ("recording",)


@dataclass(frozen=True, slots=True)
class Sheet:
    """The figures of one kind of machine with the SI dimension of each, and the relations between them.

    `parameters` names the plant's parameters and the figure each one is; `tests` are in the order in which they build
    on each other. `inputs` and `outputs` are the ends of the plant where a project names none, `slips` what is taken
    for what in such sheets besides units. `counted` are figures that are exact, and multiples of what stands there.
    """

    kind: str
    figures: Mapping[str, str]
    relations: tuple[Relation, ...]
    parameters: Mapping[str, str]
    tests: Mapping[str, StandardTest]
    inputs: tuple[str, ...] = ("voltage_V",)
    outputs: tuple[str, ...] = ("speed_rad_s",)
    slips: tuple[Slip, ...] = ()
    counted: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A figure that the others do not lead to.

    `share` is by how much it is off, relative to what they lead to; infinite where that is 0 or less.
    """

    figure: str
    printed: float  # SI
    computed: float  # SI
    share: float
    relation: Relation
    others: tuple[str, ...]  # printed figures that lead elsewhere
    tolerance: float  # share

    def sentence(self, sheet: Sheet) -> str:
        """Say which figures, by how much, and which slip of a unit would explain it."""
        unit = f" {sheet.figures[self.figure]}".removesuffix(" 1")
        others = " and ".join(self.others)
        lead = "leads" if len(self.others) == 1 else "lead"
        units = [sheet.figures[name] for name in (self.figure, *self.others)]
        slip = unit_slip(1.0 + self.share, self.tolerance, units, sheet.slips)
        by = (
            f"{self.share:+.1%}"
            if math.isfinite(self.share)
            else "none can be 0 or less, so that one of these is wrong"
        )
        check = f"; {slip}: check the units of these figures" if slip else ""
        return (
            f"{self.figure} is {self.printed:.4g}{unit}, but {others} {lead} to {self.computed:.4g}{unit} "
            f"({self.relation.says}): {by}{check}"
        )


@dataclass(frozen=True, slots=True)
class Reading:
    """A sheet in SI: what it printed, what followed, by which relation, and what contradicts what.

    `halves` is how far each figure may be off where every printed one may be off by the tolerance, each on its own.
    """

    figures: Mapping[str, float]
    halves: Mapping[str, float]
    derived: Mapping[str, Relation]
    contradictions: tuple[Contradiction, ...]


@cache
def sheets() -> Mapping[str, Sheet]:
    """Every sheet of this folder, by the plant's kind."""
    modules = [importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__)]
    return {module.SHEET.kind: module.SHEET for module in modules}


def read_sheet(sheet: Sheet, table: Mapping[str, object], tolerance: float) -> Reading:
    """Read `[datasheet]`, follow every relation, and check those whose figures are all printed.

    `tolerance` is the share by which a printed figure may be off. Raises IdentifyError naming the key that is wrong.
    """
    figures: dict[str, float] = {}
    for key, value in table.items():
        if key not in sheet.figures:
            raise IdentifyError(
                f"datasheet.{key}: a {sheet.kind} datasheet has no such figure; known: {', '.join(sheet.figures)}"
            )
        figures[key] = in_si(value, sheet.figures[key], f"datasheet.{key}")
        if figures[key] <= 0.0:
            raise IdentifyError(f"datasheet.{key} is {value!r}; it must be above 0")
        if key in sheet.counted and figures[key] % sheet.counted[key]:
            kind = "an even number" if sheet.counted[key] == 2 else "a whole number"
            raise IdentifyError(f"datasheet.{key} is {value!r}; it is counted, so that it must be {kind}")
    printed = dict(figures)
    roots = {name: frozenset((name,)) for name in figures}
    derived: dict[str, Relation] = {}
    for _ in sheet.relations:
        for relation in sheet.relations:
            if relation.figure not in figures and all(name in figures for name in relation.needs):
                figures[relation.figure] = relation.formula(*(figures[name] for name in relation.needs))
                roots[relation.figure] = frozenset().union(*(roots[name] for name in relation.needs))
                derived[relation.figure] = relation
    found: dict[frozenset[str], Contradiction] = {}
    for relation in sheet.relations:
        if relation.figure not in printed or not all(name in figures for name in relation.needs):
            continue
        origin = frozenset[str]().union(*(roots[name] for name in relation.needs))
        computed = relation.formula(*(figures[name] for name in relation.needs))
        off = printed[relation.figure] / computed - 1.0 if computed > 0.0 else math.inf
        whole = origin | {relation.figure}
        known = any(pair <= whole for pair in found)  # a wider circle around the same two figures says nothing new
        if relation.figure not in origin and abs(off) > tolerance and not known:
            entry = Contradiction(
                relation.figure, printed[relation.figure], computed, off, relation, tuple(sorted(origin)), tolerance
            )
            found = {pair: told for pair, told in found.items() if not whole < pair} | {whole: entry}
    measured = [name for name in printed if name not in sheet.counted]
    moved = [_followed(sheet, {**printed, name: printed[name] * (1.0 + tolerance)}) for name in measured]
    halves = {name: math.sqrt(sum((other[name] - value) ** 2 for other in moved)) for name, value in figures.items()}
    return Reading(figures, halves, derived, tuple(found.values()))


def _followed(sheet: Sheet, printed: Mapping[str, float]) -> dict[str, float]:
    """Return the printed figures and all that follow from them, by the relations in their order."""
    figures = dict(printed)
    for _ in sheet.relations:
        for relation in sheet.relations:
            if relation.figure not in figures and all(name in figures for name in relation.needs):
                figures[relation.figure] = relation.formula(*(figures[name] for name in relation.needs))
    return figures
