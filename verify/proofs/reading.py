"""Read proof.json strictly: what a document claims of a program, or a refusal that names what is missing or wrong.

Nothing of the generator is used. What holds for every judge is asked here: known schema and arithmetic, all keys, whole
numbers that are whole, ranges in order, every name said once and known where it is read, one successor for each state.
What the operations do to ranges and words is left to the judges.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

from firmloop.verify.proofs.claims import (
    LEAST,
    OF_A_PLAN,
    PLANS,
    Argument,
    ClaimedOperation,
    Claims,
    Held,
    Number,
    ProofError,
    Routine,
)

ARITHMETICS = ("fixed32", "fixed16", "float32", "float64")
ROUNDS = ("nearest", "floor")
SCHEMA = 1
LARGEST = 1 << 63  # nothing that the C holds is larger
NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
SUPPORT = re.compile(r"fl_\w+\.h", re.ASCII)  # a header of the operations over tables
WORDS = {"inputs": (16, 32), "state": (32,), "outputs": (16, 32), "operations": (32, 64)}  # of fixed point


def read_claims(document: Mapping[str, Any]) -> Claims:
    """Return what the document claims.

    Raises
    ------
    ProofError
        when it is no proof.json of a known schema, or contradicts itself.
    """
    try:
        whole = json.loads(json.dumps(document, allow_nan=False))  # what a file of it would hold, and nothing else
    except (TypeError, ValueError, RecursionError) as error:
        raise ProofError(f"proof.json cannot be written as JSON ({error}); generate it again") from None
    if not isinstance(whole, dict) or not whole:
        raise ProofError("proof.json holds no claims; generate it again")
    if not _is_whole(whole.get("schema")) or whole["schema"] != SCHEMA:
        raise ProofError(f"proof.json has schema {whole.get('schema')!r}, known is {SCHEMA}; generate it again")
    for key, known in (("arithmetic", ARITHMETICS), ("rounds", ROUNDS)):
        if _text(whole, key, "proof.json") not in known:
            raise ProofError(f"proof.json: {key} {whole[key]!r} is unknown; known: {', '.join(known)}")
    fixed = whole["arithmetic"].startswith("fixed")
    state = _rows(whole, "state")
    outputs = _rows(whole, "outputs")
    following: dict[str, str] = {}
    for row in _rows(whole, "next_state"):
        target = _text(row, "state", "next_state")
        if target in following:
            raise ProofError(f"state {target!r} is given two successors")
        following[target] = _text(row, "value", f"the successor of {target}")
    unset = whole["unset"] if "unset" in whole else _missing("unset", "proof.json")
    period = _number(whole, "period_s", "proof.json")
    if not re.fullmatch("[0-9a-f]{16}", _text(whole, "program_id", "proof.json")):
        raise ProofError(f"proof.json: program_id {whole['program_id']!r} is not 16 hexadecimal digits")
    claims = Claims(
        name=_name(whole, "proof.json"),
        program_id=whole["program_id"],
        arithmetic=whole["arithmetic"],
        period=float(period),
        inputs=tuple(_held(row, "inputs", fixed) for row in _rows(whole, "inputs")),
        outputs=tuple(_held(row, "outputs", fixed) for row in outputs),
        results=tuple(_text(row, "value", f"output {row.get('name')}") for row in outputs),
        state=tuple(_held(row, "state", fixed) for row in state),
        start=tuple(_start(row, fixed) for row in state),
        following=following,
        unset=unset,
        parameters=tuple(_parameter(row, fixed) for row in _rows(whole, "parameters")),
        operations=tuple(_operation(row, fixed) for row in _rows(whole, "operations")),
        tables=tuple(_table(row) for row in _rows(whole, "tables")),
        routines=tuple(_routine(row, fixed) for row in _rows(whole, "routines")),
        status=tuple(
            (_name(row, "status"), _integer(row, "bit", "status"), _text(row, "value", "status"))
            for row in _rows(whole, "status")
        ),
        any_state=_any_state(whole) if fixed else {},
        safe=() if fixed else tuple(_number(row, "safe", f"output {row.get('name')}") for row in outputs),
    )
    _check_names(claims)
    if claims.fixed:
        _check_unset(claims)
    return claims


def _check_names(claims: Claims) -> None:
    """Assert that every name is said once, is known where it is read, and that every state has a successor."""
    groups: dict[str, Sequence[str]] = {
        "input": [v.name for v in claims.inputs],
        "output": [v.name for v in claims.outputs],
        "state": [v.name for v in claims.state],
        "operation": [op.result.name for op in claims.operations],
        "table": [table["name"] for table in claims.tables],
        "routine": [routine.name for routine in claims.routines],
        "parameter": [name for name, *_ in claims.parameters],
        "status bit": [name for name, *_ in claims.status],
    }
    for what, names in groups.items():
        for name in names:
            if names.count(name) > 1:
                raise ProofError(f"{what} {name!r} is named twice")
    if not claims.outputs:
        raise ProofError("proof.json names no output; a controller has one")
    known = {f"in.{name}" for name in groups["input"]} | {f"self.{name}" for name in groups["state"]}
    given = {f"table.{name}" for name in groups["table"]} | {f"routine.{name}" for name in groups["routine"]}
    _check_order(claims.operations, known | given)
    known |= set(groups["operation"])
    plans = {op.result.name for op in claims.operations if op.function in PLANS}
    _check_plans(claims.operations, plans)
    states = set(groups["state"])
    for name in (*claims.following, *groups["parameter"]):
        if name not in states:
            raise ProofError(f"{name!r} is no state, but has a successor or a setter")
    for name in groups["state"]:
        if name not in claims.following:
            raise ProofError(f"state {name!r} has no successor")
    stored = [*zip(claims.following, claims.following.values(), strict=True)]
    stored += [
        *zip(groups["output"], claims.results, strict=True),
        *((name, value) for name, _, value in claims.status),
    ]
    for name, source in stored:
        if source not in known or source in plans:
            raise ProofError(f"{name} is given {source!r}, which is no value of the program")
    for name in claims.any_state:
        if name not in groups["operation"]:
            raise ProofError(f"any_state gives a range for {name!r}, which is no operation")
    if claims.unset is not None and claims.unset not in states:
        raise ProofError(f"unset {claims.unset!r} is no state")
    last = [v.name for v in claims.state][len(claims.state) - len(claims.parameters) :]
    if list(groups["parameter"]) != last:
        raise ProofError("the parameters are not the last states, in the same order")
    _check_safe(claims)
    _check_bits(claims)
    _check_routines(claims)


def _check_safe(claims: Claims) -> None:
    """Assert that an operation tells that an input is not finite, and that what is commanded then keeps its range."""
    if claims.safe and (not claims.status or claims.status[-1][2] not in {op.result.name for op in claims.operations}):
        raise ProofError("the last status bit is no operation that tells that an input is not finite")
    for output, safe in zip(claims.outputs, claims.safe, strict=bool(claims.safe)):
        if output.low is None or output.high is None or not output.low <= safe <= output.high:
            raise ProofError(f"output {output.name} is {safe} where an input is not finite, out of its range")


def _check_bits(claims: Claims) -> None:
    """Assert that every status bit is one of a 32-bit word, and no other one's."""
    bits = [bit for _, bit, _ in claims.status]
    if len(set(bits)) != len(bits) or any(not 0 <= bit < 32 for bit in bits):
        raise ProofError(f"the status bits {bits} are not different bits of a 32-bit word")


