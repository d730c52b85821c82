r"""Cascade: loops one around the other, each at a rate of its own, as one controller with one step.

`[[controller.loops]]` lists them, the innermost first, which runs every period. A further loop commands an input of
the loop before it, runs every `every` periods, and its command is held until it runs again. All run in the first
sample. In a sample in which several run the outermost is first: a change of the reference passes through all at once::

    due[k] = (wait[k] <= 0)                      wait[k+1] = every - 1 where due, wait[k] - 1 elsewhere
    (x[k+1], u[k]) = loop(x[k], z[k]) where due, (x[k], u[k-1]) elsewhere

Keys of a loop beside those of its kind: `name` (begins the names of its state), `kind` (any that computes its outputs
without solving for them), `every` (default 1; a whole number, a multiple of that of the loop before it), `inputs` (its
own inputs = signals, such as `inputs = { measurement = "speed_rad_s" }`; a loop whose kind fixes the names, a `foc`,
takes the signals of these names), `commands` (the input of the loop before it that it puts out, default "reference"),
and `u_min` and `u_max`, the range of that command. The period of a loop is `every` times `period_s`.

A loop around a `foc` may be tuned: `tune` takes what `models/shaft.py` makes of the [plant] and of the loops inside as
its plant. A status bit of a slower loop is set in the samples in which that loop runs. What a loop has `tunable` is set
by a setter with the loop's name in front, such as `NAME_set_speed_u_max`.

Limit: the arithmetic of every loop is computed in every period, and what a loop gives while it is not due is dropped. A
program is one list of operations without branches, which its proofs, its checkers and its reference all read. A loop
that is skipped would lower the mean of a step's instructions and not the most: in the first sample all loops run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from firmloop.design.design import Bench, Design, Kind, Request
from firmloop.design.kinds import foc, kind_of
from firmloop.design.kinds.foc.wires import INPUTS, bench
from firmloop.design.law import DesignError, Flag, Law, Scalar
from firmloop.design.models.shaft import Shaft, shaft_of
from firmloop.design.table import check_keys, real
from firmloop.identify.signal import Signal

KEYS = ("loops",)
OWN = ("name", "kind", "every", "inputs", "commands")
WAIT_WHY = "it counts the periods until the loop runs again, down to 0"
HELD_WHY = "the command of a loop, held until it runs again, within u_min and u_max"
SLOWEST = 1_000_000  # periods; a counter of single precision is exact far beyond


@dataclass(frozen=True, slots=True)
class RatedLoop:
    """One loop as the table has it; `wires` are its own inputs and the signals that carry them."""

    name: str
    kind: Kind
    every: int  # periods
    wires: Mapping[str, str]
    commands: str
    table: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class MadeLoop:
    """A loop and the design of it, whose inputs stand in the order of `wires`."""

    loop: RatedLoop
    design: Design


def design(request: Request) -> Design:
    """Design every loop, the innermost first, and write them as one law."""
    check_keys(request.table, KEYS, "a cascade")
    loops = _loops(request.table)
    made: list[MadeLoop] = []
    shaft: Shaft | None = None
    for k, loop in enumerate(loops):
        inputs = _inputs(request, loops, k)
        outputs = request.outputs if k == 0 else (_command(loops, k, request),)
        plant = request.plant if k == 0 else shaft.plant(loop.wires.get("measurement", "")) if shaft else None
        part = Request(request.name, loop.table, request.period * loop.every, inputs, outputs, plant, request.optimum)
        try:
            found = loop.kind.design(part)
        except DesignError as error:
            raise DesignError(f"loop '{loop.name}': {error}") from None
        if found.law.solve is not None:
            raise DesignError(f"loop '{loop.name}' is a {loop.kind.name}, which solves in every sample; take a pid")
        made.append(MadeLoop(loop, found))
        shaft = _around(loop, found, shaft, part)
    _check_all_used(request, loops)
    gains = {f"{each.loop.name}_{key}": value for each in made for key, value in each.design.gains.items()}
    kept = [_kept(each, entry) for each, entry in zip(made, _entries(request.table), strict=True)]
    missed = {name: why for each in made for name, why in each.design.not_met.items()}
    tuned = ", ".join(f"{each.loop.name} by {each.design.tuned_by}" for each in made if each.design.tuned_by)
    return Design(_law(request, made), gains, tuned or None, {"loops": kept}, missed, bench=_bench(request, loops))


def _around(loop: RatedLoop, found: Design, shaft: Shaft | None, part: Request) -> Shaft | None:
    """Return what the loop around this one meets; None where nothing is known of it."""
    if loop.kind is foc.KIND:
        known = part.plant is not None and part.plant.kind == "pmsm"
        return shaft_of(part.plant, found.gains, part.period) if known and part.plant is not None else None
    if shaft is None or loop.kind.name != "pid":
        return None
    return shaft.closed(found.gains, loop.wires.get("measurement", ""), part.period)


def _entries(table: Mapping[str, object]) -> list[Mapping[str, object]]:
    listed = table.get("loops")
    if not isinstance(listed, list | tuple) or not listed or not all(isinstance(entry, dict) for entry in listed):
        raise DesignError(
            "controller.loops is missing or no list of tables; give one [[controller.loops]] for each, innermost first"
        )
    return list(listed)


def _kept(made: MadeLoop, entry: Mapping[str, object]) -> dict[str, object]:
    """Return a loop's table with the gains that were found instead of the rule."""
    told = {key: value for key, value in entry.items() if key not in made.design.asked}
    return {**told, **(made.design.gains if made.design.settings is None else made.design.settings)}


