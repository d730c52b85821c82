"""The nouns of design: the Request that a controller kind is given, the Design that it returns, and the Kind itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from firmloop.design.draft import Draft
from firmloop.design.law import DesignError, Law
from firmloop.design.optimum import QuadraticSolver
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal


@dataclass(frozen=True, slots=True)
class Request:
    """What a controller kind is given: the [controller] table without the shared keys, the wires, and the plant."""

    name: str
    table: Mapping[str, object]
    period: float  # s
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    plant: Plant | None
    optimum: QuadraticSolver | None = None  # for a kind that judges what it chooses by the optimum


@dataclass(frozen=True, slots=True)
class Operating:
    """One operating point of a controller that has several: the law resting there, and the plant as it is there."""

    says: str
    law: Law
    plant: Plant


@dataclass(frozen=True, slots=True)
class Bench:
    """A plant as a controller meets it: driven by its outputs in their order, seen by its inputs of the same names.

    `told` is the input whose steps a closed loop follows; the plant's first output is what follows them.
    """

    plant: Plant
    told: str

    def read_by(self, inputs: Sequence[Signal]) -> tuple[tuple[str, int], ...]:
        """Return the inputs that carry its outputs, each with the place of that output."""
        names = [wire.name for wire in inputs]
        return tuple((signal.name, k) for k, signal in enumerate(self.plant.outputs) if signal.name in names)


@dataclass(frozen=True, slots=True)
class Design:
    """A law and the figures it was made from; `tuned_by` names the tuning rule, None where the gains were given.

    `settings` are the keys of [controller] that the design answers, for a project that keeps it; None: the gains.
    `asked` are those that it answers them to: the rule and its own keys.
    """

    law: Law
    gains: Mapping[str, float]
    tuned_by: str | None
    settings: Mapping[str, object] | None = None
    not_met: Mapping[str, str] = field(default_factory=dict)  # effects that its feedforward leaves alone, and why
    operating: tuple[Operating, ...] = ()
    asked: tuple[str, ...] = ()
    bench: Bench | None = None  # where more than one reference and one measurement close its loop


@dataclass(frozen=True, slots=True)
class Kind:
    """One controller kind; `example` is a request that designs well, for the tests that every kind must pass.

    `draft`: what it computes before its outputs are limited, where that is linear: so it can be a point of a schedule.
    `further`: more such requests, where one does not show everything. `wires`: the names of its inputs, where they are
    fixed.
    """

    name: str
    says: str
    design: Callable[[Request], Design]
    example: Request
    draft: Callable[[Request], Draft] | None = None
    further: tuple[Request, ...] = ()
    wires: tuple[str, ...] = ()

    @property
    def examples(self) -> Mapping[str, Request]:
        """Every example, by the name of the kind, and of the request where there are more."""
        return {self.name: self.example, **{f"{self.name}_{request.name}": request for request in self.further}}


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
