"""Open the archive of an FMU that somebody else wrote: bounded, read as its standard says, built for this machine.

Functional Mock-up Interface Specification 2.0.4 and 3.0, Modelica Association. Nothing of it runs here.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import ToolError, extra
from firmloop.identify.simulation.compiler import run_compiler

NUMBERS = {"2.0": "Real", "3.0": "Float64"}  # by version of the standard, what a signal must be
MOST_BYTES = 256 << 20  # of all that an FMU holds, unpacked
MOST_FILES = 10_000
BUILT = ("-O2", "-ffp-contract=off", "-fPIC", "-shared")
NEEDED_FOR = "an FMU as the plant"


@dataclass(frozen=True, slots=True)
class Archive:
    """The FMU in `file`, unpacked into `folder`; `described` is what FMPy reads of it."""

    file: Path
    folder: Path
    described: Any

    @property
    def is_of_three(self) -> bool:
        """Whether it is one of FMI 3."""
        return str(self.described.fmiVersion) == "3.0"

    @property
    def model(self) -> str:
        """The name of its library."""
        return str(self.described.coSimulation.modelIdentifier)

    def variables(self, causality: str) -> dict[str, Any]:
        """Return its variables of one causality, input or output, by their name, as FMPy reads them."""
        return {each.name: each for each in self.described.modelVariables if each.causality == causality}

    def numbers(self, causality: str) -> tuple[str, ...]:
        """Return the names of those that are a single number."""
        return tuple(name for name, each in self.variables(causality).items() if self.is_number(each))

    def is_number(self, variable: Any) -> bool:
        """Tell whether a variable is a single number of the type that signals are of."""
        return variable.type == NUMBERS[self.described.fmiVersion] and not variable.dimensions


def open_archive(file: Path, folder: Path) -> Archive:
    """Unpack an FMU into an empty folder and read what it says of itself.

    Raises
    ------
    IdentifyError
        when it is no co-simulation FMU of FMI 2.0 or 3.0.
    ToolError
        when FMPy is not installed.
    """
    fmpy = extra("fmpy", "fmu", NEEDED_FOR)
    try:
        _check_size(file)
        fmpy.extract(str(file), str(folder))
        _check_documents(folder)
        described = fmpy.read_model_description(str(folder), validate=True)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise IdentifyError(f"{file}: is no FMU that can be read ({first_line(error)})") from None
    except Exception as error:  # FMPy has one of its own, and those of its parser
        raise IdentifyError(f"{file}: is not as its standard says ({first_line(error)})") from None
    version = described.fmiVersion
    if described.coSimulation is None or version not in NUMBERS:
        without = "" if described.coSimulation else " without co-simulation"
        raise IdentifyError(
            f"{file}: FMI {version}{without}; the plant of a simulation is co-simulation of FMI 2.0 or 3.0: "
            "export it so"
        )
    archive = Archive(file, folder, described)
    if not (archive.model.isascii() and archive.model.isidentifier()):  # it is a part of paths
        raise IdentifyError(f"{file}: modelIdentifier {archive.model[:40]!r} is no name of C; export it again")
    return archive


def build(archive: Archive) -> None:
    """Compile the sources where there is no library for this machine.

    Raises
    ------
    IdentifyError
        when there is neither, or a source is not in the archive.
    ToolError
        when they cannot be compiled.
    """
    fmpy = extra("fmpy", "fmu", NEEDED_FOR)
    file, folder = archive.file, archive.folder
    platform = fmpy.platform_tuple if archive.is_of_three else fmpy.platform
    library = folder / "binaries" / platform / f"{archive.model}{fmpy.sharedLibraryExtension}"
    if library.is_file():
        return
    sets = [each for one in archive.described.buildConfigurations for each in one.sourceFileSets]
    named = [name for each in sets for name in each.sourceFiles]
    if not named:
        raise IdentifyError(
            f"{file}: has no library for {platform} and no sources to compile: export it for this machine"
        )
    library.parent.mkdir(parents=True, exist_ok=True)
    headers = Path(fmpy.__file__).parent / "c-code"
    sources = [str(folder / "sources" / name) for name in named]
    outside = [each for each in sources if not Path(each).resolve().is_relative_to(folder.resolve())]
    if outside:
        raise IdentifyError(f"{file}: its source {Path(outside[0]).name[:40]!r} is not in it; export again")
    try:
        run_compiler(["gcc", *BUILT, f"-I{headers}", "-Isources", *sources, "-o", str(library), "-lm"], folder)
    except ToolError as error:
        raise ToolError(f"{file}: its sources cannot be compiled: {first_line(error)}") from None


def first_line(error: Exception) -> str:
    """Return the first line of what an error says, and the next where that is only a heading."""
    first, *more = str(error).strip().splitlines() or [type(error).__name__]
    return f"{first} {more[0].strip()}" if first.endswith(":") and more else first


def _check_size(file: Path) -> None:
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
