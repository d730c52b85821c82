"""Read a controller table key by key, with errors that say what would be right."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]

SET_WHILE_RUNNING = ("tunable", "ranges")
SET_BY_A_PID = "what is set on the running target is a value of a pid, alone or as a loop of a cascade; remove it here"
NEAR = 0.5  # half of the letters agree: enough to find kp behind Kp or kq


def check_keys(table: Mapping[str, object], known: Iterable[str], owner: str) -> None:
    """Refuse a key that `owner` does not know; the nearest known one is suggested."""
    keys = sorted(set(known))
    for key in table:
        if key not in keys:
            near = difflib.get_close_matches(key.lower(), keys, n=1, cutoff=NEAR)
            hint = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(keys)}"
            hint = SET_BY_A_PID if key in SET_WHILE_RUNNING else hint
            raise DesignError(f"controller.{key} = {table[key]!r}: {owner} has no such key; {hint}")


def real(
    table: Mapping[str, object], key: str, default: float | None, low: float = -math.inf, high: float = math.inf
) -> float:
    """Read `key` as a finite float within [low, high]; `default` where it is absent, an error where that is None."""
    if key not in table:
        if default is None:
            raise DesignError(f"controller.{key} is missing; give it as a number")
        return float(default)
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DesignError(f"controller.{key} = {value!r} is not a number; write it like {key} = 0.5")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DesignError(f"controller.{key} = {value!r} is not finite; give a number")
    if not low <= number <= high:
        rule = f"at least {low:g}" if high == math.inf else f"from {low:g} to {high:g}"
        raise DesignError(f"controller.{key} = {value!r} is out of range; it must be {rule}")
    return number


def truth(table: Mapping[str, object], key: str, default: bool) -> bool:
    """Read `key` as true or false; `default` where it is absent."""
    value = table.get(key, default)
    if not isinstance(value, bool):
        raise DesignError(f"controller.{key} = {value!r} is not a truth value; write true or false")
    return value


def positive(table: Mapping[str, object], key: str, default: float | None) -> float:
    """Read `key` as a finite float above zero."""
    number = real(table, key, default)
    if number <= 0:
        raise DesignError(f"controller.{key} = {number:g} is out of range; it must be above 0")
    return number


def choice(table: Mapping[str, object], key: str, default: str | None, known: Iterable[str]) -> str:
    """Read `key` as one of the words `known`; an error names the nearest."""
    words = sorted(known)
    if key not in table:
        if default is None:
            raise DesignError(f"controller.{key} is missing; known: {', '.join(words)}")
        return default
    value = table[key]
    if not isinstance(value, str):
        raise DesignError(f"controller.{key} = {value!r} is not a text; known: {', '.join(words)}")
    if value not in words:
        near = difflib.get_close_matches(value.lower(), words, n=1, cutoff=NEAR)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise DesignError(f"controller.{key} = '{value}' is unknown; {hint}known: {', '.join(words)}")
    return value


def numbers(table: Mapping[str, object], key: str, default: Sequence[float] | None) -> tuple[float, ...]:
    """Read `key` as a list of finite numbers, at least one."""
    if key not in table and default is not None:
        return tuple(default)
    if key not in table:
        raise DesignError(f"controller.{key} is missing; give it as a list of numbers, such as {key} = [1.0, 0.5]")
    value = table[key]
    if not isinstance(value, list | tuple):
        raise DesignError(f"controller.{key} = {value!r} is not a list of numbers; write it like {key} = [1.0, 0.5]")
    if not value:
        raise DesignError(f"controller.{key} is an empty list of numbers; give at least one")
    return tuple(real({key: entry}, key, None) for entry in value)


def matrix(table: Mapping[str, object], key: str, rows: int | None, columns: int | None, why: str) -> Array:
    """Read `key` as nested lists, row by row; `rows` or `columns` None is any number, `why` says what they follow."""
    if key not in table:
        raise DesignError(f"controller.{key} is missing; give it as rows, such as {key} = [[1.0, 0.0], [0.0, 1.0]]")
    value = table[key]
    nested = isinstance(value, list | tuple) and all(isinstance(row, list | tuple) for row in value)
    if not nested or not isinstance(value, list | tuple):
        raise DesignError(f"controller.{key} is not a list of rows; {_as_rows(key, value)}")
    if not value:
        raise DesignError(f"controller.{key} has no rows; give at least one")
    widths = {len(row) for row in value}
    if len(widths) > 1:
        raise DesignError(f"controller.{key} has rows of {sorted(widths)} numbers; give every row the same length")
    found = np.array([[real({key: entry}, key, None) for entry in row] for row in value], dtype=np.float64)
    found = found.reshape(len(value), widths.pop())
    wanted = found.shape[0] if rows is None else rows, found.shape[1] if columns is None else columns
    if found.shape != wanted:
        raise DesignError(
            f"controller.{key} is {found.shape[0]} x {found.shape[1]}, but {why} ask for {wanted[0]} x {wanted[1]}; "
            "correct one of them"
        )
    return found


def _as_rows(key: str, value: object) -> str:
    """Say how to write a matrix; where numbers stand alone, those."""
    entries = value if isinstance(value, list | tuple) else [value]
    if not all(isinstance(entry, int | float) and not isinstance(entry, bool) for entry in entries):
        return f"write it like {key} = [[1.0, 0.0], [0.0, 1.0]]"
    row, column = f"{key} = {[[*entries]]}", f"{key} = {[[entry] for entry in entries]}"
    return f"write {row}" if len(entries) == 1 else f"write {row} for one row, {column} for one column"


def limits(table: Mapping[str, object], wires: Sequence[Signal]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Read `u_min` and `u_max`, a number or one a wire; the wire's range where absent, and never beyond it."""
    low = each(table, "u_min", [wire.low for wire in wires])
    high = each(table, "u_max", [wire.high for wire in wires])
    for least, most, wire in zip(low, high, wires, strict=True):
        if not wire.low <= least < most <= wire.high:
            raise DesignError(
                f"controller.u_min = {least:g} and u_max = {most:g} of signals.{wire.name} are out of order or range; "
                f"both must be from {wire.low:g} to {wire.high:g}, u_min below u_max: correct these or the signal"
            )
    return low, high


def each(table: Mapping[str, object], key: str, default: Sequence[float]) -> tuple[float, ...]:
    """Read `key` as one number for all places of `default`, or a list with one for each; infinite is allowed."""
    if key not in table:
        return tuple(default)
    value = table[key]
    entries = list(value) if isinstance(value, list | tuple) else [value] * len(default)
    if len(entries) != len(default):
        raise DesignError(
            f"controller.{key} has {len(entries)} numbers for {len(default)} places; give one number or {len(default)}"
        )
    infinite = (math.inf, -math.inf)
    return tuple(x if isinstance(x, float) and x in infinite else real({key: x}, key, None) for x in entries)
