"""Check what a function of the door is given, and refuse it in a sentence that says what is taken."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from firmloop.identify.simulation.fmu_plant import Fmu, fmu_of
from firmloop.project.extent import FEWEST_STEPS, LAST_SEED, MOST_STEPS, whole
from firmloop.project.project import Campaign, Project, campaign_targets
from firmloop.project.table import ProjectError


def check_noun(verb: str, given: object, *taken: type) -> None:
    """Check that `firmloop.VERB` is given one of the nouns that it takes.

    Raises
    ------
    TypeError
        with what it takes, what it was given, and the way out.
    """
    if isinstance(given, taken):
        return
    names = [f"{'an' if noun.__name__[0] in 'AEIOU' else 'a'} {noun.__name__}" for noun in taken]
    takes = " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    if isinstance(given, str | os.PathLike):
        way = f"read the file first: firmloop.load({os.fspath(given)!r})"
    elif isinstance(getattr(given, "project", None), Project):
        way = "give it that one's project: .project"
    else:
        way = "firmloop.load reads a project's TOML file"
    raise TypeError(f"firmloop.{verb} takes {takes}, and was given {_called(given)}; {way}")


def path_given(what: str, given: object, example: str) -> Path:
    """Return the path that `what`, an argument or a function of the door, is given; `example` is one.

    Raises
    ------
    TypeError
        when it is no path.
    """
    if not isinstance(given, str | os.PathLike):
        was = f"and was given {_called(given)}"
        raise TypeError(f"{what} takes a path, {was}; give a text or a Path, such as {example!r}")
    return Path(given)


def folder_given(given: object) -> Path:
    """Return the folder that results are to be written into; TypeError when it is no path."""
    return path_given("folder:", given, "out")


def fmu_given(file: str | Path | None, wires: Mapping[str, str] | None) -> Fmu | None:
    """Return the FMU that somebody has named, if somebody has.

    Raises
    ------
    IdentifyError
        when there are names of variables, but no FMU.
    TypeError
        when the FMU is no path, or the names are no mapping of texts.
    """
    if wires is not None and not isinstance(wires, Mapping):
        raise TypeError(
            f"wires: takes what the FMU calls each column, and was given {_called(wires)}; "
            "give a mapping, such as {'voltage_V': 'u'}"
        )
    return fmu_of(None if file is None else path_given("fmu:", file, "motor.fmu"), wires)


def _called(given: object) -> str:
    return "None" if given is None else type(given).__name__


def asked_campaign(
    project: Project,
    targets: str | Sequence[str | os.PathLike[str]],
    steps: int,
    seed: int,
    port: str | None,
    fmu: str | Path | None,
    wires: Mapping[str, str] | None,
) -> Campaign:
    """Return what a verification is asked to do, checked by the rules of the command line.

    Raises
    ------
    ProjectError
        when a number is out of its range, or a target is unknown.
    TypeError
        when a target or the port is no text.
    """
    several = [targets] if isinstance(targets, str | os.PathLike) else targets
    if not isinstance(several, Iterable):
        raise TypeError(f"targets: {several!r} is no name of a target nor a list of some; firmloop targets lists them")
    several = list(several)
    for name in several:
        if not isinstance(name, str | os.PathLike):
            raise TypeError(f"targets: {name!r} is no name of a target; firmloop targets lists them")
    if port is not None and not isinstance(port, str):
        raise TypeError(f"port: {port!r} is no text such as /dev/ttyACM0, COM3 or socket://host:port")
    names = campaign_targets(project, [os.fspath(name) for name in several])
    counted, drawn = _whole("steps", steps, FEWEST_STEPS, MOST_STEPS), _whole("seed", seed, 0, LAST_SEED)
    return Campaign(names, counted, drawn, port, fmu_given(fmu, wires))


def _whole(name: str, value: object, low: int, high: int) -> int:
    """Check a whole number as the command line does."""
    try:
        return whole(value, low, high)
    except ValueError as error:
        raise ProjectError(f"{name}: {error}") from None