def _loops(table: Mapping[str, object]) -> list[RatedLoop]:
    loops: list[RatedLoop] = []
    for k, entry in enumerate(_entries(table), 1):
        name = entry.get("name")
        if not isinstance(name, str) or not name.isidentifier() or name in [loop.name for loop in loops]:
            raise DesignError(
                f"loop {k} of the cascade has name = {name!r}; give each a name of its own, of letters and digits, "
                "such as 'speed'"
            )
        kind = kind_of(str(entry.get("kind")))
        if kind is None or kind.name == "cascade":
            raise DesignError(f"loop '{name}' has kind = {entry.get('kind')!r}, which is none; take 'pid' or 'foc'")
        loops.append(_loop(name, kind, entry, loops[-1] if loops else None))
    return loops


def _loop(name: str, kind: Kind, entry: Mapping[str, object], inner: RatedLoop | None) -> RatedLoop:
    every = real(entry, "every", 1.0, 1.0, SLOWEST)
    before = inner.every if inner is not None else 1
    if every % before or (inner is None and every != 1):
        raise DesignError(
            f"loop '{name}' has every = {every:g}; it must be a whole number, "
            + (
                f"a multiple of the {before} of loop '{inner.name}'"
                if inner
                else "1 for the innermost, which sets the period"
            )
        )
    wires = entry.get("inputs", {})
    if not isinstance(wires, Mapping) or not all(isinstance(signal, str) for signal in wires.values()):
        raise DesignError(
            f"loop '{name}' has inputs = {wires!r}; write them like inputs = {{ measurement = \"speed_rad_s\" }}"
        )
    commands = str(entry.get("commands", "reference"))
    if inner is None and "commands" in entry:
        raise DesignError(f"loop '{name}' is the innermost and commands the controller's outputs; remove commands")
    table = {key: value for key, value in entry.items() if key not in OWN}
    return RatedLoop(name, kind, int(every), {**{wire: wire for wire in kind.wires}, **wires}, commands, table)


