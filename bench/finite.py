"""Tell where it is only asked of a float whether it is finite, as of a sum of all that a step leaves behind.

Such a sum is finite where all its terms are, if what they can be at most, added up, is no overflow; a term that is
infinite or no number makes it so whatever the others are. This holds for any inputs, not only those within a range.
"""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass

import numpy as np

from quantize.program import Program
from verify.reference import working_type

SUMS = ("add", "sub", "neg", "copy")


@dataclass(frozen=True, slots=True)
class Reach:
    """The largest magnitude a value has where it is finite, and whether it always is."""

    most: float
    finite: bool


def only_asked_whether_finite(program: Program, name: str, after: str) -> bool:
    """Tell whether the expression `after` may stand for the value `name`: no more is asked of it than to be finite."""
    largest = float(np.finfo(working_type(program)).max)
    reaches = _reaches(program, largest)
    new = _of_text(after, reaches)
    if new is None or not new.finite or not reaches[name].finite:
        return False
    reaches[name] = Reach(max(new.most, reaches[name].most), True)
    sums, asked = {name}, False
    shown = {end.source for end in (*program.results, *program.next_state, *program.status)}
    for op in program.body:
        if not sums & set(op.arguments):
            continue
        if op.function in SUMS:
            terms = [_of(a, reaches) for a in op.arguments]
            reaches[op.result.name] = Reach(sum(term.most for term in terms), all(term.finite for term in terms))
            sums.add(op.result.name)
        elif op.function != "lost":
            return False
        else:
            asked = True
    return asked and not sums & shown and all(reaches[s].most < largest for s in sums)


def _reaches(program: Program, largest: float) -> dict[str, Reach]:
    """Return what inputs, state and every operation reach; of those not known here, that they may be anything."""
    anything = Reach(largest, False)
    found = {f"in.{v.name}": anything for v in program.inputs} | {f"self.{v.name}": anything for v in program.state}
    for op in program.body:
        terms, numbers = [_of(a, found) for a in op.arguments], [a for a in op.arguments if not isinstance(a, str)]
        finite, most = all(term.finite for term in terms), [term.most for term in terms]
        match op.function:
            case "clamp" | "beyond" if len(numbers) == 2:
                found[op.result.name] = Reach(max(most[1:]), True)  # of what is no number too: that gives the lower
            case "add" | "sub" | "neg" | "copy":
                found[op.result.name] = Reach(sum(most), finite and sum(most) < largest)
            case "mul":
                found[op.result.name] = Reach(math.prod(most), finite and math.prod(most) < largest)
            case "select":
                found[op.result.name] = Reach(max(most[1:]), terms[1].finite and terms[2].finite)
            case _:
                found[op.result.name] = anything
    return found


def _of(value: str | int | float, reaches: dict[str, Reach]) -> Reach:
    return reaches[value] if isinstance(value, str) else Reach(abs(float(value)), True)


def _of_text(text: str, reaches: dict[str, Reach]) -> Reach | None:
    """Return what a sum, difference or product of names and numbers reaches; None of any other text."""

    def reach(node: ast.expr) -> Reach | None:
        match node:
            case ast.Constant(value=int() | float() as number):
                return Reach(abs(number), True)
            case ast.Name(id=name):
                return reaches.get(name.replace("_dot_", "."))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return reach(operand)
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() as sign, left=left, right=right):
                one, other = reach(left), reach(right)
                if one is None or other is None:
                    return None
                most = one.most * other.most if isinstance(sign, ast.Mult) else one.most + other.most
                return Reach(most, one.finite and other.finite)
        return None

    plain = text.replace("->", "_dot_").replace("F", "")
    try:
        return reach(ast.parse(plain.strip(), mode="eval").body)
    except SyntaxError:
        return None
