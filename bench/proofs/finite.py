"""Tell where it is only asked of a float whether it is finite, as of a sum of all that a step leaves behind.

Such a sum is finite where all its terms are, if what they can be at most, added up, is no overflow; a term that is
infinite or no number makes it so whatever the others are. This holds for any inputs, not only those within a range.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from firmloop.quantize.program import Program
from firmloop.verify.reference import working_type

SUMS = ("add", "sub", "neg", "copy")


@dataclass(frozen=True, slots=True)
class Reach:
    """The largest magnitude a value has where it is finite, and that it is not where one of `lost` is not."""

    most: float
    lost: frozenset[str]


def only_asked_whether_finite(program: Program, name: str, after: str) -> bool:
    """Tell whether the expression `after` may stand for the value `name`: no more is asked of it than to be finite."""
    largest = float(np.finfo(working_type(program)).max)
    reaches = _reaches(program, largest)
    old, new = reaches[name], _of_text(after, reaches)
    if new is None or new.lost != old.lost or max(new.most, old.most) >= largest:
        return False
    reaches[name] = Reach(max(new.most, old.most), old.lost)
    sums, asked = {name}, False
    shown = {end.source for end in (*program.results, *program.next_state, *program.status)}
    for op in program.body:
        if not sums & set(op.arguments):
            continue
        if op.function in SUMS:
            reaches[op.result.name] = _joined([_of(a, reaches) for a in op.arguments], sum)
            sums.add(op.result.name)
        elif op.function != "lost":
            return False
        else:
            asked = True
    return asked and not sums & shown and all(reaches[s].most < largest for s in sums)


def _reaches(program: Program, largest: float) -> dict[str, Reach]:
    """Return what inputs, state and every operation reach; of those not known here, that they may be anything."""
    found = {f"in.{v.name}": Reach(largest, frozenset({f"in.{v.name}"})) for v in program.inputs}
    for v in program.state:
        most = largest if v.name == program.unset else min(max(-v.low, v.high), largest)
        found[f"self.{v.name}"] = Reach(most, frozenset({f"self.{v.name}"}))
    for op in program.body:
        terms, name = [_of(a, found) for a in op.arguments], op.result.name
        match op.function:
            case "clamp" | "beyond" if not any(isinstance(a, str) for a in op.arguments[1:]):
                made = Reach(max(term.most for term in terms[1:]), frozenset())  # no number gives the lower limit
            case function if function in SUMS:
                made = _joined(terms, sum)
            case "mul":
                made = _joined(terms, math.prod)
            case "select" if not terms[1].lost | terms[2].lost:
                made = _joined(terms[1:], max)
            case _:
                made = Reach(largest, frozenset({name}))
        found[name] = made if made.most < largest else Reach(largest, frozenset({name}))
    return found


def _joined(terms: Sequence[Reach], most: Callable[[list[float]], float]) -> Reach:
    return Reach(most([term.most for term in terms]), frozenset().union(*(term.lost for term in terms)))


def _of(value: str | int | float, reaches: dict[str, Reach]) -> Reach:
    if isinstance(value, str):
        return reaches.get(value, Reach(math.inf, frozenset({value})))
    return Reach(abs(float(value)), frozenset())


def _of_text(text: str, reaches: dict[str, Reach]) -> Reach | None:
    """Return what a sum, difference or product of names and numbers reaches; None of any other text."""

    def reach(node: ast.expr) -> Reach | None:
        match node:
            case ast.Constant(value=int() | float() as number):
                return Reach(abs(number), frozenset())
            case ast.Name(id=name):
                return reaches.get(name.replace("_dot_", "."))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return reach(operand)
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() as sign, left=left, right=right):
                one, other = reach(left), reach(right)
                if one is None or other is None:
                    return None
                return _joined([one, other], math.prod if isinstance(sign, ast.Mult) else sum)
        return None

    plain = re.sub(r"(?<=[0-9.])F\b", "", text.replace("->", "_dot_"))
    try:
        return reach(ast.parse(plain.strip(), mode="eval").body)
    except SyntaxError:
        return None
