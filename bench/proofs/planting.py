"""Plant one fault at a time in generated C: every one that it has a place for, or a choice of every sort.

A fault is a changed constant (one unit in the last place, one percent, sign), shift, operator, comparison, operand
order, limit, type, store or status bit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from firmloop.codegen.bundle import Bundle


@dataclass(frozen=True, slots=True)
class Mutant:
    """One planted fault: which line of the C, what it was, what it is now."""

    what: str
    line: int
    before: str
    after: str


_NUMBER = r"(?<![\w.])\d+(?:\.\d+)?(?:e[+-]?\d+)?"


def _changed_numbers(line: str) -> Iterator[tuple[str, str]]:
    code, mark, note = line.partition("/*")
    for found in re.finditer(rf"{_NUMBER}(F|U)?", code):
        text, suffix = found[0].removesuffix("F").removesuffix("U"), found[1] or ""
        if suffix == "U":
            other = [str(int(text) + 1), str(max(1, int(text) - 1))]
        elif "." in text or "e" in text or suffix == "F":
            kind = np.float32 if suffix == "F" else np.float64
            x = kind(text)
            other = [str(np.nextafter(x, kind(np.inf))), str(x * kind(1.01)), str(-x) if x else "1.0"]
        else:
            n = int(text)
            other = [str(n + 1), str(n - 1) if n else "2", str(n + max(1, n // 100))]
        for new in other:
            if new != text:
                yield (
                    f"number {text} -> {new}",
                    code[: found.start()] + new + suffix + code[found.end() :] + mark + note,
                )


_OTHER_TYPE = {"int64_t": "int32_t", "int32_t": "int16_t", "float": "int32_t", "double": "float"}
_SWAPS = (
    (" + ", " - "), (" - ", " + "), (" * ", " + "), (" < ", " <= "), (" < ", " > "), (" != ", " == "), ("0)", "1)"),
    ("fl_min", "fl_max"), ("fl_max", "fl_min"), (" | ", " & "), ("? 1 : 0", "? 0 : 1"), (" = -", " = "),
    ("in->reference", "in->measurement"), ("in->measurement", "in->reference"), ("(int16_t)", "(int8_t)"),
    ("&", "|"), (" >= ", " > "), (" <= ", " < "),
)  # fmt: skip


def mutants(bundle: Bundle) -> list[Mutant]:
    """Return every fault this module knows how to plant in the functions of a bundle, line by line."""
    lines = bundle.files[f"{bundle.name}.c"].splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"void {bundle.name}_init"))
    found: list[Mutant] = []
    for k in range(start, len(lines)):
        line = lines[k]
        if ";" not in line and "if (" not in line:
            continue
        code, mark, note = line.partition("/*")
        found += [Mutant(what, k, line, new) for what, new in _changed_numbers(line)]
        found += [
            Mutant(f"{a.strip()} -> {b.strip()}", k, line, code.replace(a, b, 1) + mark + note)
            for a, b in _SWAPS
            if a in code
        ]
        swapped = re.sub(r"= ([\w>-]+) - ([\w>-]+);", r"= \2 - \1;", code)
        if swapped != code:
            found.append(Mutant("operands swapped", k, line, swapped + mark + note))
        typed = re.sub(r"\bconst (int64_t|int32_t|double|float) ", lambda t: f"const {_OTHER_TYPE[t[1]]} ", code)
        if typed != code:
            found.append(Mutant("type", k, line, typed + mark + note))
        if "->" in code.partition("=")[0]:
            found.append(Mutant("store dropped", k, line, f"    (void){code.partition('=')[2].strip()}"))
        limited = re.sub(r"= fl_(?:clamp|min|max)_\w+\(([\w>-]+), .*\);", r"= \1;", code)
        if limited != code:
            found.append(Mutant("limit removed", k, line, limited + mark + note))
    unique = {(m.line, m.after): m for m in found if m.after != m.before}
    return list(unique.values())


def planted(bundle: Bundle, mutant: Mutant) -> Bundle:
    """Return the bundle with the fault in it."""
    name = f"{bundle.name}.c"
    lines = bundle.files[name].splitlines()
    lines[mutant.line] = mutant.after
    return replace(bundle, files={**bundle.files, name: "\n".join(lines) + "\n"})


def chosen(found: list[Mutant], count: int, seed: int | None = None) -> list[Mutant]:
    """Return `count` of them, evenly spread over the text, of every sort of fault; a seed draws others at random."""
    order = np.arange(len(found)) if seed is None else np.random.default_rng(seed).permutation(len(found))
    sorts: dict[str, list[Mutant]] = {}
    for k in order:
        sorts.setdefault(sort_of(found[k]), []).append(found[k])
    picked: list[Mutant] = []
    rank = 0
    while len(picked) < min(count, len(found)):
        for mutants_of_sort in sorts.values():
            if rank < len(mutants_of_sort) and len(picked) < count:
                # from the middle outward, so that neither the first nor the last lines weigh more
                picked.append(mutants_of_sort[(len(mutants_of_sort) // 2 + rank * 7) % len(mutants_of_sort)])
        rank += 1
    return list({(m.line, m.after): m for m in picked}.values())


def sort_of(mutant: Mutant) -> str:
    """Return the sort of a fault: a number, an operator, an order, a type, a limit, a store."""
    what = mutant.what
    if what.startswith("number"):
        new = what.rpartition(" ")[2]
        return "sign" if new.startswith("-") else "number"
    return what
