"""A Project: one TOML file, checked as a whole before anything is done with it."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.names import check_identifier
from firmloop.codegen.target import target_names
from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, is_unit
from firmloop.identify.signal import Signal
from firmloop.identify.units import carried_unit
from firmloop.project.plant_part import PlantPart, read_plant_part
from firmloop.project.recordings_part import Recordings, read_recordings_part
from firmloop.project.table import ProjectError, ProjectTable, read_table
from firmloop.quantize.lower.words import ROUNDINGS
from firmloop.quantize.word_length import Allowed

if TYPE_CHECKING:
    from firmloop.identify.simulation.fmu_plant import Fmu

SCHEMA = 1
MAX_ERROR = "max_error_"  # and the unit of an output
LONGEST_PERIOD = 3600.0  # s; a controller that acts less than hourly is a mistake in the unit
UNIT = re.compile(r"[A-Za-z0-9%/*^._() -]{1,24}", re.ASCII)
EXAMPLES = {
    "recordings": '[recordings] with train = ["steps.csv"]',
    "plant": '[plant] with kind = "dc_motor", input, outputs and [plant.parameters]',
    "controller": '[controller] with kind = "pid" and period_s = 0.001',
    "signals": "[signals] with the range of every controller input and output",
    "arithmetic": '[arithmetic] with number = "float32"',
    "target": '[target] with names = ["host"]',
}
FURTHER = ("tuning", "datasheet", "standard_tests", "experiment", "model")  # tables that only one verb reads


@dataclass(frozen=True, slots=True)
class ControllerPart:
    """What `[controller]` says; `settings` is everything that only its kind understands."""

    table: ProjectTable
    kind: str
    period: float  # s
    outputs: tuple[str, ...]
    settings: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Project:
    """The whole file; a part that it does not have is None or empty."""

    path: Path
    document: ProjectTable
    name: str
    recordings: Recordings | None
    plant: PlantPart | None
    controller: ControllerPart | None
    signals: tuple[Signal, ...]
    arithmetic: str | None  # "float32", "float64", "fixed32", "fixed16", or "fixed": the shorter one that will do
    targets: tuple[str, ...]
    allowed: tuple[Allowed, ...] = ()  # what [arithmetic] lets outputs be off the law
    rounds: str = "nearest"  # what fixed point does with the places that it drops

    @property
    def formats(self) -> tuple[str, ...]:
        """The number formats that may be taken, the narrowest first."""
        arithmetic = self.arithmetic or "float32"
        return ("fixed16", "fixed32") if arithmetic == "fixed" else (arithmetic,)

    @property
    def controller_inputs(self) -> tuple[Signal, ...]:
        """Every signal that the controller does not put out, in file order (contract, section 7)."""
        outputs = self.controller.outputs if self.controller else ()
        return tuple(signal for signal in self.signals if signal.name not in outputs)

    @property
    def controller_outputs(self) -> tuple[Signal, ...]:
        """The controller's outputs in the order that `controller.outputs` gives."""
        outputs = self.controller.outputs if self.controller else ()
        by_name = {signal.name: signal for signal in self.signals}
        return tuple(by_name[name] for name in outputs if name in by_name)  # a project may hold no signals at all


@dataclass(frozen=True, slots=True)
class Campaign:
    """What a verification is asked to do; `port` is where a board is, None for QEMU and the host."""

    targets: tuple[str, ...]
    steps: int
    seed: int
    port: str | None
    fmu: Fmu | None = None  # closes the loop in the place of the plant's equations


def campaign_targets(project: Project, asked: Sequence[str]) -> tuple[str, ...]:
    """Return the targets asked for on the command line, each once, else those of the project, else the host.

    Raises
    ------
    ProjectError
        when one is unknown.
    """
    for name in asked:
        if not name.endswith(".toml") and name not in target_names():
            raise ProjectError(f"--target {name}: {_unknown_target(name)}")
        if name.endswith(".toml") and not Path(name).is_file():
            raise ProjectError(f"--target {name}: there is no such file; its path begins where you are: {Path.cwd()}")
    return tuple(dict.fromkeys(asked)) or project.targets or ("host",)


