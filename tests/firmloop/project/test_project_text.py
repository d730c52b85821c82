"""A project that was read can be written back, and a key's line is found again."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from firmloop.identify.plants.kinds import make_plant
from firmloop.project.project import read_project, same_unit
from firmloop.project.project_text import _text, fitted_text
from firmloop.project.toml_comments import rewritten
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


COMMENTED = """# the bench of my motor
schema = 1
name = "m"   # names the C

[recordings]
train = ["train.csv"]  # steps, then a prbs

[plant]
kind = "first_order"  # good enough
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
# from the sheet
gain = { value = 20.0, free = true }  # rad/s/V
time_constant_s = { value = 0.1, free = true }
delay_s = { value = 0.0, free = false }
"""


def test_comments_of_a_user_survive_what_is_written_back(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(COMMENTED)
    read = read_project(path)
    assert read.plant
    plant = make_plant(read.plant.kind, read.plant.input, read.plant.outputs, read.plant.parameters)
    for _ in range(2):  # a second command on what the first has written adds no second line of its own
        text = fitted_text(read, plant, tmp_path)
        for comment in ("# the bench of my motor", "# names the C", "# steps, then a prbs", "# good enough"):
            assert comment in text
        assert "# from the sheet" in text and "# rad/s/V" in text
        assert text.count("by: firmloop") == 1
        path.write_text(text)
        read = read_project(path)


@settings(max_examples=40)
@given(st.dictionaries(TEXTS, TABLES, max_size=5), st.dictionaries(TEXTS, TABLES, max_size=5))
def test_figures_written_into_a_text_read_back_or_nothing_is_written(one: Any, other: Any) -> None:
    said = rewritten(_text(one, "one"), _text(other, "other"))
    assert said is None or tomllib.loads(said) == other
