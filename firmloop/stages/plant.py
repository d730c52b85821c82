"""The plant that a project describes; complaints of other packages get the project's file and line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from firmloop.codegen.bundle import CodegenError
from firmloop.design.law import DesignError
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.per_recording import with_varying, without_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.project.project import Project, check_units
from firmloop.quantize.program import QuantizeError
from firmloop.verify.proofs.claims import ProofError


def plant_of(project: Project) -> Plant:
    """Build the plant that `[plant]` describes, and check that the controller's wires fit its ends."""
    part = project.plant
    assert part is not None, "require() has seen to it"
    with located(project):
        plant = plant_from_table(part.table.values)
    check_units(project, plant.inputs, plant.outputs[0])
    return plant


def recorded_plant_of(project: Project, fitted: Plant | None = None) -> Plant:
    """Build the plant, or take the fitted one, with what each recording has of its own, as `[recordings]` says."""
    plant = plant_of(project) if fitted is None else without_varying(fitted)
    if project.recordings is None:
        return plant
    with located(project):
        return with_varying(plant, project.recordings.per_recording)


def command_of(verb: str, path: Path) -> str:
    """Return the command that makes a result again, without folders: it stands in the generated files."""
    name = path.name if re.fullmatch(r"[A-Za-z0-9_.+-]+", path.name, flags=re.ASCII) else "PROJECT.toml"
    return f"firmloop {verb} {name}"


@contextmanager
def located(project: Project) -> Iterator[None]:
    """Put file and line of the project in front of what a part says about it."""
    try:
        yield
    except (DesignError, QuantizeError, CodegenError, ProofError) as error:
        raise project.document.complaint(str(error)) from None
    except IdentifyError as error:
        if str(error).startswith(("plant.", "plant ", "recordings.")):
            raise project.document.complaint(str(error)) from None
        raise
