"""From a plant and a project to C: the law, the program, its proofs and its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.delivery import Delivery
from firmloop.codegen.emit import emit, manifest
from firmloop.codegen.packages import package
from firmloop.design.design import Design
from firmloop.design.kinds import design as design_law
from firmloop.design.law import Law
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.plants.plant import Plant
from firmloop.project.project import Project, check_output_unit, check_same_units, same_unit
from firmloop.quantize.program import Program
from firmloop.quantize.proof import proof
from firmloop.quantize.twins.qp import optimum
from firmloop.quantize.word_length import lower_within
from firmloop.stages.plant import located
from firmloop.verify.proofs.checker import Checked, check_proof
from firmloop.verify.proofs.limit_cycles import ZeroInput, zero_input
from firmloop.verify.stimuli.vectors import golden


@dataclass(frozen=True, slots=True)
class Generated:
    """The controller as exact arithmetic and as C."""

    program: Program
    bundle: Bundle
    manifest: Mapping[str, object]
    package: Mapping[str, str]  # the folder to copy: the C, golden vectors, their test and build files
    proof: Mapping[str, object]
    checked: Checked | None  # what the second, independent proof covered; None in floating point
    still: ZeroInput | None = None  # what it does by itself while its inputs stand still; None in floating point


def design(project: Project, plant: Plant | None) -> Design:
    """Tune or take the gains, and write the law."""
    part = project.controller
    assert part is not None, "require() has seen to it"
    _check_rule_keys(project)
    with located(project):
        found = design_law(
            part.kind,
            project.name,
            part.settings,
            part.period,
            project.controller_inputs,
            project.controller_outputs,
            plant,
            optimum,
        )
    if plant is not None and "A" not in part.settings and "C" not in part.settings:
        _check_order(project, found.law, plant)
    return found


def _check_rule_keys(project: Project) -> None:
    """Refuse keys of the controller's own rule in [tuning], where `firmloop tune` alone reads them.

    Raises
    ------
    ProjectError
        naming the key, and where it belongs.
    """
    part = project.controller
    assert part is not None, "require() has seen to it"
    rule = part.settings.get("tune")
    if part.kind != "pid" or "tuning" not in project.document.values or not isinstance(rule, str):
        return
    beside = project.document.table("tuning").table(rule)
    for key, value in beside.values.items():
        if part.settings.get(key) != value:
            raise beside.wrong(
                key,
                f"read by `firmloop tune` alone; controller.tune = '{rule}' goes by the keys beside it: "
                f"write {key} in [controller], too, or leave it out here",
            )


def _check_order(project: Project, law: Law, plant: Plant) -> None:
    """Refuse an input that stands, by its order, for a state or an output of the plant in another unit.

    So do the two inputs of a loop, whatever their names are, where they have one unit: it is then that of the output.

    Raises
    ------
    ProjectError
        naming both, and the order.
    """
    if law.paired and len(law.inputs) > 1 and not law.states and not law.watched:
        told, read = (law.inputs[k] for k in reference_and_measurement(law.inputs))
        if same_unit(told.unit, read.unit):
            check_output_unit(project, (read, told), plant.outputs[0])
    watched = [plant.outputs[k] for k in law.watched_outputs] or plant.outputs
    for carried, wires, key in ((plant.states, law.states, "controller.states or "), (watched, law.watched, "")):
        names = ", ".join(each.name for each in carried)
        meets = [(law.inputs[k], meant) for k, meant in zip(wires, carried, strict=False)]
        check_same_units(project, meets, f"{key}[signals] has to name them in this order: {names}")


def generate(project: Project, designed: Design, command: str) -> Generated:
    """Turn the law into exact arithmetic and that into C."""
    assert project.arithmetic is not None, "require() has seen to it"
    with located(project):
        program = lower_within(designed.law, project.formats, project.allowed, project.rounds)
        bundle = emit(program, command)
        still = zero_input(program)
        ranges = {**proof(program, designed.law.reasons), "zero_input": still.as_dict() if still else None}
        inputs, settings, trace = golden(program)
        extra = package(Delivery(program, bundle, command, inputs, settings, trace.outputs, trace.status))
        return Generated(program, bundle, manifest(program, bundle), extra, ranges, check_proof(ranges), still)
