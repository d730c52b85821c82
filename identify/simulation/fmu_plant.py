"""A plant that somebody else wrote, step by step: a co-simulation FMU (FMI 2 or 3), opened by FMPy.

It is a program that runs in this process with the rights of who starts it, so that whoever runs firmloop names its file
each time: no project does. Its variables bear the names of our signals, or those that are given for them; what else it
has keeps its start. A variable with a unit is converted.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import extra
from firmloop.identify.printed_units import Conversion, conversion, is_unit
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.fmu_archive import NEEDED_FOR, Archive, build, first_line, open_archive
from firmloop.identify.simulation.scratch import make_scratch, scratch_folder

Array = NDArray[np.float64]

_AS_IT_IS = Conversion(1.0)
_NO_UNIT = ("", "1", "-")


@dataclass(frozen=True, slots=True)
class Fmu:
    """The file of an FMU, and what it calls those signals of ours that it has under another name."""

    file: Path
    names: Mapping[str, str] = field(default_factory=dict)

    def ends(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names of its inputs and of its outputs; nothing of it runs.

        Raises
        ------
        IdentifyError
            when it is no co-simulation FMU of FMI 2.0 or 3.0.
        ToolError
            when FMPy is not installed.
        """
        with scratch_folder(Path(tempfile.gettempdir()), "firmloop") as folder:
            archive = open_archive(self.file, folder)
            return archive.numbers("input"), archive.numbers("output")

    def called(self, signal: str) -> str:
        """Return what it calls a signal of ours."""
        return self.names.get(signal, signal)

    def check_names(self, known: Sequence[str]) -> None:
        """Refuse a name that is given for what is no signal."""
        if strange := [name for name in self.names if name not in known]:
            raise IdentifyError(
                f"--wire {strange[0]}={self.names[strange[0]]}: {strange[0]} is no signal here; known: "
                f"{', '.join(known)}"
            )


def fmu_of(file: str | Path | None, names: Mapping[str, str] | None) -> Fmu | None:
    """Return the FMU that somebody has named, if somebody has.

    Raises
    ------
    IdentifyError
        when there are names of variables, but no FMU.
    """
    if file is not None:
        return Fmu(Path(file), dict(names or {}))
    if names:
        signal, variable = next(iter(names.items()))
        raise IdentifyError(f"--wire {signal}={variable}: says what an FMU calls it, and none is named: add --fmu FILE")
    return None


class FmuPlant:
    """An FMU from its start, whose inputs and outputs are these signals, in their units, with a period in s.

    Raises
    ------
    IdentifyError
        when it is no co-simulation FMU that has them, or does not begin.
    ToolError
        when FMPy is not installed, or the FMU has no library for this machine and cannot be compiled.
    """

    def __init__(self, fmu: Fmu, inputs: Sequence[Signal], outputs: Sequence[Signal], period: float) -> None:
        self._file, self._period, self._count = fmu.file, period, 0
        scratch = make_scratch(Path(tempfile.gettempdir()), "firmloop", 0o700)
        weakref.finalize(self, scratch.remove)
        archive = open_archive(fmu.file, scratch.path)
        self._given, self._give = _references(archive, fmu, inputs, "input")
        self._read, self._take = _references(archive, fmu, outputs, "output")
        self.takes_any_step = bool(archive.described.coSimulation.canHandleVariableCommunicationStepSize)
        build(archive)
        self._three = archive.is_of_three
        kind = extra("fmpy.fmi3", "fmu", NEEDED_FOR).FMU3Slave if self._three else _slave_of_two()
        named = {"guid": archive.described.guid, "unzipDirectory": str(scratch.path), "modelIdentifier": archive.model}
        try:
            self._slave = kind(instanceName="plant", **named)
            self._slave.instantiate()
            if not self._three:
                self._slave.setupExperiment(startTime=0.0)
            self._slave.enterInitializationMode()
            self._slave.exitInitializationMode()
        except Exception as error:  # whatever the library of a stranger does not do
            raise IdentifyError(f"{fmu.file}: does not begin ({first_line(error)})") from None
        weakref.finalize(self, _end, self._slave)

    def read(self) -> Array:
        """Return the outputs (r,) of this period, before the next input acts."""
        slave = self._slave
        seen = np.array((slave.getFloat64 if self._three else slave.getReal)(self._read), dtype=np.float64)
        return _converted(seen, self._take)

    def apply(self, values: Array) -> None:
        """Hold the inputs (m,) for one period."""
        self.step(values, self._count * self._period, self._period)

    def step(self, values: Array, begin: float, length: float) -> None:
        """Hold the inputs (m,) from `begin` on for `length`, both in s since the start."""
        slave = self._slave
        try:
            given = _given_in(values, self._give).tolist()
            (slave.setFloat64 if self._three else slave.setReal)(self._given, given)
            slave.doStep(begin, length)
        except Exception as error:  # as above
            raise IdentifyError(f"{self._file}: stops after {self._count} steps ({first_line(error)})") from None
        self._count += 1
        if not np.all(np.isfinite(self.read())):
            raise IdentifyError(f"{self._file}: its outputs are no numbers after {self._count} steps")


def _references(
    archive: Archive, fmu: Fmu, signals: Sequence[Signal], causality: str
) -> tuple[list[int], tuple[Conversion, ...]]:
    """Return the FMU's own numbers of variables, and how each becomes a signal of ours."""
    known, numbers, units = archive.variables(causality), [], []
    for signal in signals:
        name = fmu.called(signal.name)
        if name not in known:
            raise IdentifyError(
                f"{fmu.file}: has no {causality} {name!r}; it has {', '.join(known) or 'none'}: say which one it "
                f"is with --wire {signal.name}=VARIABLE"
            )
        if not archive.is_number(known[name]):
            raise IdentifyError(f"{fmu.file}: {causality} {name!r} is no single number, as a signal is")
        numbers.append(known[name].valueReference)
        units.append(_unit(fmu.file, known[name], signal, causality))
    return numbers, tuple(units)


def _unit(file: Path, variable: Any, signal: Signal, causality: str) -> Conversion:
    unit = variable.unit or ""
    if unit in _NO_UNIT or signal.unit in _NO_UNIT or not is_unit(unit):  # of a language of its own
        return _AS_IT_IS
    try:
        return conversion(unit, signal.unit, "")
    except IdentifyError:
        raise IdentifyError(
            f"{file}: {causality} {variable.name!r} is in {unit}, and {signal.name} in {signal.unit}: say which "
            f"variable it is with --wire {signal.name}=VARIABLE"
        ) from None


def _converted(values: Array, units: Sequence[Conversion]) -> Array:
    """Return values (r,) of the FMU in our units; in the same unit, the same bits."""
    if all(unit.changes_nothing for unit in units):
        return values
    return np.array([value * unit.factor + unit.offset for value, unit in zip(values, units, strict=True)])


def _given_in(values: Array, units: Sequence[Conversion]) -> Array:
    """Return values (m,) of ours in the units of the FMU."""
    if all(unit.changes_nothing for unit in units):
        return values
    return np.array([(value - unit.offset) / unit.factor for value, unit in zip(values, units, strict=True)])


def _slave_of_two() -> Any:
    return extra("fmpy.fmi2", "fmu", NEEDED_FOR).FMU2Slave


def _end(slave: Any) -> None:
    with suppress(Exception):  # one that has stopped by itself
        slave.terminate()
        slave.freeInstance()
