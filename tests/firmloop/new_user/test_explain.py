"""Every name of a project is explained, and the schema takes the projects that firmloop takes."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from firmloop.cli import main
from firmloop.design.kinds import kinds
from firmloop.design.tuning import rules
from firmloop.identify.plants.effects import effects
from firmloop.identify.plants.kinds import kinds as plant_kinds
from tests.firmloop.conftest import PROJECT

jsonschema = pytest.importorskip("jsonschema")
EXAMPLES = sorted((Path(__file__).parents[3] / "examples").glob("*/*.toml"))
Said = Callable[..., str]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    def run(*arguments: str, status: int = 0) -> str:
        assert main(list(arguments)) == status
        shown = capsys.readouterr()
        return shown.err if status else shown.out

    return run


@pytest.fixture
def schema(said: Said) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(said("schema"))
    assert json.loads(Path(said("schema", "--path").strip()).read_text(encoding="utf-8")) == found
    return found


def keys_of(schema: dict[str, Any]) -> set[str]:
    """Every key that the schema names, at any depth."""
    own = set(schema.get("properties", {}))
    inner = [*schema.get("properties", {}).values(), *schema.get("allOf", []), *schema.get("anyOf", [])]
    inner += [schema[key] for key in ("then", "else", "additionalProperties", "items") if key in schema]
    return own.union(*(keys_of(each) for each in inner if isinstance(each, dict)))


def test_every_effect_plant_controller_and_rule_is_explained(said: Said) -> None:
    for name in (*effects(), *plant_kinds(), *kinds(), *rules(), "ode"):
        assert name in said("explain", name), name


def test_every_key_of_a_project_is_explained(said: Said, schema: dict[str, Any]) -> None:
    own = {key for rule in rules().values() for key in rule.keys}
    not_ours = set(schema["properties"]["experiment"]["properties"]) - {"signal", "repeats"}  # of single signals
    for key in sorted(keys_of(schema) - not_ours | own):
        assert key in said("explain", key), key


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("coulomb_friction", "opposes the motion"),
        ("recordings.period_s", "time between two rows"),
        ("[plant.parameters]", "95 % interval"),
        ("dc_motor", "L di/dt = u - R i - ke w"),
        ("pid", "I[k+1] = I[k] + ki h e[k]"),
        ("tau_c_s", "simc"),
        ("safe_output", "a NaN or infinity at an input"),
    ],
)
def test_an_explanation_says_what_the_reference_says(name: str, words: str, said: Said) -> None:
    shown = said("explain", name)
    assert words in shown and "](" not in shown and "`" not in shown


def test_a_key_of_one_table_is_not_that_of_another(said: Said) -> None:
    assert "between samples" in said("explain", "period_s")
    assert "between samples" not in said("explain", "recordings.period_s")


def test_a_name_that_is_not_there_gets_the_nearest(said: Said) -> None:
    assert "coulomb_friction" in said("explain", "coulomb_fricton", status=2)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.name)
def test_the_schema_takes_the_examples(file: Path, schema: dict[str, Any]) -> None:
    jsonschema.validate(tomllib.loads(file.read_text(encoding="utf-8")), schema)


@pytest.mark.parametrize("name", kinds())
def test_the_schema_takes_the_example_of_each_controller(name: str, schema: dict[str, Any]) -> None:
    shown = kinds()[name].example
    table = json.loads(json.dumps({"kind": name, "period_s": shown.period, **shown.table}))
    jsonschema.validate({"schema": 1, "name": "x", "controller": table}, schema)


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("schema = 1", "schema = 2"),
        ('train = ["train.csv"]', 'train = "train.csv"'),
        ('kind = "first_order"', 'kind = "third_order"'),
        ("free = true", "free = 1"),
        ("kp = 0.8", "kpp = 0.8"),
        ("low = -12", "least = -12"),
        ('number = "float32"', 'number = "float16"'),
        ("[target]", "[targets]"),
    ],
)
def test_the_schema_refuses_what_firmloop_refuses(
    good: str, bad: str, schema: dict[str, Any], project: Path, tmp_path: Path, said: Said
) -> None:
    jsonschema.validate(tomllib.loads(PROJECT), schema)
    assert good in PROJECT
    project.write_text(PROJECT.replace(good, bad))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(tomllib.loads(project.read_text()), schema)
    said("run", str(project), "--out", str(tmp_path / "out"), status=2)


def test_a_guessed_project_names_the_schema_that_it_keeps_to(
    project: Path, monkeypatch: pytest.MonkeyPatch, said: Said, schema: dict[str, Any]
) -> None:
    monkeypatch.chdir(project.parent)
    said("init", "train.csv", "test.csv")
    text = Path("train.toml").read_text(encoding="utf-8")
    assert text.splitlines()[0] == f"#:schema {Path(said('schema', '--path').strip()).as_uri()}"
    jsonschema.validate(tomllib.loads(text), schema)