def _inputs(request: Request, loops: Sequence[RatedLoop], k: int) -> tuple[Signal, ...]:
    """Return the inputs of loop `k` under its own names, that of the loop around it among them."""
    loop, by_name = loops[k], {signal.name: signal for signal in request.inputs}
    commanded = loops[k + 1].commands if k + 1 < len(loops) else ""
    if commanded and loop.kind.wires and commanded not in loop.kind.wires:
        raise DesignError(
            f"loop '{loops[k + 1].name}' commands {commanded!r}, which is no input of loop '{loop.name}'; "
            f"known: {', '.join(loop.kind.wires)}"
        )
    found = []
    for own in dict.fromkeys([*([commanded] if commanded else []), *loop.wires]):
        if own == commanded:
            found.append(_command(loops, k + 1, request))
            continue
        signal = by_name.get(loop.wires[own])
        if signal is None:
            raise DesignError(
                f"loop '{loop.name}' takes {loop.wires[own]!r} as its {own}, which [signals] does not hold as an "
                f"input: {', '.join(by_name)}"
            )
        found.append(replace(signal, name=own))
    return tuple(found)


def _command(loops: Sequence[RatedLoop], k: int, request: Request) -> Signal:
    """Return what loop `k` puts out: an input of the loop before it, within its own limits."""
    loop, inner = loops[k], loops[k - 1]
    for key in ("u_min", "u_max"):
        if key not in loop.table:
            raise DesignError(f"loop '{loop.name}' has no {key}; give the range of its command, {loop.commands}")
    low, high = real(loop.table, "u_min", None), real(loop.table, "u_max", None)
    if low >= high:
        raise DesignError(f"loop '{loop.name}' has u_min = {low:g} and u_max = {high:g}; u_min must be below u_max")
    units = {signal.name: signal.unit for signal in request.inputs}
    unit = INPUTS.get(loop.commands) if inner.kind is foc.KIND else units.get(inner.wires.get("measurement", ""))
    return Signal(loop.commands, unit or "1", low, high)


def _check_all_used(request: Request, loops: Sequence[RatedLoop]) -> None:
    taken = {
        signal
        for k, loop in enumerate(loops)
        for own, signal in loop.wires.items()
        if k + 1 == len(loops) or own != loops[k + 1].commands
    }
    for signal in request.inputs:
        if signal.name not in taken:
            raise DesignError(f"signals.{signal.name} is no input of any loop; name it in inputs, or remove it")


