"""Print a Program as the files of a source FMU: FMI 3.0, co-simulation, values in physical units.

The controller's own C is in it as it is; a wrapper turns Float64 into its numbers and back. In fixed point a value
becomes the nearest number of the format, within its type; every number that the controller puts out is a Float64.
Functional Mock-up Interface Specification 3.0, Modelica Association.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from firmloop.codegen.bundle import Bundle, CodegenError
from firmloop.codegen.delivery import CONTRACT
from firmloop.codegen.emit import tool_version
from firmloop.codegen.environment import c_comment, render
from firmloop.codegen.view import c_type, physical, setter_name
from firmloop.quantize.program import Program, Value

OWN = ("time", "status_word")  # variables of the FMU besides the signals
_WHOLE = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "Int64", "UInt64", "Boolean", "String")
_MODES = (
    *("ExitInitializationMode", "EnterEventMode", "Terminate", "EnterConfigurationMode", "ExitConfigurationMode"),
    *("EnterStepMode", "EvaluateDiscreteStates", "EnterContinuousTimeMode"),
)
_REFERENCES = "const fmi3ValueReference r[], size_t n"
_UNSUPPORTED = {  # by name: the arguments behind the instance
    "GetNumberOfVariableDependencies": "fmi3ValueReference r, size_t *n",
    "GetVariableDependencies": "fmi3ValueReference r, size_t e[], fmi3ValueReference a[], size_t b[], "
    "fmi3DependencyKind k[], size_t n",
    "SerializedFMUStateSize": "fmi3FMUState s, size_t *n",
    "SerializeFMUState": "fmi3FMUState s, fmi3Byte b[], size_t n",
    "DeserializeFMUState": "const fmi3Byte b[], size_t n, fmi3FMUState *s",
    "GetDirectionalDerivative": f"{_REFERENCES}, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[], "
    "size_t ns, fmi3Float64 v[], size_t nv",
    "GetAdjointDerivative": f"{_REFERENCES}, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[], "
    "size_t ns, fmi3Float64 v[], size_t nv",
    "GetOutputDerivatives": f"{_REFERENCES}, const fmi3Int32 o[], fmi3Float64 v[], size_t nv",
    "GetIntervalDecimal": f"{_REFERENCES}, fmi3Float64 v[], fmi3IntervalQualifier q[]",
    "GetIntervalFraction": f"{_REFERENCES}, fmi3UInt64 c[], fmi3UInt64 d[], fmi3IntervalQualifier q[]",
    "GetShiftDecimal": f"{_REFERENCES}, fmi3Float64 v[]",
    "GetShiftFraction": f"{_REFERENCES}, fmi3UInt64 c[], fmi3UInt64 d[]",
    "SetIntervalDecimal": f"{_REFERENCES}, const fmi3Float64 v[]",
    "SetIntervalFraction": f"{_REFERENCES}, const fmi3UInt64 c[], const fmi3UInt64 d[]",
    "SetShiftDecimal": f"{_REFERENCES}, const fmi3Float64 v[]",
    "SetShiftFraction": f"{_REFERENCES}, const fmi3UInt64 c[], const fmi3UInt64 d[]",
    "UpdateDiscreteStates": "fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Boolean *e, "
    "fmi3Float64 *t",
    # Of the other two kinds of FMU, which some importers look for in every library:
    "ActivateModelPartition": "fmi3ValueReference r, fmi3Float64 t",
    "CompletedIntegratorStep": "fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c",
    "SetTime": "fmi3Float64 t",
    **dict.fromkeys(("GetNumberOfContinuousStates", "GetNumberOfEventIndicators"), "size_t *n"),
    **dict.fromkeys(
        (
            *("GetContinuousStateDerivatives", "GetContinuousStates", "GetEventIndicators"),
            "GetNominalsOfContinuousStates",
        ),
        "fmi3Float64 v[], size_t n",
    ),
    "SetContinuousStates": "const fmi3Float64 v[], size_t n",
}
_OF_STATE = {
    "GetFMUState": "fmi3FMUState *s",
    "SetFMUState": "fmi3FMUState s",
    "FreeFMUState": "fmi3FMUState *s",
}


def fmu_files(program: Program, bundle: Bundle, command: str) -> Mapping[str, str]:
    """Return the text of every file of the FMU by its place in the archive.

    Raises
    ------
    CodegenError
        when a signal is called like a variable of the FMU itself.
    """
    for value in (*program.inputs, *program.outputs, *program.parameters):
        if value.name in OWN:
            raise CodegenError(f"signal {value.name!r} is a variable of every FMU: choose another name")
    view = _view(program, bundle, command)
    return {
        "modelDescription.xml": render("fmu/modelDescription.xml.j2", view),
        "sources/buildDescription.xml": render("fmu/buildDescription.xml.j2", view),
        "sources/fmi3.c": render("fmu/fmi3.c.j2", view),
        **{f"sources/{name}": text for name, text in bundle.files.items()},
    }


def _view(program: Program, bundle: Bundle, command: str) -> dict[str, object]:
    inputs = [_variable(v, 1 + k, "in") for k, v in enumerate(program.inputs)]
    first = 1 + len(inputs)
    outputs = [_variable(v, first + k, "out") for k, v in enumerate(program.outputs)]
    first += len(outputs)
    starts = program.start[len(program.start) - len(program.tunable) :]
    parameters = [
        {
            **_variable(v, first + k, "in"),
            "index": k,
            "setter": setter_name(program, v),
            "start": repr(float(physical(x, v.number))),
        }
        for k, (v, x) in enumerate(zip(program.parameters, starts, strict=True))
    ]
    status = first + len(parameters)
    every = [*inputs, *outputs, *parameters]
    return {
        "name": program.name,
        "macro": program.name.upper(),
        "token": program.id,
        "keeps_state": "true",
        "version": tool_version(),
        "command": command,
        "says": c_comment(f"{program.name}, a controller in {program.arithmetic}, as firmloop has verified it"),
        "period": f"{program.period:.17g}",
        "contract": CONTRACT,
        "sources": ("fmi3.c", *bundle.sources),
        "fixed": any(v.number.kind == "fixed" for v in (*program.inputs, *program.parameters)),
        "inputs": inputs,
        "outputs": outputs,
        "parameters": parameters,
        "status": status,
        "unknowns": [*(each["reference"] for each in outputs), status],
        "units": sorted({str(each["unit"]) for each in every}),
        "status_words": [
            {
                "reference": status,
                "bits": "; ".join(f"bit {flag.bit}: {flag.says}" for flag in program.status) or "always 0",
            }
        ],
        **standard_functions((), ()),
    }


def standard_functions(types: Sequence[str], more: Sequence[str]) -> dict[str, object]:
    """Return what a template prints of functions that the standard names and an FMU has no use for.

    `types` are further ones that it has no variable of, `more` the functions of a state that it does not keep.
    """
    return {
        "modes": _MODES,
        "getters": ("Float32", *types, *_WHOLE),
        "setters": ("Float32", "UInt32", *_WHOLE),
        "unsupported": [
            *(_refused(name, behind) for name, behind in _UNSUPPORTED.items()),
            *(_refused(name, _OF_STATE[name]) for name in more),
        ],
    }


def _variable(value: Value, reference: int, struct: str) -> dict[str, object]:
    low, high = (float(physical(end, value.number)) for end in (value.low, value.high))
    sound = math.isfinite(low) and math.isfinite(high)
    kind = c_type(value.number)
    member = f"m->{struct}.{value.name}"
    if value.number.kind == "float":
        get, given = f"(double){member}", f"({kind})value"
    else:
        one, bits = f"{2.0**value.number.fraction:.1f}", value.number.bits
        get = f"(double){member} / {one}"
        given = f"({kind})nearest(value * {one}, {-(2.0 ** (bits - 1)):.1f}, {2.0 ** (bits - 1) - 1:.1f})"
    return {
        "name": value.name,
        "reference": reference,
        "unit": value.unit or "1",
        "range": f' min="{low!r}" max="{high!r}"' if sound and struct == "out" else "",
        "start": repr(min(max(0.0, low), high)) if sound else "0.0",
        "reading": get,
        "setting": given,
    }


def _refused(name: str, behind: str) -> Mapping[str, str]:
    """Return a function of the standard that is always an error; its arguments are named and not used."""
    names = ["i", *re.findall(r"(\w+)(?:\[\])?(?:,|$)", behind)]
    return {
        "name": name,
        "arguments": f"fmi3Instance i, {behind}",
        "unused": " ".join(f"(void){each};" for each in names),
    }
