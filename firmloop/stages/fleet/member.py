"""A Member: what one recording of a fleet says by itself, as it is compared and as it is kept."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

SCHEMA = 1
REST = "rest of "


@dataclass(frozen=True, slots=True)
class Key:
    """What a result depends on: SHA-256 of recording and project, and the version of firmloop."""

    recording: str
    project: str
    firmloop: str


@dataclass(frozen=True, slots=True)
class FleetTask:
    """A recording to diagnose, with all that it takes: it may be done on another machine.

    `name` is the recording's within the fleet; `file` is the name of its file, whose ending tells the format.
    """

    project_file: str
    project: bytes
    machine: str
    name: str
    file: str
    content: bytes
    key: Key


@dataclass(frozen=True, slots=True)
class Estimated:
    """One figure of a machine with one standard deviation, in `unit`; `deviation` None where there is none.

    `logarithmic`: it is compared by its ratio to that of the others.
    """

    value: float
    deviation: float | None
    unit: str
    logarithmic: bool


@dataclass(frozen=True, slots=True)
class Member:
    """What one recording says by itself.

    Attributes
    ----------
    parameters
        every free parameter of the plant as the project has it, fitted to this recording alone
    beside
        the same, fitted beside the effects that the diagnosis found
    rest
        of each output: rms of measured - simulated, with `parameters`
    diagnosis
        what diagnosis.json holds; empty where the recording was refused
    refused
        why the recording could not be used; empty where it could
    """

    machine: str
    name: str
    key: Key
    parameters: Mapping[str, Estimated] = field(default_factory=dict)
    beside: Mapping[str, Estimated] = field(default_factory=dict)
    rest: Mapping[str, Estimated] = field(default_factory=dict)
    diagnosis: Mapping[str, object] = field(default_factory=dict)
    refused: str = ""

    @property
    def figures(self) -> Mapping[str, Estimated]:
        """What is compared: the parameters, and what they leave of each output."""
        return {**self.parameters, **{f"{REST}{output}": one for output, one in self.rest.items()}}

    @property
    def verdict(self) -> str:
        """The verdict of its own diagnosis; `refused` where there is none."""
        return str(self.diagnosis.get("verdict", "refused"))

    @property
    def effects(self) -> Mapping[str, Mapping[str, object]]:
        """The effects that its diagnosis found, by name and the output they act on."""
        found = self.diagnosis.get("effects", ())
        assert isinstance(found, list | tuple)
        return {f"{one['name']} of {one['output']}" if one.get("output") else str(one["name"]): one for one in found}


def member_text(member: Member) -> str:
    """Write a member as it is kept."""
    return json.dumps({"schema": SCHEMA, **asdict(member)}, indent=1, allow_nan=False) + "\n"


def member_of(text: str) -> Member | None:
    """Read a member as it was kept; None where the text is none."""
    try:
        read = json.loads(text)
        if read.pop("schema") != SCHEMA:
            return None
        figures = {
            part: {name: Estimated(**one) for name, one in read.pop(part).items()}
            for part in ("parameters", "beside", "rest")
        }
        return Member(**{**read, **figures, "key": Key(**read["key"])})
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
