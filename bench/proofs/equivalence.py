"""Show with z3 that a changed line of generated C cannot change what the controller does.

Both expressions are read as bit-vectors (fixed point) or IEEE floats and compared over all values their operands can
have: those of the proven ranges. These arguments are tried:

0. only the type is another, and the line's proven range fits it;
1. the line's value is the same;
2. it is not, but every line that reads it, and every line of the next step that reads the state it is stored in, is;
3. nor is every such line, but the outputs, the status and the state that the rest of the step makes of it are;
4. as 1 to 3, with what the operands are made of in this step put in (of a product of two values only its sign: z3 would
   not end), and the grid on which each state is kept: a power of two apart from where it starts, shown by induction,
   and of a float that follows from itself alone that it never is 0;
5. one state has the other sign in the mutant, always, and nothing else shows it;
6. all that is made of it are sums, of which it is only asked whether they are finite, see `bench/proofs/finite.py`;
7. its limit never acts, see `bench/proofs/boxes.py`: then 1 and 2 for the values that are left;
8. for a line of init(): the whole first step gives the same outputs, status and state for any inputs.

The range of what a state's last limit is given is narrower than the sum of its terms says: the law keeps its state
within the range it declares (`why` in proof.json), which is widened by 1 % for roundings; half of that is left to them
here. That holds for the limits that fixed point adds, not for those of a law in floating point, which act. An
answer that z3 does not find in time counts as no.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import z3

from bench.proofs.boxes import stays_within
from bench.proofs.finite import only_asked_whether_finite
from bench.proofs.meaning import EFFORT, Meaning, limited
from bench.proofs.orbit import away_from_zero
from bench.proofs.planting import Mutant
from firmloop.codegen.view import statement
from firmloop.quantize.ops import LARGE
from firmloop.quantize.program import Op, Program
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import characters

KEEPING = ("add", "sub", "neg", "copy", "mul", "wide", "mac", "shl")  # what goes in differently comes out differently
CUT = EFFORT // 10  # to see that two values in the middle of a step are the same
LANES, SAMPLES = 4, 500  # of a run that tells which grids to look for
LINE = re.compile(r"\s*const (\w+) (\w+) = (.*);")


def equivalent(program: Program, mutant: Mutant) -> str | None:
    """Return why the mutant is equivalent; None where that is not shown."""
    meaning = Meaning(program)
    first = re.match(r"\s*self->(\w+) = (.*);", mutant.before)
    if first is not None and any(v.name == first[1] for v in program.state):
        return _at_the_start(program, meaning, first[1], mutant)
    before, after = LINE.match(mutant.before), LINE.match(mutant.after)
    if before is None or after is None or before[2] != after[2]:
        return None
    name = before[2]
    if before[1] != after[1]:
        return _fits(program, name, after[1]) if before[3] == after[3] else None
    whole = cache(lambda: _deep(program))
    tries: tuple[Callable[[], str | None], ...] = (
        lambda: _finite(program, name, after[3]),
        lambda: _same_line(program, meaning, name, before[3], after[3]),
        lambda: _idle(program, name, before[3], after[3]),
        lambda: _same_line(program, Meaning(program, whole().grids, whole().away), name, before[3], after[3]),
        lambda: _same_line(program, whole(), name, before[3], after[3]),
        lambda: _turned(program, meaning, name, after[3]),
    )
    for attempt in tries:
        try:
            why = attempt()
        except (z3.Z3Exception, SyntaxError, TypeError, KeyError, NameError, AttributeError, ValueError):
            continue  # a text that is no expression of ours
        if why is not None:
            return why
    return None


def _same_line(program: Program, meaning: Meaning, name: str, before: str, after: str) -> str | None:
    """Compare both texts of a line, what reads it, and what the step makes of it."""
    old, new = meaning.value(before, {}), meaning.value(after, {})
    if meaning.same(old, new):
        return "the same value on the proven range, by z3"
    stored = {f"self.{a.target}" for a in program.next_state if a.source == name}
    outward = {a.source for a in program.results} | {b.source for b in program.status}
    here = [op for op in program.body if name in op.arguments]
    later = [op for op in program.body if stored & set(op.arguments)]
    if name in outward or not (here or later):
        return None
    if all(_same_reader(program, meaning, op, {name}, old, new) for op in here) and all(
        op not in here and _same_reader(program, meaning, op, stored, old, new) for op in later
    ):
        return "every line that reads it has the same value on the proven ranges, by z3"
    if stored:
        return None
    fresh = Meaning(program, meaning.grids, meaning.away)
    cases = _where_apart(meaning, name, old, new)
    if all(_same_step(program, fresh, *case) for case in cases) or _same_step(
        program, meaning, {name: old}, {name: new}
    ):
        return "outputs, status and state after the step are the same on the proven ranges, by z3"
    return None


def _same_reader(program: Program, meaning: Meaning, op: Op, places: set[str], old: Any, new: Any) -> bool:
    """Compare what a line makes of both values; read a step later, its other operands are those of another sample."""
    text = statement(op, program).partition(" = ")[2]
    others = {a for a in op.arguments if isinstance(a, str)} - places
    given = {a: meaning.symbol(a, "later ") for a in others} if any(p.startswith("self.") for p in places) else {}
    one, other = (meaning.value(text, given | dict.fromkeys(places, value)) for value in (old, new))
    return meaning.same(one, other)


def _turned(program: Program, meaning: Meaning, name: str, after: str) -> str | None:
    """Look for a state that starts at 0 and whose sign the mutant turns, step for step, which nothing else shows."""
    for turned, start in zip(program.next_state, program.start, strict=True):
        if not meaning.fixed or start != 0:
            continue
        place = f"self.{turned.target}"
        negated, negations = {place}, {}  # what has the other sign; and what only is the negative of another value
        turned_truths: set[str] = set()
        for op in program.body:
            called, text = op.result.name, statement(op, program).partition(" = ")[2]
            if op.function == "neg" and op.arguments[0] not in negated:
                negations[called] = meaning.value(text, {})
            if _symmetric(program, op, place, meaning):
                negated.add(called)
            elif called == name or (negated | turned_truths) & set(op.arguments):
                one = meaning.value(text, negations)
                mirrored = {a: -meaning.symbol(a) for a in negated}
                mirrored |= {a: meaning.number("1") - meaning.symbol(a) for a in turned_truths}
                other = meaning.value(after if called == name else text, negations | mirrored)
                if meaning.same(one + other, meaning.number("0")):
                    negated.add(called)
                elif called in meaning.truths and meaning.same(one + other, meaning.number("1")):
                    turned_truths.add(called)
                elif not meaning.same(one, other):
                    break
        else:
            shown = {a.source for a in (*program.results, *program.next_state, *program.status) if a is not turned}
            if turned.source in negated and not shown & (negated | turned_truths):
                return f"{turned.target} has the other sign, which nothing shows, by z3"
    return None


def _finite(program: Program, name: str, after: str) -> str | None:
    if program.arithmetic.startswith("fixed") or not only_asked_whether_finite(program, name, after):
        return None
    return "of the sums made of it only is asked whether they are finite, and they are as before"


def _idle(program: Program, name: str, before: str, after: str) -> str | None:
    """Look whether the limits of a line in fixed point are such that what it limits keeps them by itself."""
    meaning = Meaning(program)
    op = meaning.writers[name]
    value = op.arguments[0]
    limits = [int(x) for x in re.findall(r"(?<!\w)-?\d+", before + after)]
    if not meaning.fixed or op.function not in ("min", "max") or not isinstance(value, str) or not limits:
        return None
    least, most = meaning.ranges[value]
    if op.function == "max" and stays_within(program, meaning.ranges, value, max(limits), most):
        least = max(limits)
    if op.function == "min" and stays_within(program, meaning.ranges, value, least, min(limits)):
        most = min(limits)
    if (least, most) == meaning.ranges[value]:
        return None
    meaning.ranges[value] = least, most
    why = _same_line(program, meaning, name, before, after)
    return None if why is None else f"the limit never acts, by intervals, and so {why}"


def _symmetric(program: Program, op: Op, place: str, meaning: Meaning) -> bool:
    """Tell whether an operation rounds a multiple of a state that never is halfway: then its sign may go through.

    z3 does not end on this: x c = 2^(s-1) (mod 2^s) asks for an x that is a multiple of 2^(s-1) over c's power of two.
    """
    product = meaning.writers.get(str(op.arguments[0]))
    if op.function != "high" or product is None or product.function != "wide" or product.arguments[0] != place:
        return False
    factor, shift = product.arguments[1], op.arguments[1]
    if isinstance(factor, str) or isinstance(shift, str) or factor == 0:
        return False
    halfway = 2 ** (int(shift) - 1) // (int(factor) & -int(factor))
    low, high = meaning.ranges[place]
    return max(-low, high) < halfway


def _deep(program: Program) -> Meaning:
    """Return the meaning with operands traced to where they come from, and states on their grids or away from 0."""
    grids: dict[str, int] = {}
    if program.arithmetic.startswith("fixed") and not program.tables:
        noise = next(block for block in characters(program, LANES, SAMPLES, 1) if block.name == "noise")
        state = run(program, noise.inputs).state.astype(np.int64)
        for j, (value, start) in enumerate(zip(program.state, program.start, strict=True)):
            apart = int(np.bitwise_or.reduce(state[..., j].ravel() - int(start)))
            if value.name not in (program.unset, *program.tunable) and apart:
                grids[value.name] = apart & -apart  # the lowest bit that ever differs from the start
    away = {} if program.arithmetic.startswith("fixed") or program.tables else away_from_zero(program)
    while True:
        meaning = Meaning(program, grids, away)
        kept = {
            a.target: grids[a.target]
            for a in program.next_state
            if a.target in grids and meaning.holds(meaning.on_grid(meaning.symbol(a.source), a.target))
        }
        if kept == grids:
            return meaning
        grids = kept


def _fits(program: Program, name: str, kind: str) -> str | None:
    """Tell whether an integer's proven range is one of the type that it is put into."""
    result = next((op.result for op in program.body if op.result.name == name), None)
    bits = re.fullmatch(r"int(\d+)_t", kind)
    if result is None or bits is None or result.number.kind == "float":
        return None
    half = 2 ** (int(bits[1]) - 1)
    return "its proven range fits the other type" if -half <= result.low and result.high < half else None