def _check_routines(claims: Claims) -> None:
    """Assert that what a routine gives is said in it."""
    for routine in claims.routines:
        inner = {f"in.{name}" for name in routine.inputs}
        _check_order(routine.operations, inner)
        for source in routine.results:
            if source not in inner | {op.result.name for op in routine.operations}:
                raise ProofError(f"routine {routine.name} gives {source!r}, which is no value of it")


def _check_order(operations: Sequence[ClaimedOperation], given: set[str]) -> None:
    """Assert that nothing is read that an earlier line does not say."""
    known = set(given)
    for op in operations:
        for argument in op.arguments:
            if isinstance(argument, str) and argument not in known:
                later = any(argument == other.result.name for other in operations)
                raise ProofError(f"{op.says()} reads {argument!r}, which {'comes later' if later else 'is not there'}")
        if op.result.name in known:
            raise ProofError(f"operation {op.result.name!r} is named twice")
        known.add(op.result.name)


def _check_plans(operations: Sequence[ClaimedOperation], plans: set[str]) -> None:
    """Assert that a plan is read as a plan, a table as a table, and a number as a number."""
    for op in operations:
        tables = [a for a in op.arguments if isinstance(a, str) and a.startswith(("table.", "routine."))]
        expected = {"improve": 2}.get(op.function, 1 if op.function in PLANS else 0)
        if len(tables) != expected or list(op.arguments[:expected]) != tables:
            raise ProofError(f"{op.says()}: {op.function} takes {expected} tables or routines, before all others")
        read = [k for k, a in enumerate(op.arguments) if a in plans]
        if read != ([0] if op.function in OF_A_PLAN else []):
            raise ProofError(f"{op.says()}: {', '.join(OF_A_PLAN)} read a plan first, no other operation does")


