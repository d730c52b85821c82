"""Print a plant with its effects as the files of a source FMU: FMI 3.0, co-simulation, one period a step.

The C that simulates it here is in it as it is. Functional Mock-up Interface Specification 3.0, Modelica Association.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence

from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.delivery import CONTRACT
from firmloop.codegen.emit import tool_version
from firmloop.codegen.environment import c_comment, render
from firmloop.codegen.fmu import OWN, standard_functions
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.portable import PortablePlant
from firmloop.identify.units import carried_unit


def plant_fmu_files(
    name: str, plant: PortablePlant, ends: tuple[Sequence[Signal], Sequence[Signal]], period: float, command: str
) -> Mapping[str, str]:
    """Return the text of every file of the FMU by its place in the archive; `ends` are its inputs and outputs.

    Raises
    ------
    CodegenError
        when a signal is called like a variable of the FMU itself.
    """
    inputs, outputs = ends
    for signal in (*inputs, *outputs):
        if signal.name in OWN:
            raise CodegenError(f"signal {signal.name!r} is a variable of every FMU: choose another name")
    given = [_variable(each, 1 + k, k, 0.0) for k, each in enumerate(inputs)]
    read = [
        _variable(each, 1 + len(given) + k, k, float(first))
        for k, (each, first) in enumerate(zip(outputs, plant.first, strict=True))
    ]
    said = "\0".join(f"{file}\0{text}" for file, text in sorted(plant.files.items()))
    view: dict[str, object] = {
        "name": name,
        "token": hashlib.sha256(f"{name}\0{period!r}\0{said}".encode()).hexdigest()[:32],
        "says": c_comment(f"{name}, a plant with its effects, as firmloop simulates it"),
        "version": tool_version(),
        "command": command,
        "period": f"{period:.17g}",
        "contract": CONTRACT,
        "sources": ("fmi3.c", *plant.sources),
        "inputs": given,
        "outputs": read,
        "parameters": [],
        "status_words": [],
        "unknowns": [each["reference"] for each in read],
        "units": sorted({str(each["unit"]) for each in (*given, *read)}),
        **standard_functions(("UInt32",), ("GetFMUState", "SetFMUState", "FreeFMUState")),
    }
    return {
        "modelDescription.xml": render("fmu/modelDescription.xml.j2", {**view, "keeps_state": "false"}),
        "sources/buildDescription.xml": render("fmu/buildDescription.xml.j2", view),
        "sources/fmi3.c": render("fmu/plant.c.j2", view),
        **{f"sources/{file}": text for file, text in plant.files.items()},
    }


def _variable(signal: Signal, reference: int, index: int, start: float) -> dict[str, object]:
    return {
        "name": signal.name,
        "reference": reference,
        "index": index,
        "unit": signal.unit or carried_unit(signal.name) or "1",
        "range": "",
        "start": repr(start),
    }
