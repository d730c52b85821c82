"""Make a Plant of a named kind; every file of this folder that has a KIND is one kind."""

from __future__ import annotations

import importlib
import math
import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache

from firmloop.identify.error import IdentifyError
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.kind import PlantConstant, PlantKind
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

_ENTRY_KEYS = ("value", "free", "low", "high", "ci95")


@cache
def kinds() -> Mapping[str, PlantKind]:
    """Every kind of this folder by name."""
    modules = [importlib.import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__)]
    return {module.KIND.name: module.KIND for module in modules}


def find_kind(name: str) -> PlantKind:
    """Return the kind called `name`; IdentifyError lists those there are."""
    if name not in kinds():
        raise IdentifyError(f"plant.kind {name!r} is unknown; known: {', '.join(sorted(kinds()))}")
    return kinds()[name]


def free_scale(plant: Plant) -> Parameter | None:
    """Return the free parameter that the output is proportional to; None where there is none.

    Its value may be only a start, which says nothing of a unit or a sign.
    """
    kind = kinds().get(plant.kind)
    return next((p for p in plant.parameters if kind is not None and p.name == kind.scale and p.free), None)


def make_plant(
    kind: str,
    inputs: str | Sequence[str],
    outputs: Sequence[str],
    parameters: Mapping[str, Mapping[str, object] | float],
) -> Plant:
    """Build the equations of `kind` between named signals; one input may be given by its name alone.

    A parameter is `{value, free, low, high, ci95}` (only `value` is needed, `free` defaults to true; `ci95` is what
    an earlier fit wrote) or a bare number. One that is left out and that the kind can guess gets the value NaN:
    it has to be fitted before the plant can be simulated.
    """
    found = find_kind(kind)
    drives = (inputs,) if isinstance(inputs, str) else tuple(inputs)
    scaled = len(drives) == 1 and found.per_unit is not None and found.per_unit in parameters
    if found.inputs and drives not in found.inputs and not scaled:
        scale = f", or give {found.per_unit} in [plant.parameters]" if found.per_unit else ""
        key, given = ("input", repr(drives[0])) if len(drives) == 1 else ("inputs", str(list(drives)))
        raise IdentifyError(
            f"plant.{key} {given}: {kind} is driven by {' or '.join(map(_together, found.inputs))}; "
            f"map your {'column' if len(drives) == 1 else 'columns'} in [recordings.rename]{scale}"
        )
    if not found.inputs and len(drives) != 1:
        raise IdentifyError(f"plant.inputs {list(drives)}: {kind} has one input, of any name")
    _check_outputs(found, outputs)
    for name in outputs:
        if name in drives:
            raise IdentifyError(
                f"plant.outputs: {name} is what drives the plant, too, and would answer itself; name the column "
                "that is read from the plant"
            )
    constants = found.constants
    if found.per_unit is not None and drives not in found.inputs:
        unit = unit_of(drives[0])
        constants = (
            *constants,
            PlantConstant(found.per_unit, f"per {unit}" if unit else "", -math.inf, math.inf, False, False),
        )
    optional = found.optional(drives, outputs)
    known = [constant.name for constant in (*constants, *optional)]
    for name in parameters:
        if name not in known:
            raise IdentifyError(f"plant.parameters.{name}: {kind} has no such parameter; it has {', '.join(known)}")
    constants = (*constants, *(constant for constant in optional if constant.name in parameters))
    made = tuple(read_parameter(kind, constant, parameters) for constant in constants)
    return found.build(tuple(map(_signal, drives)), tuple(map(_signal, outputs)), made)


def _together(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"inputs = [{', '.join(names)}]"


def _signal(name: str) -> Signal:
    return Signal(name, unit_of(name), -math.inf, math.inf)


def _check_outputs(kind: PlantKind, outputs: Sequence[str]) -> None:
    choice = f"any of {', '.join(kind.outputs)}" if kind.outputs else "exactly one, of any name"
    if not outputs or (not kind.outputs and len(outputs) != 1):
        raise IdentifyError(f"plant.outputs {list(outputs)}: {kind.name} has {choice}")
    for position, name in enumerate(outputs):
        if name in outputs[:position]:
            raise IdentifyError(f"plant.outputs: {name} stands twice; name every output once")
        if kind.outputs and name not in kind.outputs:
            raise IdentifyError(f"plant.outputs: {name!r} is unknown to {kind.name}, which has {choice}")


def read_parameter(kind: str, constant: PlantConstant, parameters: Mapping[str, object]) -> Parameter:
    """Read one entry of `[plant.parameters]`; IdentifyError names key, value and rule."""
    key = f"plant.parameters.{constant.name}"
    if constant.name not in parameters:
        if not constant.guessable:
            raise IdentifyError(f"{key} is missing; {kind} needs it: {constant.name} = {{ value = ..., free = true }}")
        return Parameter(
            constant.name, constant.unit, math.nan, True, constant.low, constant.high, None, constant.open_low
        )
    given = parameters[constant.name]
    entry: Mapping[str, object] = given if isinstance(given, Mapping) else {"value": given}
    for name in entry:
        if name not in _ENTRY_KEYS:
            raise IdentifyError(f"{key}.{name} is unknown; a parameter has {', '.join(_ENTRY_KEYS)}")
    if "value" not in entry:
        raise IdentifyError(f"{key}.value is missing; write {constant.name} = {{ value = ..., free = true }}")
    free = entry.get("free", not constant.counted)
    if free is True and constant.counted:
        raise IdentifyError(f"{key}.free is true, but {constant.name} is counted; set free = false, or leave it out")
    if not isinstance(free, bool):
        raise IdentifyError(f"{key}.free is {free!r}; it is true (the fit may change it) or false")
    low = max(_number(f"{key}.low", entry.get("low", constant.low)), constant.low)
    high = min(_number(f"{key}.high", entry.get("high", constant.high)), constant.high)
    if low > high:
        raise IdentifyError(f"{key}: low is {low:g} and high is {high:g}; exchange or correct them")
    value = _number(f"{key}.value", entry["value"])
    if not low <= value <= high or math.isinf(value):
        raise IdentifyError(f"{key}.value is {value:g} {constant.unit}; it must lie within {low:g} and {high:g}")
    if constant.counted and not value.is_integer():
        raise IdentifyError(f"{key}.value is {value:g}; it must be a whole number")
    if constant.open_low and value <= constant.low:
        raise IdentifyError(f"{key}.value is {value:g} {constant.unit}; it must be above {constant.low:g}")
    deviation = deviation_of(key, entry.get("ci95"))
    return Parameter(constant.name, constant.unit, value, free, low, high, deviation, constant.open_low)


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise IdentifyError(f"{key} is {value!r}; it must be a number")
    return float(value)


def deviation_of(key: str, interval: object) -> float | None:
    """Turn the 95 % interval an earlier fit wrote into a standard deviation."""
    if interval is None:
        return None
    if not isinstance(interval, Sequence) or isinstance(interval, str) or len(interval) != 2:
        raise IdentifyError(f"{key}.ci95 is {interval!r}; it must be [low, high]")
    low, high = (_number(f"{key}.ci95", bound) for bound in interval)
    if low > high:
        raise IdentifyError(f"{key}.ci95 is [{low:g}, {high:g}]; its first bound must be the smaller one")
    return (high - low) / (2.0 * NORMAL_95)
