"""Write the pages of plants, effects, controllers and targets from the folders that hold them."""

from __future__ import annotations

import importlib
import inspect
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from importlib import resources

from project_page import NO_KEY, known_keys

from firmloop.codegen.target import load_target, parse_target, target_names
from firmloop.design.kinds import Kind, Request, design, kinds
from firmloop.design.tuning import rules
from firmloop.identify.plants import kinds as plant_kinds
from firmloop.identify.plants import ode
from firmloop.identify.plants.effect import Effect, Site
from firmloop.identify.plants.effects import effects

SHAFT = Site(
    rotary=True,
    effort="N_m",
    travel="rad",
    input="V",
    input_unit="V",
    output=0,
    output_name="speed_rad_s",
    output_ending="rad_s",
    output_unit="rad/s",
    level_unit="m",
    balance=0,
)
HEADINGS = {
    "torque": "In the torque or force balance",
    "voltage": "In the voltage balance",
    "actuator": "In the actuator",
    "sensor": "In the sensor",
    "flow": "In a flow balance",
    "timing": "In the timing",
}
TESTED = {
    "run": "run in the tests",
    "built": "built and measured in the tests, not run",
}


TABLES = ("loops",)  # of a kind: an example shows them one below the other
LEFT_OUT = {
    "output_at_rest": "that of the output | any | left out: 0",
    "input_at_rest": "that of the input | any | left out: 0; what the input is before the first row, too",
    "gear_ratio": "motor turns per output turn | > 0 | left out: 1",
}


def plants_page() -> str:
    """Return docs/reference/plants.md."""
    parts = [
        "# Plants",
        "`[plant] kind = ...`. A parameter that may be left out is estimated from the recordings. All values are in SI "
        "units; the unit is the end of the name.",
    ]
    for name, kind in sorted(plant_kinds.kinds().items()):
        module = importlib.import_module(f"{plant_kinds.__name__}.{name}")
        drive = " or ".join(_names(each) for each in kind.inputs) or "any one column"
        answers = _names(kind.outputs) or "any one column"
        if kind.per_unit:
            drive += f", or any drive signal with `{kind.per_unit}`"
        rows = "\n".join(
            f"| `{each.name}` | {each.unit or 'output per input'} | {_range(each.low, each.high, each.open_low)} | "
            f"{'may be left out' if each.guessable else 'must be given'}{', a whole number' * each.counted} |"
            for each in kind.constants
        )
        rows += "".join(f"\n| `{each.name}` | {LEFT_OUT[each.name]} |" for each in kind.optional(("",), ("",)))
        parts.append(
            f"## {name}\n\n{prose(module.__doc__)}\n\nInput: {drive}. Outputs: {answers}.\n\n"
            f"| parameter | unit | range | |\n|---|---|---|---|\n{rows}"
        )
    parts.append(
        f"## ode\n\n{prose(ode.__doc__)}\n\nThe keys are listed in [the project file](project.md). An example:\n\n"
        + _toml(ODE)
    )
    return "\n\n".join(parts) + "\n"


ODE = """[plant]
kind = "ode"
states = ["x_m", "v_m_s"]
inputs = ["force_N"]
[plant.outputs]
position_m = "x_m"
[plant.derivatives]
x_m = "v_m_s"
v_m_s = "(force_N - c_N_s_m*v_m_s - k_N_m*x_m) / m_kg"
[plant.balances]
v_m_s = { kind = "force", per = "1/m_kg", position = "x_m", speed = "v_m_s" }
[plant.parameters]
m_kg = { value = 1.0, free = true }
c_N_s_m = { value = 2.0, free = true }
k_N_m = { value = 50.0, free = true }
"""