def _check_unset(claims: Claims) -> None:
    """Assert that the unset state, limited or not, is read by its test alone, and where that has failed."""
    if claims.unset is None:
        return
    name, tests = f"self.{claims.unset}", set()
    into_range = [op for op in claims.operations if op.function in ("wrap", "clamp") and op.arguments[0] == name]
    held = {name, *(op.result.name for op in into_range)}
    if any(v.name == claims.unset and v.low is not None and v.low <= LEAST for v in claims.state):
        raise ProofError(f"{name} may hold {LEAST} by itself, which says that it is not set")
    for op in claims.operations:
        arguments = list(op.arguments)
        if op.function == "eq" and arguments == [name, LEAST]:
            tests.add(op.result.name)
            continue
        if op.result.name in held:
            continue
        chosen = op.function == "select" and arguments[0] in tests and not held.intersection(map(str, arguments[:2]))
        if held.intersection(map(str, arguments)) and not chosen:
            raise ProofError(f"{op.result.name} reads {name}, which may not be set yet")
    if held.intersection((*claims.following.values(), *claims.results, *(source for *_, source in claims.status))):
        raise ProofError(f"{name} is stored as it is, but may not be set yet")


def _held(row: Mapping[str, Any], group: str, fixed: bool) -> Held:
    name = _name(row, group)
    what = f"{group} {name}"
    kind, bits, fraction = _text(row, "kind", what), _integer(row, "bits", what), _integer(row, "fraction", what)
    if kind not in ("fixed", "float") or (fixed and kind == "float"):
        raise ProofError(f"{what}: kind {kind!r} does not belong to this arithmetic")
    low, high = (row[key] if key in row else _missing(key, what) for key in ("low", "high"))
    if kind == "fixed":
        words = WORDS[group]
        if bits not in words:
            raise ProofError(f"{what} has {bits} bits; known: {', '.join(map(str, words))}")
        if group == "operations" and _integer(row, "word", what) != bits:
            raise ProofError(f"{what} has {bits} bits and a word of {row['word']}")
        low, high = _integer(row, "low", what), _integer(row, "high", what)
        half = 1 << (bits - 1)
        if not -half <= low <= high < half:
            raise ProofError(f"{what}: the claimed range {low} to {high} does not fit a word of {bits} bits")
    else:
        low, high = (None if end is None else _number(row, key, what) for key, end in (("low", low), ("high", high)))
        if bits not in (32, 64) or (low is not None and high is not None and low > high):
            raise ProofError(f"{what}: {bits} bits, {low} to {high} is no range of a floating-point number")
    return Held(name, kind, bits, fraction, low, high)


def _start(row: Mapping[str, Any], fixed: bool) -> Number | None:
    what = f"the start of state {row.get('name')}"
    if not fixed and "start" in row and row["start"] is None:
        return None
    return _integer(row, "start", what) if fixed else _number(row, "start", what)


