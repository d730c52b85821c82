"""Controller kinds: every module of this folder that has a `KIND` is one."""

from __future__ import annotations

import difflib
import functools
import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from firmloop.design.draft import Draft
from firmloop.design.law import DesignError, Law
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal

SHARED_KEYS = ("kind", "period_s", "outputs")  # of [controller], read before a kind is asked


@dataclass(frozen=True, slots=True)
class Request:
    """What a controller kind is given: the [controller] table without the shared keys, the wires, and the plant."""

    name: str
    table: Mapping[str, object]
    period: float  # s
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    plant: Plant | None


@dataclass(frozen=True, slots=True)
class Operating:
    """One operating point of a controller that has several: the law resting there, and the plant as it is there."""

    says: str
    law: Law
    plant: Plant


@dataclass(frozen=True, slots=True)
class Design:
    """A law and the figures it was made from; `tuned_by` names the tuning rule, None where the gains were given.

    `settings` are the keys of [controller] that the design answers, for a project that keeps it; None: the gains.
    """

    law: Law
    gains: Mapping[str, float]
    tuned_by: str | None
    settings: Mapping[str, object] | None = None
    not_met: Mapping[str, str] = field(default_factory=dict)  # effects that its feedforward leaves alone, and why
    operating: tuple[Operating, ...] = ()


@dataclass(frozen=True, slots=True)
class Kind:
    """One controller kind; `example` is a request that designs well, for the tests that every kind must pass.

    `draft`: what it computes before its outputs are limited, where that is linear: so it can be a point of a schedule.
    `further`: more such requests, where one does not show everything.
    """

    name: str
    says: str
    design: Callable[[Request], Design]
    example: Request
    draft: Callable[[Request], Draft] | None = None
    further: tuple[Request, ...] = ()

    @property
    def examples(self) -> Mapping[str, Request]:
        """Every example, by the name of the kind, and of the request where there are more."""
        return {self.name: self.example, **{f"{self.name}_{request.name}": request for request in self.further}}


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
) -> Design:
    """Design the controller that `table` ([controller] of the project) asks for.

    `period` in s. Raises DesignError where the table, the period, a signal or the plant does not allow it.
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
    request = Request(name, own, period, inputs, outputs, plant)
    check_signals(request)
    return found.design(request)


def check_signals(request: Request) -> None:
    """Refuse signals without a finite range, and two with one name."""
    names: set[str] = set()
    for signal in request.inputs + request.outputs:
        if signal.name in names:
            raise DesignError(f"signals.{signal.name} stands twice among the controller's wires; rename one")
        names.add(signal.name)
        if not (math.isfinite(signal.low) and math.isfinite(signal.high) and signal.low < signal.high):
            raise DesignError(
                f"signals.{signal.name} ranges from {signal.low:g} to {signal.high:g}; "
                "both must be finite and low below high"
            )