def effects_page() -> str:
    """Return docs/reference/effects.md."""
    known = effects()
    parts = [
        "# Effects",
        f"Physics beyond the nominal equations: {len(known)} effects that a project may hold as `[[plant.effects]]`, "
        "that `simulate` computes, `identify` fits and `diagnose` finds. Names are those of a rotary plant; on a "
        "linear stage `N_m` reads `N` and `rad` reads `m`. Endings of sensor effects are the unit of the reading they "
        "act on (here a speed), those of actuator effects the unit of the input (here V). w is the speed, theta the "
        "position.",
    ]
    for equation in HEADINGS:
        rows = "\n".join(_effect_row(effect) for effect in known.values() if effect.equation == equation)
        parts.append(f"## {HEADINGS[equation]}\n\n| name | term | parameters | meaning |\n|---|---|---|---|\n{rows}")
    others = {effect.equation for effect in known.values()} - set(HEADINGS)
    assert not others, f"docs/library_pages.py: HEADINGS lacks {others}"
    rows = "\n".join(
        f"| `{effect.name}` | {_names(effect.confusable_with) or '-'} | {effect.experiment} |"
        for effect in known.values()
    )
    parts.append(
        "## What may look alike, and the recording that tells them apart\n\n"
        f"| effect | may look like | experiment |\n|---|---|---|\n{rows}"
    )
    return "\n\n".join(parts) + "\n"


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _effect_row(effect: Effect) -> str:
    values = []
    for parameter in effect.parameters(SHAFT):
        given = "" if parameter.default is None else f", default {parameter.default:g}"
        values.append(f"`{parameter.name}` ({parameter.unit or '1'}{given})")
    needs = " Needs a position." if effect.needs_position else ""
    only = " Rotary plants only." if effect.rotary_only else ""
    term = effect.term.replace("|", "\\|")
    return f"| `{effect.name}` | {term} | {', '.join(values) or 'none'} | {effect.says}.{needs}{only} |"


def controllers_page() -> str:
    """Return docs/reference/controllers.md."""
    rows = "\n".join(f"| [`{name}`](#{name}) | {kind.says} |" for name, kind in kinds().items())
    tuned = "\n".join(f"| `{name}` | {rule.says} | {_names(rule.keys) or 'none'} |" for name, rule in rules().items())
    parts = [
        "# Controllers",
        '`[controller] kind = ...`, with `period_s` (s), `outputs` (default `["output"]`), `safe_output` (what a NaN '
        "or infinity at an input commands, in floating point: a number, or a table by output; default the low limit) "
        "and the keys of the kind. "
        "Inputs are the other entries of `[signals]`, in the order of the file. A key may say more in another kind's "
        "section: follow the link.",
        f"| kind | what it is |\n|---|---|\n{rows}",
        "## Tuning rules\n\n`pid` takes `tune = ...` in place of gains; the rule works on `[plant]`.\n\n"
        f"| rule | what it does | its own keys |\n|---|---|---|\n{tuned}",
    ]
    parts += [_controller(name, kind) for name, kind in kinds().items()]
    return "\n\n".join(parts) + "\n"


def _controller(name: str, kind: Kind) -> str:
    module = importlib.import_module(kind.design.__module__)
    shown = kind.example
    keys = _names(kind_keys(name, kind))
    bits = ", ".join(f"`{flag.name}` ({flag.says})" for flag in kind.design(shown).law.flags)
    return (
        f"## {name}\n\n{prose(module.__doc__)}\n\nKeys: {keys}.\n\nStatus bits of `step`: {bits or 'none'}.\n\n"
        f"Example:\n\n{_toml(_example(name, shown))}"
    )


def kind_keys(name: str, kind: Kind) -> tuple[str, ...]:
    """Return the keys of [controller] that only this kind has."""
    shown = kind.example

    def read() -> object:
        table = {**shown.table, NO_KEY: 1}
        return design(name, shown.name, table, shown.period, shown.inputs, shown.outputs, shown.plant)

    return known_keys(read)