def _parameter(row: Mapping[str, Any], fixed: bool) -> tuple[str, Number, Number, Number]:
    name = _name(row, "parameters")
    read = _integer if fixed else _number
    low, high, start = (read(row, key, f"parameter {name}") for key in ("low", "high", "start"))
    return name, low, high, start


def _operation(row: Mapping[str, Any], fixed: bool) -> ClaimedOperation:
    result = _held(row, "operations", fixed)
    if row.get("product_word") not in (None, 64):
        raise ProofError(f"{result.name}: a product of {str(row['product_word'])[:40]} bits is claimed; all have 64")
    return ClaimedOperation(result, _text(row, "function", result.name), _arguments(row, result.name, fixed))


def _arguments(row: Mapping[str, Any], name: str, fixed: bool) -> tuple[Argument, ...]:
    found = row.get("arguments")
    if not isinstance(found, list) or not found:
        raise ProofError(f"{name}: 'arguments' is no list of values")
    for argument in found:
        whole = _is_whole(argument) and -LARGEST <= argument < LARGEST
        if not (isinstance(argument, str) or whole or (not fixed and isinstance(argument, float))):
            raise ProofError(f"{name}: argument {str(argument)[:40]} is no name and no number of this arithmetic")
    return tuple(found)


def _any_state(whole: Mapping[str, Any]) -> dict[str, tuple[int, int]]:
    found = {}
    for row in _rows(whole, "any_state"):
        name = _name(row, "any_state")
        low, high = (_integer(row, key, f"any_state {name}") for key in ("low", "high"))
        if low > high:
            raise ProofError(f"any_state {name}: {low} to {high} is no range")
        found[name] = low, high
    return found


def _routine(row: Mapping[str, Any], fixed: bool) -> Routine:
    name = _name(row, "routines")
    for key in ("inputs", "results"):
        if not isinstance(row.get(key), list) or not all(isinstance(x, str) for x in row[key]):
            raise ProofError(f"routine {name}: {key!r} is no list of names")
    operations = tuple(_operation(inner, fixed) for inner in _rows(row, "operations"))
    return Routine(name, tuple(row["inputs"]), operations, tuple(row["results"]))


def _table(row: Mapping[str, Any]) -> Mapping[str, Any]:
    name = _name(row, "tables")
    for key, form in (("form", NAME), ("support", SUPPORT)):
        if not form.fullmatch(_text(row, key, f"table {name}")):
            raise ProofError(f"table {name}: {key} {row[key][:40]!r} is none of the generated C")
    for key in ("sizes", "numbers"):
        if not isinstance(row.get(key), dict):
            raise ProofError(f"table {name}: {key!r} is missing or no table")
    for key in row["sizes"]:
        _integer(row["sizes"], key, f"table {name}")
    for key, values in row["numbers"].items():
        for value in values if isinstance(values, list) else [values]:
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise ProofError(f"table {name}: {key} holds {str(value)[:40]}, which is no number")
    return row


def _rows(document: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    rows = document.get(key)
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ProofError(f"proof.json: {key!r} is missing or no list of claims")
    return rows


def _name(row: Mapping[str, Any], what: str) -> str:
    name = _text(row, "name", what)
    if not NAME.fullmatch(name):
        raise ProofError(f"{what}: {name[:40]!r} is no name in C")
    return name


def _text(row: Mapping[str, Any], key: str, what: str) -> str:
    if not isinstance(row.get(key), str):
        raise ProofError(f"{what}: {key!r} is missing or no text")
    return str(row[key])


def _integer(row: Mapping[str, Any], key: str, what: str) -> int:
    value = row.get(key)
    if not _is_whole(value) or not -LARGEST <= value < LARGEST:  # type: ignore[operator]
        raise ProofError(f"{what}: {key!r} is {str(value)[:40]}, not a whole number of at most 64 bits")
    return int(value)  # type: ignore[arg-type]


def _number(row: Mapping[str, Any], key: str, what: str) -> float:
    value = row.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ProofError(f"{what}: {key!r} is missing or no number")
    return value


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _missing(key: str, what: str) -> Any:
    raise ProofError(f"{what}: {key!r} is missing")