def _where_apart(meaning: Meaning, name: str, old: Any, new: Any) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Return the value `name` has in both, and with it the operands that have one value wherever both differ.

    Which of these have but one value then is seen, and its number put in its place; 0 of a float is two cases. What
    the rest of the step makes of `name` is no operand: it is another in the mutant.
    """
    made = _made_of(meaning.program, name, lambda op: op.arguments)
    cases: list[tuple[dict[str, Any], dict[str, Any]]] = [({name: old}, {name: new})]
    solver = limited(z3.Solver(), EFFORT)
    solver.add(*meaning.assumed, old != new)
    if solver.check() != z3.sat:
        return cases
    model = solver.model()
    operands = [(place, term) for place, term in meaning.symbols.items() if place not in made]
    places = [((0,), name, old), ((1,), name, new), *(((0, 1), *item) for item in operands)]
    for which, place, term in places:
        value = model.eval(term, model_completion=True)
        numbers = [value]
        if z3.is_fp(term) and model.eval(z3.fpIsZero(term), model_completion=True):
            numbers = [z3.fpPlusZero(term.sort()), z3.fpMinusZero(term.sort())]
        if solver.check(*(term != number for number in numbers)) == z3.unsat:
            put = [number for number in numbers if solver.check(term == number) != z3.unsat]
            cases = [_with(case, which, place, number) for case in cases for number in put]
    return cases


def _with(
    case: tuple[dict[str, Any], dict[str, Any]], which: tuple[int, ...], place: str, value: Any
) -> tuple[dict[str, Any], dict[str, Any]]:
    one, other = ({**given, place: value} if k in which else given for k, given in enumerate(case))
    return one, other


def _same_step(program: Program, meaning: Meaning, one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Compare what the rest of the step makes of the values that are given for both.

    Where an operation that drops places, or chooses, gives the same of both, that is put in for both.
    """
    pair, known = [dict(one), dict(other)], set(one)
    for op in program.body:
        name = op.result.name
        if name not in known and any(argument in pair[0] for argument in op.arguments):
            text = statement(op, program).partition(" = ")[2]
            for given in pair:
                given[name] = z3.simplify(meaning.value(text, given))
            one_way, other_way = pair[0][name], pair[1][name]
            if op.function not in KEEPING and not one_way.eq(other_way) and meaning.same(one_way, other_way, CUT):
                pair[1][name] = one_way
    ends = [*program.results, *program.next_state, *program.status]
    reached = {end.source for end in ends if end.source in pair[0]}
    return all(meaning.same(pair[0][source], pair[1][source]) for source in sorted(reached))