def _example(name: str, shown: Request) -> str:
    lines = ["[controller]", f'kind = "{name}"', f"period_s = {shown.period:g}"]
    outputs = [signal.name for signal in shown.outputs]
    if outputs != ["output"]:
        lines.append(f"outputs = {_value(outputs)}")
    lists = {key: value for key, value in shown.table.items() if key in TABLES}
    lines += [f"{key} = {_value(value)}" for key, value in shown.table.items() if key not in lists]
    for key, tables in lists.items():
        for table in tables:
            lines += ["", f"[[controller.{key}]]", *(f"{own} = {_value(value)}" for own, value in table.items())]
    lines += ["", "[signals]"]
    lines += [
        f'{each.name} = {{ unit = "{each.unit}", low = {each.low:g}, high = {each.high:g} }}'
        for each in (*shown.inputs, *shown.outputs)
    ]
    return "\n".join(lines) + "\n"


def targets_page() -> str:
    """Return docs/reference/targets.md."""
    known = [load_target(name) for name in target_names()]
    rows = "\n".join(
        f"| `{each.name}` | {each.says} | {', '.join(each.links)} | {TESTED.get(each.tested, each.tested)} |"
        for each in known
    )
    keys = "\n".join(_target_keys())
    return (
        "# Targets\n\nOne TOML file in `targets/` is one target. `host` is this machine. Real boards are linked and "
        "checked in the tests; they have not run on hardware there.\n\n"
        f"| name | what it is | links | tested |\n|---|---|---|---|\n{rows}\n\n"
        "## A target of your own\n\nCopy the nearest file, give it another name and name its path in `[target] names` "
        "or `--target`. A target is data: its `compiler` is one of a list, its `flags` change code only, and its "
        "`sources` are C files of the same folder.\n\n"
        f"| table of a target | keys |\n|---|---|\n{keys}\n"
    )


def _target_keys() -> Iterator[str]:
    board = resources.files("firmloop").joinpath("targets", "nucleo_f401re.toml").read_text(encoding="utf-8")
    emulated = resources.files("firmloop").joinpath("targets", "qemu_mps2_an386.toml").read_text(encoding="utf-8")
    odd = f"{NO_KEY} = 1"
    asked = {
        "top level": f"{odd}\n{board}",
        "`[[memory]]`": board.replace("[[memory]]", f"[[memory]]\n{odd}", 1),
        "`[uart]`": board.replace("[uart]", f"[uart]\n{odd}"),
        "`[timer]`": board.replace("[timer]", f"[timer]\n{odd}"),
        "`[flash]`": board.replace("[flash]", f"[flash]\n{odd}"),
        "`setup = [...]`": board.replace("{ address", f"{{ {odd}, address", 1),
        "`[qemu]`": emulated.replace("[qemu]", f"[qemu]\n{odd}"),
    }
    for place, text in asked.items():
        name = "qemu_mps2_an386.toml" if text.endswith(emulated[-20:]) else "nucleo_f401re.toml"
        keys = known_keys(partial(parse_target, text, name, resources.files("firmloop").joinpath("targets")))
        yield f"| {place} | {_names(keys)} |"


def prose(text: str | None) -> str:
    """Turn a module's docstring into Markdown: formulas are its indented blocks, files of other kinds are links."""
    assert text
    body = inspect.cleandoc(text)
    known: Mapping[str, object] = kinds()
    body = re.sub(r"`(\w+)\.py`", lambda m: f"[`{m[1]}`](#{m[1]})" if m[1] in known else m[0], body)
    lines: list[str] = []
    for line in re.sub(r"::(?=\n|$)", ":", body).split("\n"):
        opens = line.startswith("- ") and lines and lines[-1] and not lines[-1].startswith(("- ", "  "))
        lines += ["", line] if opens else [line]
    return "\n".join(lines)


def _range(low: float, high: float, open_low: bool) -> str:
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(high):
        return f"{'above' if open_low else 'from'} {low:g}"
    return f"{'above ' if open_low else ''}{low:g} to {high:g}"


def _toml(text: str) -> str:
    return f"```toml\n{text}```"


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return repr(value)
