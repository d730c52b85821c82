"""A Finding: what was left out, where, with which parameters, how sure, and what would tell candidates apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from firmloop.identify.fitting.own_values import OwnValue

Verdict = Literal["no_mismatch", "explained", "ambiguous", "unknown_physics"]
Half = Literal["plant", "controller", "none"]


@dataclass(frozen=True, slots=True)
class Estimate:
    """One parameter of an effect with its 95 % interval; None where the data give none."""

    value: float
    interval: tuple[float, float] | None
    unit: str


@dataclass(frozen=True, slots=True)
class Named:
    """One effect that is part of an explanation."""

    name: str
    output: str | None
    equation: str
    probability: float
    parameters: Mapping[str, Estimate]
    says: str
    at: str = ""  # state, output or input of the plant that it acts on; blank for a controller's

    def told(self) -> str:
        """Say it in one line."""
        return f"{self.name} ({100.0 * self.probability:.0f} %): {self.says}"


@dataclass(frozen=True, slots=True)
class Alternative:
    """A runner-up, and the experiment that would settle it."""

    name: str
    probability: float
    tell_apart_by: str


@dataclass(frozen=True, slots=True)
class Location:
    """Where the mismatch sits; spans in s of the first train recording."""

    equation: str
    coordinate: str
    output: str
    spans: tuple[tuple[float, float], ...]
    evidence: str


@dataclass(frozen=True, slots=True)
class Ratio:
    """Residual rms over noise rms: with the plant as given, refitted, and with the effects or what has no name."""

    before: float | None
    refit: float | None
    after: float | None


@dataclass(frozen=True, slots=True)
class Shift:
    """A nominal parameter: given, refitted alone, and beside the effects."""

    name: str
    unit: str
    given: float
    refit: float
    after: float


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What would have to disturb a balance so that its outputs differ as they do; rms in `unit`.

    `share` is that of the rms of what the input gives the balance; None where it gives none.
    """

    rms: float
    unit: str
    share: float | None


@dataclass(frozen=True, slots=True)
class Gained:
    """By how much the deciding criterion drops, and how often chance alone would make it drop as much.

    `p_value` is that of the largest of all drops, None where it cannot be told; `library` counts the terms, each at
    each of its places.
    """

    criterion: str
    gain: float
    p_value: float | None
    library: int


@dataclass(frozen=True, slots=True)
class Finding:
    """The whole diagnosis."""

    verdict: Verdict
    half: Half
    location: Location | None
    effects: tuple[Named, ...]
    alternatives: tuple[Alternative, ...]
    train: Ratio
    test: Ratio | None
    whiteness: tuple[float, float]
    noise: Mapping[str, float]
    shifts: tuple[Shift, ...]
    untestable: Mapping[str, str]  # effect -> why
    notes: tuple[str, ...]
    says: tuple[str, ...]  # the paragraph
    simulation_rms: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    per_recording: tuple[OwnValue, ...] = ()  # what each recording has of what differs between them
    disturbance: Mapping[str, Disturbance] = field(default_factory=dict)  # by balance
    evidence: Gained | None = None
    law: tuple[tuple[float, float], ...] = ()  # coordinate and missing term, in SI units, of what has no name

    def as_dict(self) -> dict[str, object]:
        """Return what diagnosis.json holds (contract, section 6)."""
        fit: dict[str, object] = {"train": _ratio(self.train)}
        if self.test is not None:
            fit["test"] = _ratio(self.test)
        return {
            "schema": 1,
            "verdict": self.verdict,
            "half": self.half,
            "location": None if self.location is None else _location(self.location),
            "effects": [_named(each) for each in self.effects],
            "alternatives": [
                {"name": each.name, "probability": _figure(each.probability), "tell_apart_by": each.tell_apart_by}
                for each in self.alternatives
            ],
            "fit": fit,
            "simulation_rms": {
                role: {name: {plant: _figure(rms) for plant, rms in plants.items()} for name, plants in outputs.items()}
                for role, outputs in self.simulation_rms.items()
            },
            "whiteness": {"before": _figure(self.whiteness[0]), "after": _figure(self.whiteness[1])},
            "noise": {name: _figure(size) for name, size in self.noise.items()},
            "disturbance": {
                name: {"rms": _figure(each.rms), "unit": each.unit, "share_of_drive": _figure(each.share)}
                for name, each in self.disturbance.items()
            },
            **({} if self.evidence is None else {"evidence": _evidence(self.evidence)}),
            "shifts": {
                each.name: {
                    "given": _figure(each.given),
                    "refit": _figure(each.refit),
                    "after": _figure(each.after),
                    "unit": each.unit,
                }
                for each in self.shifts
            },
            **({"per_recording": _own(self.per_recording)} if self.per_recording else {}),
            "untestable": dict(self.untestable),
            "notes": list(self.notes),
            "says": list(self.says),
            **({"law": [list(point) for point in self.law]} if self.law else {}),
        }


def _own(values: Sequence[OwnValue]) -> dict[str, dict[str, object]]:
    found: dict[str, dict[str, object]] = {}
    for one in values:
        known, interval = one.parameter, one.parameter.interval_95
        found.setdefault(known.name, {})[Path(one.source).name] = {
            "value": _figure(known.value),
            "ci95": None if interval is None else [_figure(end) for end in interval],
            "unit": known.unit,
        }
    return found


def _location(place: Location) -> dict[str, object]:
    return {
        "equation": place.equation,
        "coordinate": place.coordinate,
        "output": place.output,
        "spans_s": [list(span) for span in place.spans],
        "evidence": place.evidence,
    }


def _evidence(each: Gained) -> dict[str, object]:
    return {
        "criterion": each.criterion,
        "gain": _figure(each.gain),
        "p_value": _figure(each.p_value),
        "library": each.library,
    }


def _named(each: Named) -> dict[str, object]:
    entry: dict[str, object] = {
        "name": each.name,
        "equation": each.equation,
        "probability": _figure(each.probability),
        "parameters": {
            name: {
                "value": estimate.value,
                "ci95": None if estimate.interval is None else list(estimate.interval),
                "unit": estimate.unit,
            }
            for name, estimate in each.parameters.items()
        },
        "says": each.says,
    }
    if each.at:
        entry["at"] = each.at
    if each.output is not None:
        entry["output"] = each.output
    return entry


def _ratio(ratio: Ratio) -> dict[str, object]:
    return {"before": _figure(ratio.before), "refit": _figure(ratio.refit), "after": _figure(ratio.after)}


def _figure(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.6g}")
