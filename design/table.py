"""Read a controller table key by key, with errors that say what would be right."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping

from design.law import DesignError

NEAR = 0.5  # half of the letters agree: enough to find kp behind Kp or kq


def check_keys(table: Mapping[str, object], known: Iterable[str], owner: str) -> None:
    """Refuse a key that `owner` does not know; the nearest known one is suggested."""
    keys = sorted(set(known))
    for key in table:
        if key not in keys:
            near = difflib.get_close_matches(key.lower(), keys, n=1, cutoff=NEAR)
            hint = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(keys)}"
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
