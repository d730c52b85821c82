"""Ask Bitwuzla whether two terms are equal for all values that their variables can have, within a time."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from firmloop.verify.proofs.machine.cases import WITHIN, condition_in, narrowed, where
from firmloop.verify.proofs.machine.normal import is_sum
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm, evaluated, reached

EQUAL, APART, OPEN = "equal", "apart", "open"
QUICK = 0.3  # s for a question that is not split
CASES = 96  # that a question is split into
Ranges = Mapping[str, tuple[int, int]]  # of variables, signed, both ends included


def largest(term: BitTerm) -> int:
    """Return a number that a word is never above, without its sign."""
    all_bits = (1 << term.width) - 1
    if term.op == "const":
        return int(term.data)
    if term.op == "zext":
        return largest(term.args[0])
    if term.op == "lshr" and term.args[1].value is not None:
        return all_bits >> min(term.args[1].value, term.width)
    return all_bits


class Solver:
    """One time limit for everything that is asked."""

    def __init__(self, pool: Pool, ranges: Ranges, deadline: float) -> None:
        import bitwuzla

        self._api, self._pool, self._ranges, self._deadline = bitwuzla, pool, ranges, deadline
        self._terms = bitwuzla.TermManager()
        self._translated: dict[tuple[bool, int], Any] = {}
        self.assumed: list[BitTerm] = []  # bits that are set wherever a question is asked
        self.definitions: dict[str, BitTerm] = {}  # what variables stand for, which is told where it is needed

    def compare(self, a: BitTerm, b: BitTerm, longest: float) -> tuple[str, dict[str, int]]:
        """Return whether both are equal, and values of variables for which they are not.

        Products are taken as any value at first: what is equal then is equal. So are variables that stand for
        something; where a difference found is none of that, it is asked again with what they stand for. What stays open
        is split by its conditions, and asked in each case.
        """
        until = time.monotonic() + longest
        if a is b or self._asked(a, b, True, min(until, time.monotonic() + QUICK))[0] == EQUAL:
            return EQUAL, {}
        for sums in (True, False):
            one, other = self._spelled_out([a, b], sums)
            if self._same(one, other, until, [CASES]):
                return EQUAL, {}
        one, other = self._spelled_out([a, b], True)
        return self._by_cases(one, other, until, [CASES]) or self._case(one, other, until)

    def _same(self, a: BitTerm, b: BitTerm, until: float, left: list[int]) -> bool:
        """Tell whether both are one term in every case."""
        condition = None if a is b else condition_in([a, b])
        left[0] -= condition is not None
        if condition is None or left[0] < 0 or time.monotonic() > until:
            return a is b
        cases = (where(self._pool, [a, b], condition, holds) for holds in (True, False))
        return all(self._same(one, other, until, left) for one, other in cases)

    def _spelled_out(self, terms: Sequence[BitTerm], sums: bool) -> list[BitTerm]:
        """Return terms with choices, and sums too, in the place of variables that stand for them."""
        made: dict[BitTerm, BitTerm] = {}
        for term in reached(terms):
            meant = self.definitions.get(str(term.data).partition(WITHIN)[0]) if term.op == "var" else None
            if meant is not None and (meant.op == "ite" or (sums and is_sum(meant))):
                made[term] = self._spelled_out([meant], sums)[0]
            else:
                made[term] = self._pool.rebuilt(term, [made[arg] for arg in term.args])
        return [made[term] for term in terms]

    def _by_cases(self, a: BitTerm, b: BitTerm, until: float, left: list[int]) -> tuple[str, dict[str, int]] | None:
        """Return what is found in each case; None where there is no condition, or where there are too many cases."""
        condition = condition_in([a, b])
        if condition is None:
            return None
        for holds in (True, False):
            left[0] -= 1
            one, other = where(self._pool, [a, b], condition, holds)
            if one is other:
                continue
            if not left[0] or time.monotonic() > until:
                return OPEN, {}
            kept = self.assumed
            self.assumed = [*kept, condition if holds else self._pool.make("not", condition)]
            if (narrower := narrowed(self._pool, condition, holds)) is not None:
                self.assumed.append(self._pool.kept("eq", condition.args[0], narrower))
            found = self._by_cases(one, other, until, left) or self._case(one, other, until)
            self.assumed = kept
            if found[0] != EQUAL:
                return found
        return EQUAL, {}

    def _case(self, a: BitTerm, b: BitTerm, until: float) -> tuple[str, dict[str, int]]:
        found = self._asked(a, b, True, until)
        return found if found[0] == EQUAL else self._asked(a, b, False, until)

    def _asked(self, a: BitTerm, b: BitTerm, loose: bool, until: float) -> tuple[str, dict[str, int]]:
        """Ask, and again with definitions that the values found do not keep."""
        told: dict[str, BitTerm] = {}
        said, values = self._ask(a, b, loose, until, told)
        while said == APART and (more := self._not_meant(values, told)):
            told |= more
            said, values = self._ask(a, b, loose, until, told)
        return said, {name.partition(WITHIN)[0]: value for name, value in values.items()}

    def _not_meant(self, values: Mapping[str, int], told: Mapping[str, BitTerm]) -> dict[str, BitTerm]:
        """Return the definitions that values do not keep, and that have not been told."""
        meant = {name: self.definitions.get(name.partition(WITHIN)[0]) for name in values if name not in told}
        left = {name: term for name, term in meant.items() if term is not None}
        samples = {name: np.array([value], np.uint64) for name, value in values.items()}
        found = evaluated(reached(left.values()), samples)
        return {name: term for name, term in left.items() if int(found[term][0]) != values[name]}

    def _ask(
        self, a: BitTerm, b: BitTerm, loose: bool, until: float, told: Mapping[str, BitTerm]
    ) -> tuple[str, dict[str, int]]:
        api, left = self._api, min(until, self._deadline) - time.monotonic()
        if left <= 0:
            return OPEN, {}
        options = api.Options()
        options.set(api.Option.TIME_LIMIT_PER, int(1000 * left) + 1)
        options.set(api.Option.PRODUCE_MODELS, True)
        solver = api.Bitwuzla(self._terms, options)
        meant = [self._pool.make("eq", self._pool.var(name, term.width), term) for name, term in told.items()]
        assumed = [*self.assumed, *meant]
        order = reached([a, b, *assumed])
        for term in order:
            self._translate(term, loose)
            if loose and term.op == "mul":
                solver.assert_formula(self._product_bound(term))
            if term.op == "var" and self._range(term) is not None:
                for bound in self._bounds(term):
                    solver.assert_formula(bound)
        one, other = (self._translated[loose, term.number] for term in (a, b))
        solver.assert_formula(self._terms.mk_term(api.Kind.DISTINCT, [one, other]))
        for term in assumed:
            holds = [self._translated[loose, term.number], self._constant(1, 1)]
            solver.assert_formula(self._terms.mk_term(api.Kind.EQUAL, holds))
        said = solver.check_sat()
        if said == api.Result.UNSAT:
            return EQUAL, {}
        if said != api.Result.SAT:
            return OPEN, {}
        found = [term for term in order if term.op == "var"]
        values = {str(t.data): int(solver.get_value(self._translated[loose, t.number]).value(10)) for t in found}
        return APART, values

    def _range(self, term: BitTerm) -> tuple[int, int] | None:
        return self._ranges.get(str(term.data)) or self._pool.ranges.get(str(term.data))

    def _bounds(self, term: BitTerm) -> list[Any]:
        low, high = self._range(term) or (0, 0)
        word = self._translated[False, term.number] if (False, term.number) in self._translated else None
        word = word if word is not None else self._translated[True, term.number]
        least, most = (self._constant(end, term.width) for end in (low, high))
        kind = self._api.Kind.BV_SLE
        return [self._terms.mk_term(kind, [least, word]), self._terms.mk_term(kind, [word, most])]

    def _product_bound(self, term: BitTerm) -> Any:
        """Return that a product of short words is no larger than the product of the largest."""
        most = min((1 << term.width) - 1, largest(term.args[0]) * largest(term.args[1]))
        word = self._translated[True, term.number]
        return self._terms.mk_term(self._api.Kind.BV_ULE, [word, self._constant(most, term.width)])

    def _constant(self, value: int, width: int) -> Any:
        return self._terms.mk_bv_value(self._terms.mk_bv_sort(width), value & ((1 << width) - 1))

    def _translate(self, term: BitTerm, loose: bool) -> None:
        key = loose, term.number
        if key in self._translated:
            return
        api, make = self._api, self._terms.mk_term
        if term.op == "var":
            # One variable for both ways of asking.
            self._translated[key] = self._translated.get((not loose, term.number)) or self._terms.mk_const(
                self._terms.mk_bv_sort(term.width), str(term.data)
            )
            return
        if term.op == "const":
            self._translated[key] = self._constant(int(term.data), term.width)
            return
        if term.op == "mul" and loose:
            self._translated[key] = self._terms.mk_const(self._terms.mk_bv_sort(term.width), f"product{term.number}")
            return
        args = [self._translated[loose, arg.number] for arg in term.args]
        kinds, one_bit = api.Kind, self._constant(1, 1)
        match term.op:
            case "eq":
                made = make(kinds.BV_COMP, args)
            case "ult" | "slt":
                kind = kinds.BV_ULT if term.op == "ult" else kinds.BV_SLT
                made = make(kinds.ITE, [make(kind, args), one_bit, self._constant(0, 1)])
            case "ite":
                made = make(kinds.ITE, [make(kinds.EQUAL, [args[0], one_bit]), *args[1:]])
            case "extract":
                low = int(term.data)
                made = make(kinds.BV_EXTRACT, args, [low + term.width - 1, low])
            case "zext" | "sext":
                kind = kinds.BV_ZERO_EXTEND if term.op == "zext" else kinds.BV_SIGN_EXTEND
                made = make(kind, args, [term.width - term.args[0].width])
            case _:
                kind = {
                    "add": kinds.BV_ADD,
                    "sub": kinds.BV_SUB,
                    "mul": kinds.BV_MUL,
                    "and": kinds.BV_AND,
                    "or": kinds.BV_OR,
                    "xor": kinds.BV_XOR,
                    "not": kinds.BV_NOT,
                    "shl": kinds.BV_SHL,
                    "lshr": kinds.BV_SHR,
                    "ashr": kinds.BV_ASHR,
                    "concat": kinds.BV_CONCAT,
                }[term.op]
                made = make(kind, args)
        self._translated[key] = made
