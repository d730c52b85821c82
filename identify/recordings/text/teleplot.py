"""Read lines such as >speed:1200:3.5§rad/s, a value a line, as Teleplot does and `firmloop scope` prints them.

>name:value, >name:ms:value, several pairs ms:value with ; between them, then § and the unit, | and flags of the plot.
Lines that do not begin with > are a program's own words.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.table import Misread, RawTable
from firmloop.identify.recordings.text.cells import is_number

_LINE = re.compile(r">\s*([^:§|]+?)\s*:([^§|]+)(?:§([^|]*))?(?:\|(\w*))?\s*$")
_LOOKED, _FEWEST = 200, 3  # lines that say whether a text is of this kind; and how many of them have to be of it
_LOST = 0.02  # of the samples: so many may lack a value, as the first and the last do
_ONE_STAMP = "send all values of a sample with one stamp"

Point = tuple[int, str, float, float | None]  # line, name, value, and stamp in ms


def read_teleplot(lines: Sequence[str]) -> RawTable | Misread | None:
    """Return a row for each stamp, or for each round of names where there are none; None for another kind of text."""
    said = [*islice(filter(str.strip, lines), _LOOKED)]
    known = sum(bool(_LINE.match(line)) for line in said)
    if known < min(_FEWEST, len(said)) or 4 * known < len(said):
        return None
    found = [(k + 1, match) for k, line in enumerate(lines) if (match := _LINE.match(line.strip()))]
    words = {match[1]: "holds text" for _, match in found if match[4] == "t" or not is_number(_last(match[2]))}
    points = list(_points(found, words))
    names = tuple(dict.fromkeys(name for _, name, _, _ in points))
    if not names:
        return Misread("", "is Teleplot text without numbers", "send each value as >name:milliseconds:value")
    units = {match[1]: match[3].strip() for _, match in found if match[3]}
    aside = sum(bool(line.strip()) for line in lines) - len(found)
    told = ["is Teleplot text, a value a line"]
    if aside:
        told.append(f"has {aside} line{'s' if aside > 1 else ''} that do not begin with >, left aside")
    if words:
        told.append(f"has values without numbers, left aside: {', '.join(words)}")
    stamped = {stamp is not None for *_, stamp in points}
    if len(stamped) > 1:
        line = next(line for line, *_, stamp in points if (stamp is None) == (points[0][3] is not None))
        return Misread(f"line {line}", "has a stamp, or has none, unlike the lines before", _ONE_STAMP)
    samples = _by_stamp(points) if stamped == {True} else _by_round(points)
    whole = [each for each in samples if len(each[2]) == len(names)]
    if len(samples) - len(whole) > max(2, _LOST * len(samples)):
        where, stamp, held = next(each for each in samples[1:] if len(each[2]) < len(names))
        lacks = next(name for name in names if name not in held)
        at = "" if stamp is None else f" at {stamp:g} ms"
        wrong = f"has no {lacks}{at}: {len(samples) - len(whole)} of {len(samples)} samples lack a value"
        return Misread(f"line {where}", wrong, _ONE_STAMP)
    if len(whole) < len(samples):
        told.append(f"has {len(samples) - len(whole)} samples that lack a value, left aside")
    columns = [np.array([held[name] for *_, held in whole]) for name in names]
    of_names = tuple(units.get(name, "") for name in names)
    places = np.array([where for where, *_ in whole], dtype=np.int64)
    if stamped == {True}:
        time: NDArray[np.float64] = np.array([stamp for _, stamp, _ in whole], dtype=np.float64) / 1000.0
        names, columns, of_names = ("time_s", *names), [time, *columns], ("", *of_names)
        told[0] += "; its stamps in ms are taken for time_s"
    return RawTable(names, tuple(columns), "line", places, of_names if units else (), tuple(told), words)


def _last(values: str) -> str:
    return values.rpartition(";")[2].rpartition(":")[2].strip()


def _points(found: list[tuple[int, re.Match[str]]], words: dict[str, str]) -> Iterator[Point]:
    for line, match in found:
        for pair in match[2].split(";") if match[1] not in words and match[4] != "xy" else ():
            stamp, colon, value = pair.rpartition(":")
            if is_number(value) and (not colon or is_number(stamp)):
                yield line, match[1], float(value), float(stamp) if colon else None


def _by_stamp(points: list[Point]) -> list[tuple[int, float | None, dict[str, float]]]:
    """Put what has the same stamp into one sample, in the order of their first lines."""
    samples: dict[float | None, tuple[int, float | None, dict[str, float]]] = {}
    for line, name, value, stamp in points:
        samples.setdefault(stamp, (line, stamp, {}))[2][name] = value
    return list(samples.values())


def _by_round(points: list[Point]) -> list[tuple[int, float | None, dict[str, float]]]:
    """Begin another sample where a name comes again."""
    samples: list[tuple[int, float | None, dict[str, float]]] = []
    for line, name, value, _ in points:
        if not samples or name in samples[-1][2]:
            samples.append((line, None, {}))
        samples[-1][2][name] = value
    return samples
