"""Checks of a fit before anybody blames physics; every file of this folder that has a CHECK is one.

`told(evidence)` runs them all, `first_causes(remarks)` tells those that a poor fit follows from, and
`refuse(evidence, verb)` is asked before anything is fitted. A check that finds something says so in one sentence, with
the key or the line that mends it; a check that names the cause silences those that would only see what follows from it.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.check import Check, Remark
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.simulation.simulate import drive_of, measured


@cache
def checks() -> tuple[Check, ...]:
    """Every check of this folder; one that silences others comes before them."""
    names = [found.name for found in pkgutil.iter_modules(__path__)]
    every = [importlib.import_module(f"{__name__}.{name}").CHECK for name in names]
    found = {each.name: replace(each, silences=_silenced(each, every)) for each in every}
    ordered: list[Check] = []
    while found:
        free = [name for name in found if not any(name in other.silences for other in found.values())]
        assert free, "two checks silence each other"
        ordered += [found.pop(name) for name in sorted(free)]
    return tuple(ordered)


def _silenced(check: Check, every: Sequence[Check]) -> tuple[str, ...]:
    return (*check.silences, *(other.name for other in every if check.name in other.silenced_by))


def refuse(evidence: Evidence, verb: str) -> None:
    """Ask, before a fit, the checks beside whose finding a verb cannot go on.

    Raises
    ------
    IdentifyError
        with what they find.
    """
    remarks = _asked([check for check in checks() if verb in check.refuses], evidence)
    if remarks:
        raise IdentifyError("; ".join(remark.says for remark in remarks))


def first_causes(remarks: Sequence[Remark]) -> bool:
    """Tell whether one of the remarks names why a fit is poor, so that what the fit says of itself only follows."""
    causes = {check.name for check in checks() if "excitation" in check.silences}
    return any(remark.check in causes for remark in remarks)


def no_noise(remarks: Sequence[Remark]) -> bool:
    """Tell whether one of the remarks says that what a fit leaves is no noise, or names what `structure` would see."""
    telling = {check.name for check in checks() if "structure" in (check.name, *check.silences)}
    return any(remark.check in telling for remark in remarks)


def told(evidence: Evidence) -> tuple[Remark, ...]:
    """Return what the checks find, most telling first; nothing where everything is sound.

    Raises
    ------
    IdentifyError
        when a recording lacks a column of the plant, which any check may look at.
    """
    for recording in evidence.recordings:
        drive_of(evidence.given, recording)
        measured(evidence.given, recording)
    return _asked([check for check in checks() if evidence.fit is not None or not check.needs_fit], evidence)


def _asked(some: Sequence[Check], evidence: Evidence) -> tuple[Remark, ...]:
    found: list[Remark] = []
    silent: set[str] = set()
    for check in some:
        if check.name in silent:
            continue
        remarks = check.look(evidence)
        found += [Remark(check.name, says) for says in remarks]
        silent |= set(check.silences) if remarks else set()
    return tuple(found)
