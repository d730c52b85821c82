"""Hold what a case hides: truth.json beside a project that diagnose never opens it for."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

NAME = "truth.json"


@dataclass(frozen=True, slots=True)
class Hidden:
    """One effect of the library, or what no library holds (an empty name).

    `parameters` are the contract's names and values, of a physical quantity that was set as such. `same` lists the
    sets of effects that are the same function of these recordings. `visible` is what is left without it over the noise.
    """

    name: str
    output: str | None
    parameters: Mapping[str, float]
    same: Sequence[Sequence[str]]
    visible: float


@dataclass(frozen=True, slots=True)
class Truth:
    """All that a case hides: nothing where `hidden` is empty and `outside` names nothing."""

    kind: str
    seed: int
    hidden: tuple[Hidden, ...]
    outside: str  # physics that no library holds
    outside_visible: float
    plant: Mapping[str, float]  # true nominal parameters
    noise: Mapping[str, float]  # rms of what the truth added, by output
    about: Mapping[str, Any] = field(default_factory=dict)

    @property
    def visible(self) -> float:
        """What the least visible of all that is hidden leaves over the noise."""
        every = [each.visible for each in self.hidden] + ([self.outside_visible] if self.outside else [])
        return min(every, default=0.0)


def write_truth(truth: Truth, folder: Path) -> None:
    """Write truth.json into the folder of a project."""
    (folder / NAME).write_text(json.dumps(asdict(truth), indent=1) + "\n", encoding="utf-8")


def read_truth(folder: Path) -> Truth:
    """Read truth.json of a project's folder."""
    return truth_of(json.loads((folder / NAME).read_text(encoding="utf-8")))


def truth_of(document: Mapping[str, Any]) -> Truth:
    """Make a Truth of its JSON."""
    return Truth(**{**document, "hidden": tuple(Hidden(**each) for each in document["hidden"])})


def same_function(name: str, outputs: Sequence[str]) -> list[list[str]]:
    """Return the sets of effects that no recording of these outputs can tell from the effect called `name`.

    One sensor alone is delayed as its plant's input is; a constant torque shifts a lone speed as a zero of its sensor
    does; friction that differs by direction is friction and a load.
    """
    found: list[list[str]] = []
    if len(outputs) == 1:
        found += [[other] for pair in _ONE_SENSOR for other in pair if name in pair and other != name]
        if "speed" in outputs[0]:
            found += [[other] for other in _LONE_SPEED if name in _LONE_SPEED and other != name]
    if name == "asymmetric_friction":
        found.append(["coulomb_friction", "load_torque"])
    return found


_ONE_SENSOR = (("input_delay", "sensor_delay"),)
_LONE_SPEED = ("load_torque", "sensor_offset")
