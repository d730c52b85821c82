"""A plant that somebody else wrote, period by period: a co-simulation FMU (FMI 2 or 3), opened by FMPy.

Its inputs and outputs bear the names of those of the plant whose place it takes; what else it has keeps its start. An
FMU without a library for this machine is compiled from its sources. Functional Mock-up Interface Specification 2.0.4
and 3.0, Modelica Association. An FMU is a program of somebody else's that runs in this process.
"""

from __future__ import annotations

import tempfile
import weakref
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import ToolError, extra
from firmloop.identify.plants.plant import Plant
from firmloop.identify.simulation.compiler import run_compiler
from firmloop.identify.simulation.scratch import make_scratch

Array = NDArray[np.float64]

NUMBERS = {"2.0": "Real", "3.0": "Float64"}  # by version of the standard, what a signal must be
MOST_BYTES = 256 << 20  # of all that an FMU holds, unpacked
MOST_FILES = 10_000
BUILT = ("-O2", "-ffp-contract=off", "-fPIC", "-shared")
_NEEDED_FOR = "an FMU as the plant"


class FmuPlant:
    """The FMU in `file` from its start, in the place of `plant`, with a period in s.

    Raises
    ------
    IdentifyError
        when it is no co-simulation FMU with the plant's inputs and outputs, or does not begin.
    ToolError
        when FMPy is not installed, or the FMU has no library for this machine and cannot be compiled.
    """

    def __init__(self, file: Path, plant: Plant, period: float) -> None:
        fmpy = extra("fmpy", "fmu", _NEEDED_FOR)
        self._file, self._period, self._count = file, period, 0
        scratch = make_scratch(Path(tempfile.gettempdir()), "firmloop", 0o700)
        weakref.finalize(self, scratch.remove)
        try:
            _check_archive(file)
            fmpy.extract(str(file), str(scratch.path))
            _check_documents(scratch.path)
            described = fmpy.read_model_description(str(scratch.path), validate=True)
        except (OSError, ValueError, zipfile.BadZipFile) as error:
            raise IdentifyError(f"{file}: is no FMU that can be read ({_first_line(error)})") from None
        except Exception as error:  # FMPy has one of its own, and those of its parser
            raise IdentifyError(f"{file}: is not as its standard says ({_first_line(error)})") from None
        version = described.fmiVersion
        if described.coSimulation is None or version not in NUMBERS:
            without = "" if described.coSimulation else " without co-simulation"
            raise IdentifyError(
                f"{file}: FMI {version}{without}; a closed loop takes co-simulation of FMI 2.0 or 3.0: export it so"
            )
        self._given = self._references(described, [wire.name for wire in plant.inputs], "input")
        self._read = self._references(described, [wire.name for wire in plant.outputs], "output")
        model = described.coSimulation.modelIdentifier
        if not (model.isascii() and model.isidentifier()):  # it is a part of paths
            raise IdentifyError(f"{file}: modelIdentifier {model[:40]!r} is no name of C; export it again")
        self._build(scratch.path, described, fmpy, model)
        named = {"guid": described.guid, "unzipDirectory": str(scratch.path), "modelIdentifier": model}
        self._three = version == "3.0"
        kind = extra("fmpy.fmi3", "fmu", _NEEDED_FOR).FMU3Slave if self._three else _slave_of_two()
        try:
            self._slave = kind(instanceName="plant", **named)
            self._slave.instantiate()
            if not self._three:
                self._slave.setupExperiment(startTime=0.0)
            self._slave.enterInitializationMode()
            self._slave.exitInitializationMode()
        except Exception as error:  # whatever the library of a stranger does not do
            raise IdentifyError(f"{file}: does not begin ({_first_line(error)})") from None
        weakref.finalize(self, _end, self._slave)

    def read(self) -> Array:
        """Return the outputs (r,) of this period, before the next input acts."""
        slave = self._slave
        return np.array((slave.getFloat64 if self._three else slave.getReal)(self._read), dtype=np.float64)

    def apply(self, values: Array) -> None:
        """Hold the inputs (m,) for one period."""
        slave = self._slave
        try:
            (slave.setFloat64 if self._three else slave.setReal)(self._given, values.tolist())
            slave.doStep(self._count * self._period, self._period)
        except Exception as error:  # as above
            raise IdentifyError(f"{self._file}: stops after {self._count} periods ({_first_line(error)})") from None
        self._count += 1
        if not np.all(np.isfinite(self.read())):
            raise IdentifyError(f"{self._file}: its outputs are no numbers after {self._count} periods")

    def _references(self, described: Any, names: Sequence[str], causality: str) -> list[int]:
        """Return the FMU's own numbers of variables."""
        kind = NUMBERS[described.fmiVersion]
        known = {each.name: each for each in described.modelVariables if each.causality == causality}
        for name in names:
            if name not in known:
                raise IdentifyError(
                    f"{self._file}: has no {causality} {name!r}, as [plant] has; it has {', '.join(known) or 'none'}: "
                    "name the signals of [plant] as the FMU does"
                )
            if known[name].type != kind or known[name].dimensions:
                raise IdentifyError(f"{self._file}: {causality} {name!r} is no single number of type {kind}")
        return [known[name].valueReference for name in names]

    def _build(self, folder: Path, described: Any, fmpy: Any, model: str) -> None:
        """Compile the sources where there is no library for this machine."""
        platform = fmpy.platform_tuple if described.fmiVersion == "3.0" else fmpy.platform
        library = folder / "binaries" / platform / f"{model}{fmpy.sharedLibraryExtension}"
        if library.is_file():
            return
        sets = [each for one in described.buildConfigurations for each in one.sourceFileSets]
        named = [name for each in sets for name in each.sourceFiles]
        if not named:
            raise IdentifyError(
                f"{self._file}: has no library for {platform} and no sources to compile: export it for this machine"
            )
        library.parent.mkdir(parents=True, exist_ok=True)
        headers = Path(fmpy.__file__).parent / "c-code"
        sources = [str(folder / "sources" / name) for name in named]
        outside = [each for each in sources if not Path(each).resolve().is_relative_to(folder.resolve())]
        if outside:
            raise IdentifyError(f"{self._file}: its source {Path(outside[0]).name[:40]!r} is not in it; export again")
        try:
            run_compiler(["gcc", *BUILT, f"-I{headers}", "-Isources", *sources, "-o", str(library), "-lm"], folder)
        except ToolError as error:
            raise ToolError(f"{self._file}: its sources cannot be compiled: {_first_line(error)}") from None


