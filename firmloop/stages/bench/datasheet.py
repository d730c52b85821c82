"""Take a motor's parameters from its datasheet and the standard tests, and find what contradicts what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from firmloop.identify.bench_tests.datasheets import Reading, Sheet, read_sheet, sheets
from firmloop.identify.bench_tests.graphical import one_point
from firmloop.identify.bench_tests.motor_forms import MotorForm, motor_forms
from firmloop.identify.bench_tests.quantity import in_si
from firmloop.identify.bench_tests.standard_tests import (
    Measured,
    coast_down,
    locked_rotor_ac,
    locked_rotor_dc,
    no_load,
    step_test,
)
from firmloop.identify.bench_tests.step_response import step_response
from firmloop.identify.error import IdentifyError
from firmloop.identify.normal import NORMAL_95
from firmloop.identify.recordings.recording import Recording, column
from firmloop.identify.units import unit_of
from firmloop.project.project import Project
from firmloop.project.table import ProjectError, ProjectTable
from firmloop.stages.data import read_as_named
from firmloop.stages.plant import located

TOLERANCE = 0.05  # share by which printed figures may miss each other: makers round, and allow for their spread
TESTS = {
    "locked_rotor_dc": ("voltage_V", "current_A"),
    "locked_rotor_ac": ("voltage_V", "current_A", "frequency_Hz"),
    "no_load": ("voltage_V", "current_A", "speed_rad_s"),
    "coast_down": ("recording",),
    "step": ("recording",),
}
DIMENSIONS = {"voltage_V": "V", "current_A": "A", "frequency_Hz": "Hz", "speed_rad_s": "rad/s"}


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
    tests.only(TESTS)
    for name in (key for key in TESTS if key in tests.values):
        for key, measured in _test(name, tests.table(name), found, project).items():
            found[key] = Found(measured.value, measured.deviation, f"{name} test")
    return found


def _test(name: str, part: ProjectTable, found: Mapping[str, Found], project: Project) -> Mapping[str, Measured]:
    """Run one standard test on its readings."""
    part.only(TESTS[name])
    if name in ("coast_down", "step"):
        path = project.path.parent / part.text("recording", 'recording = "coast.csv"')
        recording = read_as_named(project, path)
        return _moving(name, recording, found)
    readings = [_readings(part, key) for key in TESTS[name]]
    if len({len(values) for values in readings}) > 1:
        raise part.remark("", f"{', '.join(TESTS[name])} have different numbers of readings; give as many of each")
    if name == "locked_rotor_dc":
        return locked_rotor_dc(*readings)
    resistance = _needed(name, found, "R_ohm")
    doubt = found["R_ohm"].deviation or 0.0
    if name == "locked_rotor_ac":
        return locked_rotor_ac(readings[0], readings[1], readings[2], resistance, doubt)
    return no_load(readings[0], readings[1], readings[2], resistance, doubt)


def _moving(name: str, recording: Recording, found: Mapping[str, Found]) -> Mapping[str, Measured]:
    if name == "coast_down":
        friction = _needed(name, found, "b_N_m_s_rad")
        dry = found.get("coulomb_N_m", Found(0.0, None, ""))
        doubt = (found["b_N_m_s_rad"].deviation or 0.0, dry.deviation or 0.0)
        return coast_down(recording.time, column(recording, "speed_rad_s"), friction, dry.value, doubt)
    needs = {key: _needed(name, found, key) for key in ("R_ohm", "ke_V_s_rad", "kt_N_m_A", "b_N_m_s_rad")}
    return step_test(one_point(step_response(recording, "voltage_V", "speed_rad_s"))["time_constant_s"], needs)


def _needed(test: str, found: Mapping[str, Found], name: str) -> float:
    if name not in found:
        raise IdentifyError(f"standard_tests.{test} needs {name}; give the figures or the test that it follows from")
    return found[name].value


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
    if any(entry <= 0.0 for entry in made):
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
    """Write the [plant] table; ends that the project names already stay."""
    part = project.plant
    entries: dict[str, object] = {}
    for name in sheet.parameters:
        if name in found:
            entry: dict[str, object] = {"value": found[name].value, "free": found[name].value > 0.0}
            deviation = found[name].deviation
            if deviation:
                reach = NORMAL_95 * deviation
                entry["ci95"] = [float(f"{found[name].value + sign * reach:.6g}") for sign in (-1, 1)]
            entries[name] = entry
    table: dict[str, object] = {
        "kind": sheet.kind,
        "input": part.input if part else "voltage_V",
        "outputs": list(part.outputs) if part else ["speed_rad_s"],
        "parameters": entries,
    }
    if "coulomb_N_m" in found and found["coulomb_N_m"].value > 0.0:
        table["effects"] = [{"name": "coulomb_friction", "torque_N_m": found["coulomb_N_m"].value}]
    return table


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
        try:
            reading = read_sheet(sheet, part.without("tolerance", "plant"), tolerance)
            found = _parameters(project, sheet, reading)
        except IdentifyError as error:
            raise document.complaint(str(error)) from None
        told = [entry.sentence(sheet) for entry in reading.contradictions] + _disagreements(sheet, reading, found)
        missing = tuple(name for name in sheet.parameters if name not in found)
        forms = {} if missing or sheet.kind != "dc_motor" else motor_forms({k: v.value for k, v in found.items()})
        return Datasheet(sheet, reading, found, forms, tuple(told), missing, _plant(project, sheet, found))
