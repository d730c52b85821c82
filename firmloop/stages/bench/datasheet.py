"""Take a motor's parameters from its datasheet and the standard tests, and find what contradicts what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from firmloop.identify.bench_tests.datasheets import Reading, Sheet, StandardTest, read_sheet, sheets
from firmloop.identify.bench_tests.motor_forms import MotorForm, motor_forms
from firmloop.identify.bench_tests.quantity import in_si
from firmloop.identify.bench_tests.standard_tests import Measured
from firmloop.identify.error import IdentifyError
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.plants.kinds import find_kind
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.units import unit_of
from firmloop.project.project import Project
from firmloop.project.project_text import written_interval
from firmloop.project.table import ProjectError, ProjectTable
from firmloop.stages.data import read_as_named
from firmloop.stages.plant import located

TOLERANCE = 0.05  # share by which printed figures may miss each other: makers round, and allow for their spread
COULOMB = ("coulomb_N_m", "coulomb_friction.torque_N_m")  # as a test calls it, and as a plant does
SIGNED = ("offset_rad", "position_rad")
DIMENSIONS = {"voltage_V": "V", "current_A": "A", "frequency_Hz": "Hz", "speed_rad_s": "rad/s", "position_rad": "rad"}


@dataclass(frozen=True, slots=True)
class Found:
    """One parameter, where it is from, and its standard deviation where a test gave one.

    `tolerance` is how far a figure of the sheet may be off, in its own unit: no interval, for nothing was measured.
    """

    value: float
    deviation: float | None
    origin: str
    tolerance: float = 0.0


def _sheet(project: Project) -> Sheet:
    part = project.document.table("datasheet")
    kind = project.plant.kind if project.plant else part.values.get("plant", "dc_motor")
    if kind not in sheets():
        raise part.wrong("plant", f"{kind!r} has no datasheet here; known: {', '.join(sheets())}")
    return sheets()[str(kind)]


def _parameters(project: Project, sheet: Sheet, reading: Reading) -> dict[str, Found]:
    """Take every parameter the sheet leads to, then what the tests measured in its place, test after test."""
    found: dict[str, Found] = {}
    for name, figure in sheet.parameters.items():
        if figure in reading.figures:
            relation = reading.derived.get(figure)
            origin = f"{relation.says}; {relation.source}" if relation else "printed"
            found[name] = Found(reading.figures[figure], None, origin, reading.halves[figure])
    tests = project.document.table("standard_tests")
    tests.only(sheet.tests)
    for name in (key for key in sheet.tests if key in tests.values):
        for key, measured in _test(sheet.tests[name], name, tests.table(name), found, project).items():
            found[key] = Found(measured.value, measured.deviation, f"{name} test")
    return found


def _test(
    test: StandardTest, name: str, part: ProjectTable, found: Mapping[str, Found], project: Project
) -> Mapping[str, Measured]:
    """Run one standard test on its readings."""
    part.only(test.readings)
    given: Recording | dict[str, list[float]]
    if test.recorded:
        given = read_as_named(project, project.path.parent / part.text("recording", 'recording = "coast.csv"'))
    else:
        given = {key: _readings(part, key) for key in test.readings}
        if len({len(values) for values in given.values()}) > 1:
            raise part.remark(
                "", f"{', '.join(test.readings)} have different numbers of readings; give as many of each"
            )
    for needed in test.needed:
        if needed not in found:
            raise IdentifyError(
                f"standard_tests.{name} needs {needed}; give the figures or the test that it follows from"
            )
    return test.run(given, {key: Measured(one.value, one.deviation) for key, one in found.items()})


def _readings(part: ProjectTable, key: str) -> list[float]:
    """Read one list of readings, or a single one, in any unit of its dimension."""
    value = part.values.get(key)
    values = value if isinstance(value, list) else [value]
    if value is None or not values:
        raise part.missing(key, f"{key} = [1.0, 2.0, 3.0]")
    try:
        made = [in_si(entry, DIMENSIONS[key], key) for entry in values]
    except IdentifyError as error:
        raise part.wrong(key, str(error)) from None
    if key not in SIGNED and any(entry <= 0.0 for entry in made):
        raise part.wrong(key, "must hold readings above 0: take amounts, the directions do not matter here")
    return made


def _disagreements(sheet: Sheet, reading: Reading, found: Mapping[str, Found]) -> list[str]:
    """Say where a test and the sheet differ by more than three standard deviations, and 10 %."""
    said = []
    for name, figure in sheet.parameters.items():
        measured = found.get(name)
        printed_too = figure in reading.figures and figure not in reading.derived
        if measured is None or not measured.origin.endswith(" test") or not printed_too:
            continue
        printed = reading.figures[figure]
        off = printed / measured.value - 1.0 if measured.value else float("inf")
        if abs(off) > 0.1 and abs(printed - measured.value) > 3.0 * (measured.deviation or 0.0):
            unit = unit_of(name)
            said.append(
                f"{figure} is {printed:.4g} {unit} by the datasheet, but the {measured.origin} gives "
                f"{measured.value:.4g} {unit}: {off:+.1%}"
            )
    return said


def _plant(project: Project, sheet: Sheet, found: Mapping[str, Found]) -> Mapping[str, object]:
    """Write the [plant] table; what the project has already stays: its ends, and what no sheet says, such as a gear."""
    part = project.plant
    given = part.table.values if part else {}
    entries: dict[str, object] = {k: v for k, v in (part.parameters if part else {}).items() if k not in found}
    counted = [constant.name for constant in find_kind(sheet.kind).constants if constant.counted]
    for name in sheet.parameters:
        if name in found and name in counted:
            entries[name] = found[name].value
        elif name in found:
            entry: dict[str, object] = {"value": found[name].value, "free": found[name].value > 0.0}
            deviation = found[name].deviation
            if deviation:
                reach = NORMAL_95 * deviation
                entry["ci95"] = written_interval(found[name].value - reach, found[name].value + reach)
            entries[name] = entry
    measured = []
    for key, one in found.items():
        effect, _, parameter = (COULOMB[1] if key == COULOMB[0] else key).partition(".")
        if parameter and (one.value > 0.0 or parameter in SIGNED):
            measured.append({"name": effect, parameter: one.value})
    named = {str(entry["name"]) for entry in measured}
    own = given.get("effects", [])
    effects = [entry for entry in own if entry.get("name") not in named] + measured if isinstance(own, list) else own
    ends = {key: given[key] for key in ("input", "inputs") if key in given}
    wires: dict[str, object] = {"input": sheet.inputs[0]} if len(sheet.inputs) == 1 else {"inputs": list(sheet.inputs)}
    return {
        "kind": sheet.kind,
        **(ends or wires),
        "outputs": list(part.outputs if part else sheet.outputs),
        "parameters": entries,
        **({"effects": effects} if effects else {}),
    }


@dataclass(frozen=True, slots=True)
class Datasheet:
    """What a datasheet and its tests lead to; `told` are contradictions in words, `missing` has no value."""

    sheet: Sheet
    reading: Reading
    found: Mapping[str, Found]
    forms: Mapping[str, MotorForm]
    told: tuple[str, ...]
    missing: tuple[str, ...]
    plant: Mapping[str, object]  # the [plant] table


def datasheet(project: Project) -> Datasheet:
    """Read `[datasheet]` and `[standard_tests]`.

    Raises
    ------
    ProjectError
        when there is neither, or a figure cannot be used.
    """
    document = project.document
    if not document.table("datasheet").values and not document.table("standard_tests").values:
        raise ProjectError(
            f"{project.path}: this command needs a part that is missing: [datasheet] with figures such as "
            'torque_constant = "2.8 mN*m/A", or [standard_tests.no_load] with voltage_V, current_A, speed_rad_s'
        )
    with located(project):
        sheet = _sheet(project)
        part = document.table("datasheet")
        tolerance = part.number("tolerance", "tolerance = 0.05") if "tolerance" in part.values else TOLERANCE
        if not 0.0 <= tolerance < 1.0:
            raise part.wrong("tolerance", "must be a share from 0 to below 1, such as tolerance = 0.05")
        try:
            reading = read_sheet(sheet, part.without("tolerance", "plant"), tolerance)
            found = _parameters(project, sheet, reading)
        except IdentifyError as error:
            raise document.complaint(str(error)) from None
        told = [entry.sentence(sheet) for entry in reading.contradictions] + _disagreements(sheet, reading, found)
        missing = tuple(name for name in sheet.parameters if name not in found)
        forms = {} if missing or sheet.kind != "dc_motor" else motor_forms({k: v.value for k, v in found.items()})
        plant = _plant(project, sheet, found)
        if not missing:
            plant_from_table(plant)  # which refuses what is no plant, such as ends that the kind does not have
        return Datasheet(sheet, reading, found, forms, tuple(told), missing, plant)
