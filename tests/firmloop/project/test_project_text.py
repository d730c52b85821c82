"""A project that was read can be written back, and a key's line is found again."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from firmloop.identify.plants.kinds import make_plant
from firmloop.project.project import read_project, same_unit
from firmloop.project.project_text import _text, fitted_text
from firmloop.project.toml_lines import key_lines

TEXTS = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
SCALARS = st.one_of(
    TEXTS, st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False), st.lists(TEXTS, max_size=3)
)
TABLES: st.SearchStrategy[Any] = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.dictionaries(TEXTS, inner, max_size=4), st.lists(st.dictionaries(TEXTS, inner), max_size=3)
    ),
    max_leaves=12,
)


@given(st.dictionaries(TEXTS, TABLES, max_size=5))
def test_any_document_reads_back(document: dict[str, Any]) -> None:
    assert tomllib.loads(_text(document, "a test\nof lines")) == document


@given(st.dictionaries(TEXTS, TABLES, max_size=5))
def test_every_key_has_a_line(document: dict[str, Any]) -> None:
    text = _text(document, "a test")
    lines = key_lines(text)
    for key, value in document.items():
        if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            assert (key, "0") in lines
        else:
            shown = text.split("\n")[lines[(key,)] - 1]
            assert shown.startswith("[") or " = " in shown


def test_lines_of_what_people_write() -> None:
    lines = key_lines(
        '# a comment with = and [brackets]\nschema = 1\n[recordings] # why\ntrain = [ # one a line\n  "a#b.csv",\n'
        '  "c.csv" ]\n"quoted key" = """\nx = 3\n[y]\n"""\na.b = { c = 1, d = [{ e = 2 }] }\r\n[[plant.effects]]\n'
        "name = 'x'\n[[plant.effects]]\nname = 'y'\n[plant.effects.deep]\nz = +1.5e-3\n"
    )
    assert {".".join(key): line for key, line in lines.items()} == {
        "schema": 2,
        "recordings": 3,
        "recordings.train": 4,
        "recordings.quoted key": 7,
        "recordings.a": 11,
        "recordings.a.b": 11,
        "recordings.a.b.c": 11,
        "recordings.a.b.d": 11,
        "plant.effects.0": 12,
        "plant.effects.0.name": 13,
        "plant.effects.1": 14,
        "plant.effects.1.name": 15,
        "plant.effects.1.deep": 16,
        "plant.effects.1.deep.z": 17,
    }


def test_recordings_are_named_from_the_new_place(project: Path, tmp_path: Path) -> None:
    read = read_project(project)
    assert read.plant
    plant = make_plant(read.plant.kind, read.plant.input, read.plant.outputs, read.plant.parameters)
    place = tmp_path / "deep" / "er"
    place.mkdir(parents=True)
    (place / "project.toml").write_text(fitted_text(read, plant, place))
    moved = read_project(place / "project.toml")
    assert moved.recordings
    assert [path.resolve() for path in moved.recordings.train] == [(project.parent / "train.csv").resolve()]
    before, after = dict(read.document.values), dict(moved.document.values)
    assert {**after, "recordings": 0} == {**before, "recordings": 0}


def test_units_that_are_the_same() -> None:
    for one, other in (("rad/s", "rad_s"), ("N*m", "N_m"), ("kg*m^2", "kg_m2"), ("1", "norm"), ("", "1"), ("V", "V")):
        assert same_unit(one, other)
    for one, other in (("rad/s", "rpm"), ("V", "mV"), ("rad", "rad/s"), ("degC", "K"), ("1", "V")):
        assert not same_unit(one, other)