def _law(request: Request, made: Sequence[MadeLoop]) -> Law:
    """Write one sample: the outermost loop first."""
    z = {signal.name: ca.SX.sym(signal.name) for signal in request.inputs}
    state: list[tuple[Signal, float, str]] = []
    tunable: list[tuple[Signal, float, str]] = []  # behind all other state
    symbols: list[ca.SX] = []
    set_to: list[ca.SX] = []
    nexts: list[ca.SX] = []
    flags: list[tuple[Flag, ca.SX]] = []
    named: list[tuple[Signal, ca.SX]] = []
    command: tuple[str, ca.SX] | None = None
    outputs = ca.SX()
    for each in reversed(made):
        loop, law = each.loop, each.design.law
        x = ca.SX.sym(loop.name, len(law.state))
        wires = [_wire(signal.name, loop, command, z) for signal in law.inputs]
        after, outputs, bits, inner = law.last.function(x, ca.vertcat(*wires))
        own = len(law.state) - len(law.tunable)
        before, following = (ca.vertsplit(part) if law.state else [] for part in (x, after))
        following, told = following[:own], ca.vertsplit(bits)
        if loop.every > 1:
            wait, held = ca.SX.sym("wait"), ca.SX.sym("held")
            due = wait <= 0
            following = [ca.if_else(due, new, old) for new, old in zip(following, before[:own], strict=True)]
            outputs = ca.if_else(due, outputs, held)
            told = [ca.logic_and(due, bit) for bit in told]
            output = law.outputs[0]
            kept = (
                (Signal(f"{loop.name}_wait", "1", 0.0, loop.every - 1.0), 0.0, WAIT_WHY),
                (replace(output, name=f"{loop.name}_held"), min(max(0.0, output.low), output.high), HELD_WHY),
            )
            state += kept
            symbols += [wait, held]
            nexts += [ca.if_else(due, loop.every - 1.0, wait - 1.0), outputs]
            named.append((Signal(f"{loop.name}_due", "", -math.inf, math.inf), due))
        every = [
            (replace(signal, name=f"{loop.name}_{signal.name}"), start, why)
            for signal, start, why in zip(law.state, law.start, law.why, strict=True)
        ]
        state, tunable = state + every[:own], tunable + every[own:]
        symbols, set_to = symbols + before[:own], set_to + before[own:]
        nexts += following
        flags += [
            (replace(flag, name=f"{loop.name}_{flag.name}"), bit) for flag, bit in zip(law.flags, told, strict=True)
        ]
        named += [
            (replace(signal, name=f"{loop.name}_{signal.name}"), value)
            for signal, value in zip(law.last.named, ca.vertsplit(inner) if law.last.named else [], strict=True)
        ]
        if loop is not made[0].loop:
            command = loop.commands, outputs
            named.append((replace(law.outputs[0], name=f"{loop.name}_command", low=-math.inf, high=math.inf), outputs))
    state += tunable
    stage = ca.Function(
        "law",
        [ca.vertcat(*symbols, *set_to), ca.vertcat(*z.values())],
        [
            ca.densify(ca.vertcat(*nexts, *set_to)),
            ca.densify(outputs),
            ca.densify(ca.vertcat(*(bit for _, bit in flags))),
            ca.densify(ca.vertcat(*(value for _, value in named))),
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    return Law(
        name=request.name,
        says="cascade of " + "; ".join(_says(each) for each in made),
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=tuple(signal for signal, _, _ in state),
        start=tuple(start for _, start, _ in state),
        why=tuple(why for _, _, why in state),
        flags=tuple(flag for flag, _ in flags),
        stages=(Scalar(stage, tuple(signal for signal, _ in named)),),
        paired=False,
        tunable=tuple(signal.name for signal, _, _ in tunable),
    )


def _wire(own: str, loop: RatedLoop, command: tuple[str, ca.SX] | None, z: Mapping[str, ca.SX]) -> ca.SX:
    return command[1] if command is not None and command[0] == own else z[loop.wires[own]]


def _says(made: MadeLoop) -> str:
    often = "every period" if made.loop.every == 1 else f"every {made.loop.every} periods"
    return f"{made.loop.name}, {often}: {made.design.law.says}"


def _bench(request: Request, loops: Sequence[RatedLoop]) -> Bench | None:
    """Return the plant that the outermost loop follows its reference with; None where there is none."""
    last = loops[-1]
    told, measured = (last.wires.get(own, "") for own in ("reference", "measurement"))
    if loops[0].kind is not foc.KIND or not told or not measured:
        return None
    signal = next(wire for wire in request.inputs if wire.name == measured)
    return bench(request, told, signal)


PID = {"kind": "pid", "b": 1.0}
KIND = Kind(
    name="cascade",
    says="loops around each other, each at its own rate",
    design=design,
    example=Request(
        name="spindle",
        table={
            "loops": [
                {"name": "current", "kind": "foc", **foc.KIND.example.table},
                {
                    **{"name": "speed", **PID, "kp": 0.01, "ki": 0.5, "every": 4, "commands": "reference_q_A"},
                    **{"inputs": {"measurement": "speed_rad_s"}, "u_min": -3.0, "u_max": 3.0},
                },
                {
                    **{"name": "position", **PID, "kp": 40.0, "every": 12, "u_min": -800.0, "u_max": 800.0},
                    **{"inputs": {"reference": "reference_rad", "measurement": "position_rad"}},
                },
            ],
        },
        period=foc.KIND.example.period,
        inputs=(
            Signal("reference_rad", "rad", -20.0, 20.0),
            Signal("position_rad", "rad", -20.0, 20.0),
            *(wire for wire in foc.KIND.example.inputs if wire.name != "reference_q_A"),
        ),
        outputs=foc.KIND.example.outputs,
        plant=None,
    ),
)
