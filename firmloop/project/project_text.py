"""Write a Project back as TOML, with other figures in some of its keys."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from shlex import quote

from firmloop.design.design import Design
from firmloop.identify.plants.per_recording import without_varying
from firmloop.identify.plants.plant import Parameter, Plant
from firmloop.identify.plants.plant_table import effects_table
from firmloop.project.project import Project
from firmloop.project.table import ProjectError
from firmloop.project.toml_comments import rewritten

OURS = re.compile(r"# (plant (fitted|made|diagnosed)|controller designed) by: firmloop .*")
# Tables whose entries stand on one line each.
INLINE = (("plant", "parameters"), ("plant", "balances"), ("plant", "effects"), ("signals",))


def fitted_text(project: Project, plant: Plant, folder: Path) -> str:
    """Return the project with the parameters of `plant` and their 95 % intervals, to be kept in `folder`.

    Everything else is as it was; recordings are named relative to `folder`, so that the file can be used as it is.
    """
    document = _moved(project, folder)
    table, plant = dict(_table(document["plant"])), without_varying(plant)
    given = project.document.table("plant").table("parameters").values
    table["parameters"] = {
        parameter.name: _entry(parameter, given.get(parameter.name))
        for parameter in plant.parameters[: plant.rate.numel_in(2)]
        if parameter.name in given or parameter.name not in table
    }
    if plant.effects:
        table["effects"] = effects_table(plant)
    return _kept(project, {**document, "plant": table}, _by("plant fitted", "identify", project))


def made_text(project: Project, plant: Mapping[str, object], verb: str, folder: Path) -> str:
    """Return the project with `plant` as its [plant] table, to be kept in `folder`; `verb` has made it."""
    document = {**_moved(project, folder), "plant": plant}
    return _kept(project, document, _by("plant made", verb, project))


def diagnosed_text(project: Project, plant: Plant, hold: str, folder: Path) -> str:
    """Return the project with the parameters and the effects of `plant`, to be kept in `folder`.

    `hold` is what the input does between rows, as far as the recordings tell.
    """
    document = _moved(project, folder)
    if project.recordings and hold != project.recordings.hold:
        document["recordings"] = {**_table(document["recordings"]), "hold": hold}
    table, plant = dict(_table(document["plant"])), without_varying(plant)
    given = project.document.table("plant").table("parameters").values
    own = [parameter for parameter in plant.parameters if "." not in parameter.name]
    table["parameters"] = {parameter.name: _entry(parameter, given.get(parameter.name)) for parameter in own}
    table.pop("effects", None)
    if plant.effects:
        table["effects"] = effects_table(plant)
    return _kept(project, {**document, "plant": table}, _by("plant diagnosed", "diagnose", project))


def designed_text(project: Project, design: Design, folder: Path) -> str:
    """Return the project with the gains of `design` instead of the rule that found them, to be kept in `folder`."""
    document = _moved(project, folder)
    gains = settled(_table(document["controller"]), design)
    return _kept(project, {**document, "controller": gains}, _by("controller designed", "design", project))


def _by(what: str, verb: str, project: Project) -> str:
    return f"{what} by: firmloop {verb} {quote(project.path.name)}"


def settled(table: Mapping[str, object], design: Design) -> dict[str, object]:
    """Return a [controller] table with the gains of `design` instead of the rule that found them."""
    told = {key: value for key, value in table.items() if key not in design.asked}
    return {**told, **(design.gains if design.settings is None else design.settings)}


def _entry(parameter: Parameter, given: object) -> Mapping[str, object]:
    entry: dict[str, object] = {"value": parameter.value, "free": parameter.free}
    if isinstance(given, dict):
        entry.update({key: end for key, end in given.items() if key in ("low", "high")})
    interval = parameter.interval_95
    if interval is not None:
        entry["ci95"] = written_interval(*interval)
    return entry


def written_interval(low: float, high: float) -> list[float]:
    """Return both ends in six digits, and in as many more as tell one from the other."""
    apart, far = high - low, max(abs(low), abs(high))
    digits = max(6, 3 + math.ceil(math.log10(far) - math.log10(apart))) if 0.0 < apart < math.inf else 17
    return [float(f"{end:.{min(digits, 17)}g}") for end in (low, high)]


def _moved(project: Project, folder: Path) -> dict[str, object]:
    """Return the document with every recording named as seen from `folder`."""
    document = dict(project.document.values)
    if project.recordings:
        table = dict(_table(document["recordings"]))
        for key, files in (("train", project.recordings.train), ("test", project.recordings.test)):
            if files:
                table[key] = [os.path.relpath(os.path.realpath(file), os.path.realpath(folder)) for file in files]
        document["recordings"] = table
    return document


def _kept(project: Project, document: Mapping[str, object], says: str) -> str:
    """Return the document as the user's own text with other figures, else as a text of ours."""
    ours = _text(document, says)
    try:
        text = project.path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ours
    own = rewritten(text, ours)
    first = ours.partition("\n")[0]
    return ours if own is None else f"{first}\n{_without_ours(own)}"


def _without_ours(text: str) -> str:
    """Drop the line that an earlier command has put on top."""
    first, _, rest = text.partition("\n")
    return rest if OURS.fullmatch(first.rstrip("\r")) else text


def _text(document: Mapping[str, object], says: str) -> str:
    plain = "".join(sign if sign.isprintable() else "?" for sign in says)
    return "\n".join([f"# {plain}", *_lines(document, ())]) + "\n"


def _lines(table: Mapping[str, object], place: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of one table: its plain values first, because TOML would give later ones to a subtable."""
    below = {key: value for key, value in table.items() if _has_header(value, place)}
    for key, value in table.items():
        if key not in below:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in below.items():
        path = (*place, key)
        title = ".".join(_key(name) for name in path)
        for entry in value if isinstance(value, list) else [value]:
            yield ""
            yield f"[[{title}]]" if isinstance(value, list) else f"[{title}]"
            yield from _lines(_table(entry), path)


def _has_header(value: object, place: tuple[str, ...]) -> bool:
    if isinstance(value, list):
        return bool(value) and all(isinstance(entry, dict) for entry in value)
    return isinstance(value, dict) and place not in INLINE


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _string(name)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_value(entry)}" for key, entry in value.items()) + " }"
    return repr(value) if isinstance(value, int | float) else str(value)


def _string(text: str) -> str:
    """JSON's escapes are TOML's, except that TOML wants DEL escaped too; and what is no UTF-8 cannot be told."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ProjectError(
            f"{text!a}: is not UTF-8, which a project file is written in: give that file or folder another name"
        ) from None
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _table(value: object) -> Mapping[str, object]:
    assert isinstance(value, dict), "read_project has checked that this is a table"
    return value