def _check_archive(file: Path) -> None:
    """Refuse what may never end, or unpack to any size, before a byte of it is written."""
    if not file.is_file():
        raise ValueError("it is no file")
    with zipfile.ZipFile(file) as archive:
        held = archive.infolist()
    size = sum(each.file_size for each in held)
    if size > MOST_BYTES:
        raise ValueError(f"it unpacks to {size:,} bytes, and no more than {MOST_BYTES:,} are taken")
    if len(held) > MOST_FILES:
        raise ValueError(f"it holds {len(held):,} files, and no more than {MOST_FILES:,} are taken")


def _check_documents(folder: Path) -> None:
    """Refuse XML with a document type, which FMI has none of: its entities read other files, or grow without end."""
    for file in sorted(folder.rglob("*.xml")):
        reader = expat.ParserCreate()
        reader.StartDoctypeDeclHandler = _refuse_document_type
        with file.open("rb") as stream:
            reader.ParseFile(stream)


def _refuse_document_type(*_: object) -> None:
    raise ValueError("its XML has a document type, as FMI has none: export it again")


def _slave_of_two() -> Any:
    return extra("fmpy.fmi2", "fmu", _NEEDED_FOR).FMU2Slave


def _end(slave: Any) -> None:
    with suppress(Exception):  # one that has stopped by itself
        slave.terminate()
        slave.freeInstance()


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