def read_project(path: Path) -> Project:
    """Read and check a project file.

    Raises
    ------
    ProjectError
        on the first thing that is wrong, with file and line.
    """
    document = read_table(path)
    document.only(("schema", "name", *EXAMPLES, *FURTHER))
    if "schema" not in document.values:
        raise document.missing("schema", "schema = 1")
    if document.values["schema"] != SCHEMA or isinstance(document.values["schema"], bool):
        raise document.wrong("schema", f"this firmloop reads schema = {SCHEMA}")
    name = document.text("name", 'name = "wheel_speed"')
    _identifier(document, "name", name, "project name")
    project = Project(
        path=path,
        document=document,
        name=name,
        recordings=read_recordings_part(document.table("recordings")) if "recordings" in document.values else None,
        plant=read_plant_part(document.table("plant")) if "plant" in document.values else None,
        controller=_controller(document.table("controller")) if "controller" in document.values else None,
        signals=_signals(document.table("signals")),
        arithmetic=_arithmetic(document.table("arithmetic")) if "arithmetic" in document.values else None,
        targets=_targets(document.table("target")) if "target" in document.values else (),
    )
    if project.controller:
        _outputs_are_signals(project.controller, project.signals)
    if project.arithmetic:
        table = document.table("arithmetic")
        return replace(project, allowed=_allowed(table, project.controller_outputs), rounds=_rounds(table))
    return project


def require(project: Project, *parts: str) -> None:
    """Check that the project has the parts a verb needs, and that the recordings it names are there.

    Raises
    ------
    ProjectError
        naming the first part that is missing.
    """
    held = {
        "recordings": project.recordings,
        "plant": project.plant,
        "controller": project.controller,
        "signals": project.signals,
        "arithmetic": project.arithmetic,
        "target": project.targets,
    }
    for part in parts:
        if not held[part]:
            raise ProjectError(f"{project.path}: this command needs a part that is missing: {EXAMPLES[part]}")
    if "recordings" in parts and project.recordings:
        table = project.document.table("recordings")
        if not project.recordings.train:
            raise table.missing("train", 'train = ["steps.csv"]')
        for key, files in (("train", project.recordings.train), ("test", project.recordings.test)):
            for file in files:
                if not os.path.isfile(file):  # unlike Path.is_file, it takes a name of any length
                    raise table.wrong(key, f"{file} is not a file; names are relative to the project file")


def same_unit(one: str, other: str) -> bool:
    """Tell whether two spellings mean the same unit: rad/s and rad_s, N*m, Nm and N_m, 1 and norm."""

    def plain(unit: str) -> str:
        word = re.sub(r"[^A-Za-z0-9%]+", "_", unit.replace("^", "")).strip("_")
        return "1" if word in ("", "norm", "ratio", "pu") else word

    return plain(one) == plain(other) or unit_times(one, other) == 1.0


def unit_times(one: str, other: str) -> float | None:
    """Return how many of the unit `other` one of `one` is; None where they are not of one kind, or one is unknown."""
    if not is_unit(one) or not is_unit(other):
        return None
    try:
        made = conversion(one, other, "")
    except IdentifyError:
        return None
    return float(f"{made.factor:.12g}") if made.offset == 0.0 else None


def check_units(project: Project, plant_inputs: Sequence[Signal], plant_output: Signal) -> None:
    """Check that the controller and the plant speak the same units where their wires meet.

    Raises
    ------
    ProjectError
        when the plant's one input is not in the unit of the controller's first output, one of several not in that of
        the output of its name, or the measurement or the reference not in that of the plant's first output.
    """
    if len(plant_inputs) == 1:
        meets = [(signal, plant_inputs[0]) for signal in project.controller_outputs[:1]]
    else:
        meets = [(s, wire) for s in project.controller_outputs for wire in plant_inputs if s.name == wire.name]
    check_same_units(project, meets)
    named = [signal for signal in project.controller_inputs if signal.name in ("measurement", "reference")]
    check_output_unit(project, named, plant_output)


def check_output_unit(project: Project, signals: Sequence[Signal], output: Signal) -> None:
    """Raise ProjectError where one of the signals is not in the unit of the plant's output."""
    check_same_units(project, [(signal, output) for signal in signals])


def check_same_units(project: Project, meets: Sequence[tuple[Signal, Signal]], order: str = "") -> None:
    """Raise ProjectError where a signal is not in the unit of the plant's that it stands for.

    `order` says in which one signals stand for the plant's, where that is by their order.
    """
    table = project.document.table("signals")
    for signal, wire in meets:
        unit = wire.unit or carried_unit(wire.name)  # a name such as tacho tells none
        if unit and not same_unit(signal.unit, unit):
            times = unit_times(signal.unit, unit)
            hint = f" (1 {signal.unit} is {times:.6g} {unit})" if times else ""
            cure = order if order and not times else "use one unit"
            raise table.wrong(
                signal.name, f"is in {signal.unit!r} but the plant's {wire.name} is in {unit!r}{hint}; {cure}"
            )


