"""Compare what machine code leaves with what operations state, cut at the values of the operations.

Values are computed for samples of inputs and states. Where a word of the code has the value of an operation in all of
them, the two are proven equal for every value of what they are made of, and both go on as one new variable in the range
that is claimed for the operation. So each question has the size of a few operations, and the code may compute in
another order. What is left at the end are words that are stored.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.proofs.claims import LEAST, Claims
from firmloop.verify.proofs.machine.normal import HALF, Sum, ends_of, is_sum, plus, sum_of, with_signs, written
from firmloop.verify.proofs.machine.solver import APART, EQUAL, OPEN, Solver
from firmloop.verify.proofs.machine.stated import entries, stated, status_of
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm, Words, evaluated, reached, signed

SAMPLES = 1_024
BATCHES = 24  # of samples in which a difference is looked for
UNSET = 0.3  # of the samples begin before the first one was seen
STAGE = 4.0  # s for one question on the way
SEED = 20_260_101
CUT = "cut."  # in front of the name of a value that is a variable
STATUS = "the word of status bits"  # in the place of a value


@dataclass(frozen=True, slots=True)
class Stored:
    """A word that the code leaves, and the value that it shall be."""

    says: str
    left: BitTerm
    value: str  # of the operations, or STATUS


@dataclass(frozen=True, slots=True)
class Route:
    """One way through the code: what is true of the values that take it, and what it leaves."""

    path: tuple[BitTerm, ...]
    stored: tuple[Stored, ...]


class StepComparison:
    """The code of one step beside the operations of its proof."""

    def __init__(self, pool: Pool, claims: Claims, ways: Sequence[Route], deadline: float) -> None:
        self._pool, self._claims, self._ways = pool, claims, ways
        self._deadline = deadline
        known = entries(pool, claims)
        for op in claims.operations:
            known[op.result.name] = stated(pool, op, known.__getitem__)
        known[STATUS] = status_of(pool, claims, known.__getitem__)
        self._plain = known

    def difference(self) -> str | None:
        """Return inputs and states for which the code leaves another word, as text; None where samples show none."""
        order = reached(
            [
                *(term for way in self._ways for term in (*way.path, *(one.left for one in way.stored))),
                *self._plain.values(),
            ]
        )
        for batch in range(BATCHES):
            samples = sampled(self._claims, batch)
            values = evaluated(order, samples)
            for way in self._ways:
                taken = _taken(way, values)
                for one in way.stored:
                    apart = np.flatnonzero(taken & (values[one.left] != values[self._plain[one.value]]))
                    if len(apart):
                        return self._told_apart(one, samples, int(apart[0]), values)
            if time.monotonic() > self._deadline:
                break
        return None

    def _told_apart(self, one: Stored, samples: Mapping[str, Words], k: int, values: Mapping[BitTerm, Words]) -> str:
        given = ", ".join(
            f"{name} = {signed(samples[name][k : k + 1], bits)[0]}" for name, bits in widths_of(self._claims).items()
        )
        got, due = (signed(values[term][k : k + 1], 32)[0] for term in (one.left, self._plain[one.value]))
        return f"{one.says} is {got}, not {due}, for {given}"

    def prove(self) -> tuple[str, str]:
        """Return EQUAL, APART with words on it, or OPEN with what is not decided."""
        for way in self._ways:
            swept = Sweep(self._pool, self._claims, way, self._plain, self._deadline)
            for one in way.stored:
                said, values = swept.compare(one)
                if said == APART:
                    told = self._confirmed(way, one, values)
                    return (APART, told) if told else (OPEN, one.says)
                if said != EQUAL:
                    return OPEN, one.says
        return EQUAL, ""

    def _confirmed(self, way: Route, one: Stored, found: Mapping[str, int]) -> str | None:
        """Return the words on a difference that a solver has found, if it is one."""
        zero = np.zeros(1, np.uint64)
        samples = {
            name: np.array([found[name]], np.uint64) if name in found else zero for name in widths_of(self._claims)
        }
        values = evaluated(reached([*way.path, one.left, self._plain[one.value]]), samples)
        apart = _taken(way, values)[0] and values[one.left][0] != values[self._plain[one.value]][0]
        return self._told_apart(one, samples, 0, values) if apart else None


class Sweep:
    """One way through the code, with its cuts."""

    def __init__(self, pool: Pool, claims: Claims, way: Route, plain: Mapping[str, BitTerm], deadline: float) -> None:
        self._pool, self._claims, self._way, self._plain = pool, claims, way, plain
        self._operations = {op.result.name: op for op in claims.operations}
        self._deadline, self._ranges = deadline, ranges_of(claims)
        pool.ends.clear()  # a value may have another range on each way
        self.cut: dict[str, BitTerm] = {}  # values of operations that are variables now
        self._replaced: dict[BitTerm, BitTerm] = {}  # what stood in the place of a variable; operations may hold it too
        self._sums: dict[BitTerm, Sum] = {}  # variables that stand for sums, and these
        self._told: dict[str, BitTerm] = {}
        self._solver = Solver(pool, self._ranges, deadline)
        self._decided = {_bare(term): pool.const(int(term.op != "not"), 1) for term in way.path}
        self._rebuilt = self._cut_up()

    def compare(self, one: Stored) -> tuple[str, dict[str, int]]:
        """Compare a word that is left, by the values that are cut; then by inputs and states alone."""
        left = self._deadline - time.monotonic()
        said, values = self._solver.compare(self._rebuilt[one.left], self._value(one.value), left)
        if said == APART and any(name.startswith(CUT) for name in values):
            self._solver.assumed = list(self._way.path)
            said, values = self._solver.compare(one.left, self._plain[one.value], self._deadline - time.monotonic())
        return said, values

    def _cut_up(self) -> dict[BitTerm, BitTerm]:
        """Return each term of the code with its cuts made."""
        order = reached([*self._way.path, *(one.left for one in self._way.stored)])
        wanted = self._signatures(order)
        rebuilt: dict[BitTerm, BitTerm] = {}
        for term in order:
            if term in self._decided:
                self._solver.assumed.append(self._as_assumed(term, rebuilt))
                rebuilt[term] = self._decided[term]
                continue
            made = self._by_sums(self._pool.rebuilt(term, [rebuilt[arg] for arg in term.args]))
            name, low = self._alike(made, wanted[0].get((term.width, wanted[1][term].tobytes()), ())) or ("", 0)
            if name:
                definition = self._definition(name)
                whole, made = made, self._pool.extract(definition, low, term.width)
                if not self._stays(definition):
                    made = self._pool.extract(self._variable(name, definition), low, term.width)
                    self._replaced[whole] = made
            rebuilt[term] = made
        return rebuilt

    def _alike(self, made: BitTerm, values: Sequence[tuple[str, int]]) -> tuple[str, int] | None:
        """Return which value, from which bit on, a word is: one that is written so if there is any."""
        parts = [(name, low, self._pool.extract(self._definition(name), low, made.width)) for name, low in values]
        if any(
            name in self.cut and made is self._pool.extract(self.cut[name], low, made.width) for name, low in values
        ):
            return None
        written_so = next(((name, low) for name, low, part in parts if made is part), None)
        equal = ((name, low) for name, low, part in parts if self._equal(name, self._definition(name), made, part))
        return written_so or next(equal, None)

    def _equal(self, name: str, definition: BitTerm, made: BitTerm, part: BitTerm) -> bool:
        """Tell whether a word is this part of a value; of a value whose other half is cut, that half may be in it."""
        told = [self._pool.make("eq", self.cut[name], definition)] if name in self.cut else []
        kept = self._solver.assumed
        self._solver.assumed = [*kept, *told]
        same = self._solver.compare(made, part, STAGE)[0] == EQUAL
        self._solver.assumed = kept
        return same

    def _as_assumed(self, term: BitTerm, rebuilt: Mapping[BitTerm, BitTerm]) -> BitTerm:
        made = self._pool.rebuilt(term, [rebuilt[arg] for arg in term.args])
        return made if self._decided[term].value else self._pool.make("not", made)

    def _signatures(
        self, order: Sequence[BitTerm]
    ) -> tuple[dict[tuple[int, bytes], list[tuple[str, int]]], dict[BitTerm, Words]]:
        """Return which values of operations, or halves of them, have which samples; and all samples."""
        plain = {name: self._plain[name] for name in self._operations}
        together = reached([*order, *plain.values()])
        values = evaluated(together, sampled(self._claims, 0))
        rows = np.flatnonzero(_taken(self._way, values))
        values = {term: words[rows] for term, words in values.items()}
        wanted: dict[tuple[int, bytes], list[tuple[str, int]]] = {}
        for name, term in plain.items():
            if term.op in ("const", "var") or len(np.unique(values[term])) < 3:
                continue  # truth values and constants
            halves = [(0, 32), (32, 32)] if term.width == 64 else []
            for low, width in [(0, term.width), *halves]:
                part = (values[term] >> np.uint64(low)) & np.uint64((1 << width) - 1)
                wanted.setdefault((width, part.tobytes()), []).append((name, low))
        return wanted, values

    def _value(self, name: str) -> BitTerm:
        """Return a value of the operations, of the variables that stand for others."""
        if name == STATUS:
            return status_of(self._pool, self._claims, self._value)
        return self.cut[name] if name in self.cut else self._definition(name)

    def _definition(self, name: str) -> BitTerm:
        if name not in self._told:
            inner = self._operations.get(name)
            told = stated(self._pool, inner, self._value) if inner is not None else self._plain[name]
            self._told[name] = self._here(told)
        return self._told[name]

    def _here(self, term: BitTerm) -> BitTerm:
        """Return a term as it is on this way."""
        made: dict[BitTerm, BitTerm] = {}
        for one in reached([term]):
            as_is = self._decided.get(one) or self._pool.rebuilt(one, [made[arg] for arg in one.args])
            made[one] = self._by_sums(self._replaced.get(as_is, as_is))
        return made[term]

    @staticmethod
    def _stays(definition: BitTerm) -> bool:
        """Tell whether a value is not cut: a long sum, which is compared as one, and one of words that come in."""
        atoms = sum_of(definition)[0] if is_sum(definition) else {}
        return bool(atoms) and (definition.width > HALF or all(_comes_in(atom) for atom in atoms))

    def _by_sums(self, term: BitTerm) -> BitTerm:
        """Return a sum by the values that are part of it."""
        if not is_sum(term) or term.width != HALF:
            return term
        for value, (parts, constant) in self._sums.items():
            total = with_signs(term)
            counts = {total[0].get(part, 0) * count for part, count in parts.items()}
            times = total[0].get(next(iter(parts)), 0) * next(iter(parts.values()))
            if abs(times) == 1 and counts == {times}:
                term = written(self._pool, plus(plus(total, (parts, constant), -times), ({value: 1}, 0), times), HALF)
        return term

    def _variable(self, name: str, definition: BitTerm) -> BitTerm:
        if name not in self.cut:
            self._told = {}  # what is made of it may be told by it now
            held = self._operations[name].result
            low, high = ends_of(self._pool, definition)
            kept = max(low, int(held.low or 0)), min(high, int(held.high or 0))
            self._ranges[CUT + name] = self._pool.ranges[CUT + name] = kept
            self.cut[name] = self._pool.var(CUT + name, definition.width)
            self._solver.definitions[CUT + name] = definition
            parts = with_signs(definition)
            if is_sum(definition) and len(parts[0]) > 1 and all(abs(count) == 1 for count in parts[0].values()):
                self._sums[self.cut[name]] = parts
        return self.cut[name]


def _comes_in(term: BitTerm) -> bool:
    return term.op == "var" or (term.op == "sext" and term.args[0].op == "var")


def _bare(term: BitTerm) -> BitTerm:
    return term.args[0] if term.op == "not" else term


def _taken(way: Route, values: Mapping[BitTerm, Words]) -> NDArray[np.bool_]:
    """Return for which samples the code goes this way."""
    count = len(next(iter(values.values())))
    taken = np.ones(count, bool)
    for term in way.path:
        taken &= values[term] != 0
    return taken


def widths_of(claims: Claims) -> dict[str, int]:
    """Return the bits of every input and state."""
    return {f"in.{v.name}": v.bits for v in claims.inputs} | {f"self.{v.name}": v.bits for v in claims.state}


def ranges_of(claims: Claims) -> dict[str, tuple[int, int]]:
    """Return the range of every input, which is that of its word, and of every state before the step."""
    found = {f"in.{v.name}": (-(1 << (v.bits - 1)), (1 << (v.bits - 1)) - 1) for v in claims.inputs}
    return found | {f"self.{v.name}": _before(claims, v.name, v.low, v.high) for v in claims.state}


def _before(claims: Claims, name: str, low: float | None, high: float | None) -> tuple[int, int]:
    """Return the range of a state; the one that is unset at first may hold anything."""
    return (-(1 << 31), (1 << 31) - 1) if name == claims.unset else (int(low or 0), int(high or 0))


def sampled(claims: Claims, batch: int) -> dict[str, Words]:
    """Return values of inputs and states: spread over their ranges, small, and at the ends."""
    dice = np.random.default_rng((SEED, batch))
    found = {}
    bits = widths_of(claims)
    for name, (low, high) in ranges_of(claims).items():
        spread = dice.integers(low, high, SAMPLES, endpoint=True)
        scale = 2.0 ** dice.uniform(0, 31, SAMPLES)
        small = np.clip((dice.normal(size=SAMPLES) * scale).astype(np.int64), low, high)
        ends = np.clip(dice.choice([low, high, 0], SAMPLES) + dice.integers(-2, 2, SAMPLES, endpoint=True), low, high)
        kind = dice.choice(3, SAMPLES, p=[0.6, 0.3, 0.1])
        numbers = np.where(kind == 0, spread, np.where(kind == 1, small, ends)).astype(np.int64)
        if name == f"self.{claims.unset}":
            numbers = np.where(dice.random(SAMPLES) < UNSET, LEAST, numbers)
        found[name] = numbers.view(np.uint64) & np.uint64((1 << bits[name]) - 1)
    return found
