"""The `[plant]` of a project: its kind, what drives it, what it answers with, and its parameters."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import dataclass

from firmloop.project.table import ProjectTable


@dataclass(frozen=True, slots=True)
class PlantPart:
    """What `[plant]` says; `firmloop.identify.plants.kinds.make_plant` turns it into a Plant."""

    table: ProjectTable
    kind: str
    input: str
    outputs: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, object] | float]


def read_plant_part(table: ProjectTable) -> PlantPart:
    """Check the outline of `[plant]`; what its kind asks for is asked when it is made."""
    effects = table.values.get("effects", [])
    if not isinstance(effects, list) or not all(isinstance(entry, dict) for entry in effects):
        raise table.wrong("effects", "must be tables: [[plant.effects]]")
    if table.values.get("kind") == "ode":
        return _ode(table)
    table.only(("kind", "input", "inputs", "outputs", "parameters", "effects", "force_per_unit", "torque_per_unit"))
    several = table.texts("inputs", 'inputs = ["voltage_d_V", "voltage_q_V"]')
    if several and "input" in table.values:
        raise table.wrong("inputs", "stands beside input; give one of them")
    kind = table.text("kind", 'kind = "dc_motor"')
    if not several and "input" not in table.values:
        names = _names(kind, "inputs")
        one = f'input = "{names[0]}"'
        raise table.missing(*(("input", one) if len(names) == 1 else ("inputs", f"inputs = {json.dumps(names)}")))
    drive = several[0] if several else table.text("input", 'input = "voltage_V"')
    outputs = table.texts("outputs", 'outputs = ["speed_rad_s"]')
    if not outputs:
        raise table.missing("outputs", f'outputs = ["{_names(kind, "outputs")[0]}"]')
    return PlantPart(table, kind, drive, outputs, _parameters(table))


def _names(kind: str, key: str) -> tuple[str, ...]:
    """Return an example of what drives a plant, or what it answers with; a kind is loaded only to say so."""
    known = importlib.import_module("firmloop.identify.plants.kinds").kinds().get(kind)
    if key == "outputs":
        return (known.outputs if known else ())[:1] or ("speed_rad_s",)
    return next(iter(known.inputs if known else ()), ("voltage_V",))


def _ode(table: ProjectTable) -> PlantPart:
    """Check the outline of a plant given as text; `firmloop.identify.plants.ode` reads the expressions."""
    table.only(("kind", "states", "inputs", "outputs", "derivatives", "balances", "parameters", "effects"))
    inputs = table.texts("inputs", 'inputs = ["force_N"]')
    if "inputs" not in table.values:
        raise table.missing("inputs", 'inputs = ["force_N"]')
    if not inputs:
        raise table.wrong(
            "inputs",
            "must name one; for a plant that moves by itself give the recordings a column of zeros, such as force_N, "
            'and write inputs = ["force_N"]',
        )
    outputs = tuple(table.table("outputs").values)
    if not outputs:
        raise table.missing("outputs", '[plant.outputs] with position_m = "x_m"')
    return PlantPart(table, "ode", inputs[0], outputs, _parameters(table))


def _parameters(table: ProjectTable) -> Mapping[str, Mapping[str, object] | float]:
    parameters: dict[str, Mapping[str, object] | float] = {}
    for name, entry in table.table("parameters").values.items():
        if not isinstance(entry, dict | int | float):
            raise table.table("parameters").wrong(name, "must be a table, such as { value = 8.0, free = true }")
        parameters[name] = entry
    return parameters
