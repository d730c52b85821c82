"""Split a question by a condition: what two terms are where it holds, and where it does not.

Compilers double the code behind a branch and move operations into its arms. Where a condition is decided, its choices
are gone, and what is left is often the same term on both sides.
"""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.verify.proofs.machine.normal import ends_of, signed_by
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm, reached, signed_value

WITHIN = " within "  # between the name of a variable and its narrower range
LOGIC = ("and", "or", "xor", "not", "ite")


def condition_in(terms: Sequence[BitTerm]) -> BitTerm | None:
    """Return the first comparison that decides a choice in these terms; None where there is no choice."""
    deciding = [term.args[0] for term in reached(terms) if term.op == "ite"]
    found: dict[int, BitTerm] = {}
    seen: set[BitTerm] = set()
    while deciding:
        bit = deciding.pop()
        if bit in seen:
            continue
        seen.add(bit)
        if bit.op in LOGIC:
            deciding.extend(arg for arg in bit.args if arg.width == 1)
        elif bit.op != "const":
            found[bit.number] = bit
    return found[min(found)] if found else None


def where(pool: Pool, terms: Sequence[BitTerm], condition: BitTerm, holds: bool) -> list[BitTerm]:
    """Return the terms as they are where a condition holds, or where it does not."""
    made: dict[BitTerm, BitTerm] = {}
    narrower = narrowed(pool, condition, holds)
    of_sign = condition.op == "slt" and condition.args[1].value == 0
    for term in reached(terms):
        if narrower is not None and term is condition.args[0]:
            made[term] = narrower
            continue
        if condition.op == "eq" and holds and term is condition.args[0]:
            made[term] = condition.args[1]
            continue
        if of_sign and signed_by(pool, term) is condition.args[0]:
            made[term] = pool.const(-int(holds), term.width)
            continue
        decided = _implied(condition, holds, term)
        if decided is None:
            made[term] = pool.rebuilt(term, [made[arg] for arg in term.args])
        else:
            made[term] = pool.const(decided, 1)
    return [made[term] for term in terms]


def narrowed(pool: Pool, condition: BitTerm, holds: bool) -> BitTerm | None:
    """Return a variable in its narrower range where a limit of it is decided, as another variable."""
    if condition.op != "slt" or condition.args[0].op != "var" or condition.args[1].op != "const":
        return None
    word, limit = condition.args[0], signed_value(condition.args[1])
    low, high = ends_of(pool, word)
    low, high = (low, min(high, limit - 1)) if holds else (max(low, limit), high)
    name = f"{str(word.data).partition(WITHIN)[0]}{WITHIN}{low}..{high}"
    pool.ranges[name] = low, high
    return pool.var(name, word.width)


def _implied(condition: BitTerm, holds: bool, term: BitTerm) -> bool | None:
    """Return what a bit is where the condition is decided; None where that says nothing of it."""
    if term is condition:
        return holds
    of_one = term.op in ("slt", "eq") and condition.op in ("slt", "eq") and term.args[0] is condition.args[0]
    if not of_one or term.args[1].op != "const" or condition.args[1].op != "const":
        return None
    known, asked = signed_value(condition.args[1]), signed_value(term.args[1])
    if condition.op == "eq":
        if not holds:
            return None
        return known < asked if term.op == "slt" else known == asked
    if term.op == "slt" and (asked >= known if holds else asked <= known):
        return holds
    return False if term.op == "eq" and (asked >= known) == holds else None
