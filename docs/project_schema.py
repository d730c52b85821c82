"""Write docs/reference/project.schema.json: the project file for editors that complete and check TOML.

Keys and sentences are those of the page of the project file; only the type of what is no number stands below.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping

from library_pages import kind_keys
from project_page import SENTENCES, keys_by_table

from firmloop.codegen.target import target_names
from firmloop.design.kinds import kinds
from firmloop.design.tuning import rules
from firmloop.identify.bench_tests.excitations import excitations
from firmloop.identify.plants import kinds as plant_kinds
from firmloop.identify.plants.effects import effects
from firmloop.identify.recordings.hold import HOLDS
from firmloop.quantize.lower.words import ROUNDINGS

Schema = Mapping[str, object]

TEXT: Schema = {"type": "string"}
TEXTS: Schema = {"type": "array", "items": TEXT}
NUMBER: Schema = {"type": "number"}
WHOLE: Schema = {"type": "integer"}
TABLE: Schema = {"type": "object"}
EXPRESSIONS: Schema = {"type": "object", "additionalProperties": TEXT}


RULED = "pid"  # the kind that the tuning rules give the gains of; another kind's tune is its own


def one_of(words: Iterable[str]) -> Schema:
    """Return the schema of a choice."""
    return {"enum": sorted(words)}


TYPES: Mapping[str, Mapping[str, Schema]] = {
    "Top level": {"schema": {"const": 1}, "name": TEXT, "datasheet": TABLE, "standard_tests": TABLE},
    "[recordings]": {"train": TEXTS, "test": TEXTS, "hold": one_of(HOLDS), "per_recording": TEXTS},
    "[recordings.rename] COLUMN = { ... }": {"name": TEXT, "unit": TEXT},
    "[recordings.conditioning]": {
        **{key: TEXTS for key in ("remove_offset", "detrend", "align")},
        **{key: WHOLE for key in ("savgol_window", "savgol_order", "line_harmonics")},
    },
    "[plant]": {"input": TEXT, "inputs": TEXTS, "outputs": TEXTS},
    '[plant] with kind = "ode"': {
        **{"kind": {"const": "ode"}, "states": TEXTS, "inputs": TEXTS},
        **{key: EXPRESSIONS for key in ("outputs", "derivatives")},
    },
    "[plant.balances.STATE]": {
        "kind": one_of(("torque", "force", "voltage", "flow")),
        **{key: TEXT for key in ("per", "position", "speed", "effort", "current", "resistance", "to")},
    },
    "[plant.parameters] NAME = { ... }": {
        "free": {"type": "boolean"},
        "ci95": {"type": "array", "items": NUMBER, "minItems": 2, "maxItems": 2},
    },
    "[signals] NAME = { ... }": {"unit": TEXT},
    "[arithmetic]": {
        "number": one_of(("float32", "float64", "fixed")),
        "bits": {"enum": [16, 32]},
        "rounding": one_of(ROUNDINGS),
    },
    "[model]": {"structure": one_of(("arx", "oe", "n4sid")), "order": WHOLE, "delay_samples": WHOLE},
    "[experiment]": {"repeats": WHOLE},
}


def project_schema() -> str:
    """Return the schema as text."""
    known = keys_by_table()

    def table(title: str, **more: Schema) -> dict[str, object]:
        """Return a table with the keys of the page, each with its sentence."""
        types = {**TYPES.get(title, {}), **more}
        unused = types.keys() - set(known[title])
        assert not unused, f"docs/project_schema.py: {title} has no keys {sorted(unused)}"
        keys = {key: {**types.get(key, NUMBER), "description": SENTENCES[title][key]} for key in known[title]}
        return {"type": "object", "additionalProperties": False, "properties": keys}

    entry = {"anyOf": [NUMBER, table("[plant.parameters] NAME = { ... }")]}
    parts = {
        "recordings": table(
            "[recordings]",
            rename=_each({"anyOf": [TEXT, table("[recordings.rename] COLUMN = { ... }")]}),
            conditioning=table("[recordings.conditioning]"),
        ),
        "plant": _plant(table, _each(entry)),
        "controller": _controller(),
        "signals": _each({**table("[signals] NAME = { ... }"), "required": ["unit", "low", "high"]}),
        "arithmetic": {**table("[arithmetic]"), "patternProperties": {"^max_error_": NUMBER}},
        "target": table("[target]", names={**TEXTS, "examples": [list(target_names())]}),
        "tuning": table("[tuning]", rules={"type": "array", "items": one_of(rules())}, **_rule_tables()),
        "experiment": _experiment(table),
        "model": table("[model]"),
    }
    whole = {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "The project file of firmloop",
        **table("Top level", **parts),
        "required": ["schema", "name"],
    }
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def _each(entry: object) -> dict[str, object]:
    return {"type": "object", "additionalProperties": entry}


def _plant(table: object, parameters: Schema) -> Schema:
    """Choose between a named kind and equations as text by `kind`."""
    assert callable(table)
    listed = {name: {**TEXT, "description": str(effect.says)} for name, effect in effects().items()}
    entry = {
        "type": "object",
        "required": ["name"],
        "properties": {"name": {"enum": sorted(listed)}, "at": TEXT, "output": TEXT},
    }
    shared = {"parameters": parameters, "effects": {"type": "array", "items": entry}}
    named = table("[plant]", kind=one_of(plant_kinds.kinds()), **shared)
    balances = _each(table("[plant.balances.STATE]"))
    written = table('[plant] with kind = "ode"', balances=balances, **shared)
    is_ode = {"properties": {"kind": {"const": "ode"}}}
    return {"type": "object", "required": ["kind"], "if": is_ode, "then": written, "else": named}


def _controller() -> Schema:
    """List the keys of each kind; their types are as various as the kinds."""
    shared = {
        "kind": {**one_of(kinds()), "description": "the control law"},
        "period_s": {**NUMBER, "description": "time between two steps of the C, s"},
        "outputs": {**TEXTS, "description": 'signals that the controller puts out (default ["output"])'},
        "safe_output": {"description": "what a NaN or infinite input commands: a number, or a table by output"},
    }
    tuned = {key: f"of the tuning rule {rule.name}" for rule in rules().values() for key in rule.keys}
    cases = []
    for name, kind in kinds().items():
        own: dict[str, object] = {
            key: {"description": f"explained by: firmloop explain {name}"} for key in kind_keys(name, kind)
        }
        if name == RULED:
            own["tune"] = {**one_of(rules()), "description": "the rule that finds the gains"}
            own |= {key: {"description": says} for key, says in tuned.items() if key not in own}
        then = {"additionalProperties": False, "properties": {**dict.fromkeys(shared, True), **own}}
        cases.append({"if": {"properties": {"kind": {"const": name}}}, "then": then})
    return {"type": "object", "required": ["kind", "period_s"], "properties": shared, "allOf": cases}


def _rule_tables() -> dict[str, Schema]:
    return {
        rule.name: {"type": "object", "additionalProperties": False, "properties": dict.fromkeys(rule.keys, True)}
        for rule in rules().values()
    }


def _experiment(table: object) -> Schema:
    assert callable(table)
    shared: dict[str, object] = dict(table("[experiment]", signal=one_of(excitations())))
    own = {key: True for each in excitations().values() for key in each.keys}
    properties = shared["properties"]
    assert isinstance(properties, dict)
    return {**shared, "properties": {**own, **properties}}