def _at_the_start(program: Program, meaning: Meaning, state: str, mutant: Mutant) -> str | None:
    """Compare the first step with the state that init() sets and with what the mutant leaves there."""
    changed = re.match(r"\s*self->(\w+) = (.*);", mutant.after)
    starts = {v.name: meaning.number(repr(x)) for v, x in zip(program.state, program.start, strict=True)}
    if starts[state] is None or not mutant.before.strip().endswith(";"):
        return None
    try:
        left = meaning.value(changed[2], {}) if changed is not None else meaning.unknown(state)
        if changed is not None and changed[1] != state:
            return None
        touched = _made_of(program, f"self.{state}", partial(_read, program))
        ends = []
        for other in (starts[state], left):
            given = {f"self.{name}": value for name, value in starts.items()} | {f"self.{state}": other}
            for op in program.body:
                place = op.result.name
                if op.function in LARGE and place not in touched:
                    given[place] = meaning.symbol(place)  # of the same arguments the same, whatever it is
                    continue
                given[place] = z3.simplify(meaning.value(statement(op, program).partition(" = ")[2], given))
            sources = [a.source for a in (*program.next_state, *program.results)] + [b.source for b in program.status]
            ends.append([given[source] for source in sources])
    except (z3.Z3Exception, SyntaxError, TypeError, KeyError, NameError, AttributeError, ValueError):
        return None
    if all(meaning.same(one, other) for one, other in zip(*ends, strict=True)):
        return "the first step does the same, whatever stands there, by z3"
    return None


def _made_of(program: Program, name: str, read: Callable[[Op], tuple[object, ...]]) -> set[object]:
    """Return `name` and what the rest of the step makes of it; `read` says what an operation reads."""
    made: set[object] = {name}
    for op in program.body:
        if made & set(read(op)):
            made.add(op.result.name)
    return made


def _read(program: Program, op: Op) -> tuple[object, ...]:
    """Return what an operation reads in the first step: a nonlinear one without a plan reads none of it."""
    if op.function != "improve":
        return op.arguments
    sizes = dict(program.tables[0].sizes)
    planned = 2 + 2 * sizes["FL_RTI_STATES"] + sizes["FL_RTI_INPUTS"]  # behind table and routine
    starts = {f"self.{v.name}": x for v, x in zip(program.state, program.start, strict=True)}
    return op.arguments[: planned + 1] if starts.get(str(op.arguments[planned])) == 0 else op.arguments
