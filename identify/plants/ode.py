"""Build a plant whose equations a user wrote as text: kind `ode`.

Effects act on balances. Where `[plant.balances]` is left out, units tell them: the derivative of a speed, current,
voltage, temperature or level is one where it is some sum over its one inertia, inductance, capacity or area.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import casadi as ca

from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.expression import read_expression
from firmloop.identify.plants.kind import PlantConstant, equations
from firmloop.identify.plants.kinds import read_parameter
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.plants.usual_balances import usual_balances
from firmloop.identify.signal import Signal
from firmloop.identify.units import unit_of

_BALANCE_KEYS = ("kind", "per", "position", "speed", "effort", "current", "resistance", "to")
_BALANCE_KINDS = ("torque", "force", "voltage", "flow")


def make_ode(table: Mapping[str, object]) -> Plant:
    """Build the plant from `[plant]`; IdentifyError names the key and shows the text that is wrong."""
    states, inputs = _names(table, "states"), _names(table, "inputs")
    outputs, derivatives = _texts(table, "outputs"), _texts(table, "derivatives")
    given = _table(table, "parameters")
    for key in given:
        if not isinstance(key, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", key):
            raise IdentifyError(f"plant.parameters.{key}: a name in an expression has letters, digits and _ only")
    names = (*states, *inputs, *given)
    for position, name in enumerate(names):
        if name in names[:position]:
            raise IdentifyError(f"plant.{'parameters' if name in given else 'inputs'}: {name} stands for two things")
    if set(derivatives) != set(states):
        wrong = next(iter(sorted(set(derivatives) ^ set(states))))
        rule = "is no state" if wrong in derivatives else "is missing: every state needs one"
        raise IdentifyError(f"plant.derivatives.{wrong} {rule}; the states are {', '.join(states)}")
    said = str([derivatives, outputs, table.get("balances")])
    idle = next((name for name in given if not re.search(rf"\b{name}\b", said)), None)
    if idle is not None:
        raise IdentifyError(f"plant.parameters.{idle} stands in no expression, so that nothing tells it; remove it")
    constants = tuple(
        read_parameter(
            "ode", PlantConstant(name, unit_of(name), -math.inf, math.inf, open_low=False, guessable=False), given
        )
        for name in given
    )
    x, u, p = ca.SX.sym("x", len(states)), ca.SX.sym("u", len(inputs)), ca.SX.sym("p", len(given))
    values = [*ca.vertsplit(x), *ca.vertsplit(u), *(ca.vertsplit(p) if given else [])]
    known = dict(zip(names, values, strict=True))
    rates = [read_expression(derivatives[name], known, f"plant.derivatives.{name}") for name in states]
    if "balances" not in table:
        table = {**table, "balances": usual_balances(dict(zip(states, rates, strict=True)), known, list(given))}
    readings = [read_expression(text, known, f"plant.outputs.{name}") for name, text in outputs.items()]
    pushing, feeding = (
        {
            state: [name for name in names if ca.depends_on(rate, known[name])]
            for state, rate in zip(states, rates, strict=True)
        }
        for names in (inputs, states)
    )
    return Plant(
        kind="ode",
        states=tuple(_signal(name) for name in states),
        inputs=tuple(_signal(name) for name in inputs),
        outputs=tuple(_signal(name) for name in outputs),
        parameters=constants,
        rate=equations("rate", x, u, p, ca.vertcat(*rates)),
        reading=equations("reading", x, u, p, ca.vertcat(*readings)),
        delay=None,
        balances=_balances(table, states, (pushing, feeding), known, (x, u, p), _straight(rates, ca.vertcat(x, u))),
    )


def _balances(
    table: Mapping[str, object],
    states: Sequence[str],
    acting: tuple[Mapping[str, Sequence[str]], Mapping[str, Sequence[str]]],
    known: Mapping[str, ca.SX],
    symbols: tuple[ca.SX, ca.SX, ca.SX],
    straight: bool,
) -> tuple[Balance, ...]:
    (pushing, feeding), (x, u, p) = acting, symbols  # inputs and states on which each derivative depends
    made = []
    tables = _table(table, "balances")
    order = {name: place for place, name in enumerate(states)}
    listed = sorted(tables.items(), key=lambda item: order.get(item[0], len(order)))  # lines have no order
    flows = [name for name, entry in listed if isinstance(entry, Mapping) and entry.get("kind") == "flow"]
    for name, entry in listed:
        where = f"plant.balances.{name}"
        if name not in states:
            raise IdentifyError(f"{where}: {name} is no state; a balance is one of {', '.join(states)}")
        if not isinstance(entry, Mapping):
            raise IdentifyError(f'{where} is {entry!r}; write {{ kind = "force", per = "1/m_kg" }}')
        for key in entry:
            if key not in _BALANCE_KEYS:
                raise IdentifyError(f"{where}.{key} is unknown; a balance has {', '.join(_BALANCE_KEYS)}")
        kind = entry.get("kind")
        if kind not in _BALANCE_KINDS:
            raise IdentifyError(f"{where}.kind is {kind!r}; it is one of {', '.join(_BALANCE_KINDS)}")
        if entry.get("speed", name) != name and kind in ("torque", "force"):
            raise IdentifyError(f"{where}.speed is {entry['speed']!r}; it must be the state itself, {name}")
        per = read_expression(entry.get("per", 1.0), known, f"{where}.per")
        if ca.depends_on(per, ca.vertcat(x, u)):
            raise IdentifyError(f"{where}.per is {entry['per']!r}; it may use parameters only, such as 1/m_kg")
        forms = {}
        for key in ("effort", "current"):
            text = entry.get(key, _usual(key, str(kind), name, pushing[name]))
            if text is not None:
                form = read_expression(text, known, f"{where}.{key}")
                if not _straight([form], ca.vertcat(x, u)) and (straight or key == "current"):
                    raise IdentifyError(
                        f"{where}.{key} is {text!r}; it must be linear in states and inputs"
                        + (", as the derivatives are" if key == "effort" else "")
                    )
                forms[key] = equations(key, x, u, p, form)
        resistance = entry.get("resistance")
        made.append(
            Balance(
                kind=str(kind),
                state=states.index(name),
                per=ca.Function("per", [p], [per]),
                position=_state(entry, "position", states, where),
                to=_next(entry, name, flows, states, feeding, where),
                effort=forms.get("effort"),
                current=forms.get("current"),
                resistance=None
                if resistance is None
                else ca.Function("resistance", [p], [read_expression(resistance, known, f"{where}.resistance")]),
            )
        )
    return tuple(made)


def _straight(forms: Sequence[ca.SX], by: ca.SX) -> bool:
    """Tell whether expressions are linear in states and inputs."""
    return not ca.depends_on(ca.jacobian(ca.vertcat(*forms), by), by)


def _usual(key: str, kind: str, state: str, inputs: Sequence[str]) -> str | None:
    """Return what a balance means where it does not say: a force is the input in N, a current the state itself.

    `inputs` are those that act on the state; what drives one body gives the next nothing.
    """
    if key == "current":
        return state if kind == "voltage" else None
    unit = {"torque": "N*m", "force": "N"}.get(kind)
    return next((name for name in inputs if unit is not None and unit_of(name) == unit), None)


def _state(entry: Mapping[str, object], key: str, states: Sequence[str], where: str) -> int:
    name = entry.get(key)
    if name is None:
        return -1
    if name not in states:
        raise IdentifyError(f"{where}.{key} is {name!r}; it must be one of the states {', '.join(states)}")
    return list(states).index(str(name))


def _next(
    entry: Mapping[str, object],
    name: str,
    flows: Sequence[str],
    states: Sequence[str],
    feeding: Mapping[str, Sequence[str]],
    where: str,
) -> int:
    """Return where an overflow runs: as said, else where the state itself runs, nowhere from the last of a row.

    Of flows that feed each other, or none the other, it is the next one that is listed.
    """
    if "to" in entry:
        return _state(entry, "to", states, where)
    others = [other for other in flows if other != name]
    downhill = [other for other in others if name in feeding[other] and other not in feeding[name]]
    uphill = [other for other in others if other in feeding[name] and name not in feeding[other]]
    behind = [other for other in flows[flows.index(name) + 1 :] if other not in uphill] if name in flows else []
    return next((list(states).index(other) for other in (*downhill, *behind)), -1)


def _signal(name: str) -> Signal:
    return Signal(name, unit_of(name), -math.inf, math.inf)


def _names(table: Mapping[str, object], key: str) -> tuple[str, ...]:
    value = table.get(key)
    if not isinstance(value, list | tuple) or not value:
        raise IdentifyError(f'plant.{key} is {value!r}; an ode names them: {key} = ["x_m", "v_m_s"]')
    for name in value:
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
            raise IdentifyError(f"plant.{key}: {name!r} must be a name of letters, digits and _")
    return tuple(value)


def _texts(table: Mapping[str, object], key: str) -> Mapping[str, object]:
    value = _table(table, key)
    if not value:
        raise IdentifyError(f"plant.{key} is missing; an ode has [plant.{key}] with one expression a line")
    return value


def _table(table: Mapping[str, object], key: str) -> Mapping[str, object]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise IdentifyError(f"plant.{key} is {value!r}; it must be a table [plant.{key}]")
    return value
