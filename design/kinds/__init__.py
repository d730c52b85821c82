"""Controller kinds: every module of this folder that has a `KIND` is one."""

from __future__ import annotations

import difflib
import functools
import importlib
import math
import pkgutil
from collections.abc import Mapping
from dataclasses import replace

from firmloop.design.design import Design, Kind, Request, check_signals
from firmloop.design.law import DesignError
from firmloop.design.optimum import QuadraticSolver
from firmloop.design.safe_output import KEY as SAFE_OUTPUT
from firmloop.design.safe_output import safe_outputs
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal

SHARED_KEYS = ("kind", "period_s", "outputs", SAFE_OUTPUT)  # of [controller], read for every kind alike


@functools.cache
def kind_of(name: str) -> Kind | None:
    """Return the kind of this name, which its module has too, and read no other; None where there is none."""
    if not any(module.name == name for module in pkgutil.iter_modules(__path__)):
        return None
    kind = getattr(importlib.import_module(f"{__name__}.{name}"), "KIND", None)
    assert kind is None or kind.name == name, "a kind is called like its file"
    return kind


@functools.cache
def kinds() -> Mapping[str, Kind]:
    """Every kind of this folder, by name."""
    modules = (importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__))
    found = (module.KIND for module in modules if hasattr(module, "KIND"))
    return {kind.name: kind for kind in sorted(found, key=lambda kind: kind.name)}


def design(
    kind: str,
    name: str,
    table: Mapping[str, object],
    period: float,
    inputs: tuple[Signal, ...],
    outputs: tuple[Signal, ...],
    plant: Plant | None,
    optimum: QuadraticSolver | None = None,
) -> Design:
    """Design the controller that `table` ([controller] of the project) asks for.

    `period` in s; `optimum` solves quadratic programs, for an mpc whose solver is not "online". Raises DesignError
    where the table, the period, a signal or the plant does not allow it.
    """
    found = kind_of(kind)
    if found is None:
        known = kinds()
        near = difflib.get_close_matches(str(kind), known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise DesignError(f"controller.kind = '{kind}' is unknown; {hint}known: {', '.join(known)}")
    if not (math.isfinite(period) and period > 0):
        raise DesignError(f"controller.period_s = {period:g} is out of range; it must be finite and above 0")
    own = {key: value for key, value in table.items() if key not in SHARED_KEYS}
    request = Request(name, own, period, inputs, outputs, plant, optimum)
    check_signals(request)
    safe = safe_outputs(table, outputs)
    designed = found.design(request)
    return replace(designed, law=replace(designed.law, safe=safe)) if safe else designed