def _controller(table: ProjectTable) -> ControllerPart:
    period = table.number("period_s", "period_s = 0.001")
    if not 0 < period <= LONGEST_PERIOD:
        raise table.wrong("period_s", f"must be more than 0 and at most {LONGEST_PERIOD:g} seconds, such as 0.001")
    outputs = table.texts("outputs", 'outputs = ["output"]') or ("output",)
    return ControllerPart(
        table, table.text("kind", 'kind = "pid"'), period, outputs, table.without("kind", "period_s", "outputs")
    )


def _signals(table: ProjectTable) -> tuple[Signal, ...]:
    signals: list[Signal] = []
    for name in table.values:
        _identifier(table, name, name, "signal")
        entry = table.table(name)
        entry.only(("unit", "low", "high"))
        unit = entry.text("unit", 'unit = "rad/s"')
        if not UNIT.fullmatch(unit) or "*/" in unit or "/*" in unit or "//" in unit:
            raise entry.wrong("unit", "must be a short plain unit, such as 'rad/s' (ASCII, at most 24 characters)")
        low, high = entry.number("low", "low = -12"), entry.number("high", "high = 12")
        if not low < high:
            raise entry.wrong("low", f"must be less than high = {high:g}")
        same = [signal.name for signal in signals if signal.name.lower() == name.lower()]
        if same:
            raise table.remark(name, f"signal {name!r} differs from {same[0]!r} in capitals alone: choose another name")
        signals.append(Signal(name, unit, low, high))
    return tuple(signals)


def _outputs_are_signals(controller: ControllerPart, signals: tuple[Signal, ...]) -> None:
    known = [signal.name for signal in signals]
    for name in controller.outputs:
        if signals and name not in known:
            raise controller.table.remark(
                "outputs", f"outputs names {name!r}, which [signals] does not hold: {', '.join(known)}"
            )


def _arithmetic(table: ProjectTable) -> str:
    """`bits` only says something about fixed point (contract, section 2); with floats it may stand there idle."""
    errors = [key for key in table.values if key.startswith(MAX_ERROR)]
    table.only(("number", "bits", "rounding", *errors))
    number = table.text("number", 'number = "float32"')
    if number == "fixed" and errors and "bits" not in table.values:
        return "fixed"
    bits = table.values.get("bits", 32)
    if bits not in (16, 32) or isinstance(bits, bool | float):
        raise table.wrong("bits", "must be 16 or 32")
    if number not in ("float32", "float64", "fixed"):
        raise table.wrong("number", 'must be "float32", "float64" or "fixed"')
    return f"fixed{bits}" if number == "fixed" else number


def _rounds(table: ProjectTable) -> str:
    """Read what fixed point does with the places that it drops."""
    rounds = str(table.values.get("rounding", "nearest"))
    if rounds not in ROUNDINGS:
        raise table.wrong("rounding", f"must be {' or '.join(map(repr, ROUNDINGS))}")
    if rounds != "nearest" and table.values.get("number") != "fixed":
        raise table.wrong("rounding", "is a choice of fixed point; a float always rounds to nearest: remove it")
    return rounds


def _allowed(table: ProjectTable, outputs: tuple[Signal, ...]) -> tuple[Allowed, ...]:
    """Read max_error_V and its like: the unit of one or more outputs ends the name."""
    found = []
    for key in table.values:
        if not key.startswith(MAX_ERROR):
            continue
        most = table.number(key, f"{key} = 0.01")
        if most <= 0:
            raise table.wrong(key, "must be more than 0")
        meant = tuple(signal.name for signal in outputs if same_unit(signal.unit, key.removeprefix(MAX_ERROR)))
        if not meant:
            units = ", ".join(f"{signal.name} is in {signal.unit!r}" for signal in outputs) or "there is none"
            raise table.wrong(key, f"ends in the unit of no output ({units}); write for instance max_error_V")
        found.append(Allowed(f"arithmetic.{key}", meant, most))
    return tuple(found)


def _targets(table: ProjectTable) -> tuple[str, ...]:
    table.only(("names",))
    names = table.texts("names", 'names = ["host"]')
    if not names:
        raise table.missing("names", 'names = ["host"]')
    for name in names:
        if not name.endswith(".toml") and name not in target_names():
            raise table.wrong("names", _unknown_target(name))
    return tuple(str(table.file.parent / name) if name.endswith(".toml") else name for name in names)


def _unknown_target(name: str) -> str:
    near = difflib.get_close_matches(name, target_names(), n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else "firmloop targets lists those that are;"
    return f"no target is called {name!r}; {hint} the path of a target's .toml file would do, too"


def _identifier(table: ProjectTable, key: str, name: str, what: str) -> None:
    try:
        check_identifier(name, what)
    except CodegenError as error:
        raise table.remark(key, str(error)) from None
