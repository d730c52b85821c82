"""Read the C expressions of a program as terms of z3: bit-vectors in fixed point, IEEE floats else."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import z3

from bench.proofs.zeros import never_minus_zero
from firmloop.codegen.view import statement
from firmloop.quantize.ops import EVERY, LARGE
from firmloop.quantize.program import Op, Program

WIDE = 64
EFFORT = 12_000_000  # z3's own count of its work, the same on a busy machine: some 10 s
TIMEOUT = 120_000  # ms, for what it does not count
ROOM = 0.005  # of a state's range, that it provably keeps from its limits
ADDED = ("mac", "mul_add", "mul_add_short")  # to their first argument
PRODUCTS = ("mul", "wide", "mac", "mul_add", "mul_add_short", "mul_shift", "mul_down")
CHOSEN = ("select", "copy")  # operations of floats that z3 sees through at once
FLOATS = {"float32": z3.FPSort(8, 24), "float64": z3.FPSort(11, 53)}


class Meaning:
    """The C expressions of one program as terms of z3."""

    def __init__(
        self,
        program: Program,
        grids: dict[str, int] | None = None,
        away: dict[str, tuple[float, float]] | None = None,
    ) -> None:
        """Take `grids`, the distance apart of what each state holds, to trace values to where they come from.

        `away` are the nearest values to 0, below and above, of each state that never is 0.
        """
        self.program, self.grids, self.away = program, grids, away or {}
        self.writers = {op.result.name: op for op in program.body}
        self.fixed = program.arithmetic.startswith("fixed")
        self.sort = FLOATS.get(program.arithmetic)
        self.ranges: dict[str, tuple[float, float]] = {}
        for value in program.inputs:
            half = 2.0 ** (value.number.bits - 1)
            self.ranges[f"in.{value.name}"] = (-half, half - 1) if self.fixed else (-math.inf, math.inf)
        for value in program.state:
            self.ranges[f"self.{value.name}"] = (value.low, value.high)
        if program.unset is not None:  # it may hold the least integer, or no number, besides
            high = self.ranges[f"self.{program.unset}"][1]
            self.ranges[f"self.{program.unset}"] = (-(2.0**31), high) if self.fixed else (-math.inf, math.inf)
        for op in program.body:
            self.ranges[op.result.name] = (op.result.low, op.result.high)
        self.truths = {op.result.name for op in program.body if op.result.number.fraction == 0 and _is_truth(op)}
        self.only: dict[str, tuple[float, ...]] = {}  # state that is what init() set, or one constant
        self._narrow_states(program)
        self._narrow_moves(program)
        self.signed = frozenset() if self.fixed else never_minus_zero(program)
        self.assumed: list[Any] = []
        self.symbols: dict[str, Any] = {}

    def _narrow_states(self, program: Program) -> None:
        for store, start in zip(program.next_state, program.start, strict=True):
            op = self.writers.get(store.source)
            if op is not None and store.target != self.program.unset:
                low, high = self.ranges[f"self.{store.target}"]
                least, most = min(start, op.result.low), max(start, op.result.high)
                self.ranges[f"self.{store.target}"] = (max(low, least), min(high, most))
            given = _literals(op) if op is not None else ()
            if given:
                self.only[f"self.{store.target}"] = (start, *given)
            if self.fixed and op is not None and op.function == "clamp" and isinstance(op.arguments[0], str):
                low, high = (float(x) * (1 - ROOM) for x in op.arguments[1:])
                least, most = self.ranges[op.arguments[0]]
                self.ranges[op.arguments[0]] = (max(least, low), min(most, high))

    def _narrow_moves(self, program: Program) -> None:
        """Take in what `fl_rti.h` leaves: 1 and a plan whose moves keep their limits, or 0 and zeros.

        Limited states keep theirs to `trusted` of their span, which is taken four times here.
        """
        for table in program.tables:
            if table.form != "fl_rti_t":
                continue
            sizes, numbers = dict(table.sizes), dict(table.numbers)
            moves, anything = sizes["FL_RTI_INPUTS"], (-math.inf, math.inf)
            slack = 4 * float(np.max(numbers["trusted"])) / np.atleast_1d(numbers["weight"])
            slack[:moves] = 0.0
            low, high = np.atleast_1d(numbers["low"]) - slack, np.atleast_1d(numbers["high"]) + slack
            kept = [(min(float(a), 0.0), max(float(b), 0.0)) for a, b in zip(low, high, strict=True)]
            limited = dict(zip(np.atleast_1d(numbers["limited"]), kept[moves:], strict=False))
            states = [limited.get(k, anything) for k in range(sizes["FL_RTI_STATES"])]
            length = sizes["FL_RTI_LENGTH"]
            ends = [*[anything] * moves, (0.0, 1.0), anything, *states * length, *kept[:moves] * length]
            for op in program.body:
                if op.function == "move":
                    self.ranges[op.result.name] = ends[int(op.arguments[1])]

    def unknown(self, name: str) -> Any:
        """Return what memory may hold before init()."""
        return z3.SignExt(WIDE - 32, z3.BitVec(f"{name}?", 32)) if self.fixed else z3.FP(f"{name}?", self.sort)

    def value(self, text: str, given: dict[str, Any]) -> Any:
        """Return the term of a C expression; `given` puts terms in place of names."""
        text = re.sub(r"\b(in|self)->(\w+)", r"\1_dot_\2", text.strip())
        text = re.sub(r"^\(?(.*?)\)? \? (.*) : (.*)$", r"ite(\1, \2, \3)", text)
        text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?(?:e[+-]?\d+)?)([UF]?)\b", _literal, text)
        names = set(re.findall(r"[A-Za-z_]\w*", re.sub(r"'[^']*'", "", text)))
        scope: dict[str, Any] = dict(self._functions())
        for name in names - set(scope):
            plain = name.replace("_dot_", ".")
            scope[name] = given[plain] if plain in given else self.symbol(plain)
        return eval(text, {"__builtins__": {}}, scope)

    def symbol(self, name: str, sample: str = "") -> Any:
        """Return the symbol of a value in this sample or another one, and assume its range."""
        called = sample + name
        if called not in self.symbols:
            low, high = self.ranges[name]
            if self.fixed or name in self.truths:
                value = z3.BitVec(called, WIDE)
                self.assumed += [value >= math.ceil(low), value <= math.floor(high)]
                self.symbols[called] = value
            else:
                x = z3.FP(called, self.sort)
                if math.isfinite(low) and math.isfinite(high):
                    self.assumed += [z3.fpLEQ(self.number(repr(low)), x), z3.fpLEQ(x, self.number(repr(high)))]
                if name.removeprefix("self.") in self.signed and name.startswith("self."):
                    self.assumed.append(z3.Not(z3.And(z3.fpIsZero(x), z3.fpIsNegative(x))))
                self.symbols[called] = x
            if name in self.only:
                self.assumed.append(z3.Or([self.symbols[called] == self.number(repr(x)) for x in self.only[name]]))
            if name.removeprefix("self.") in self.away and name.startswith("self."):
                below, above = (self.number(repr(x)) for x in self.away[name.removeprefix("self.")])
                self.assumed.append(z3.Or(self.symbols[called] <= below, self.symbols[called] >= above))
            self._trace(name, sample)
        return self.symbols[called]

    def _trace(self, name: str, sample: str) -> None:
        """Assume what a value is made of, or the grid that a state is on."""
        called, op = self.symbols[sample + name], self.writers.get(name)
        if self.grids is None or (op is not None and not (self.fixed or op.function in CHOSEN)):
            return
        state = name.removeprefix("self.")
        if name != state and state in self.grids:
            self.assumed.append(self.on_grid(called, state))
        if op is not None and op.function in EVERY and op.function not in LARGE:
            given = {a: self.symbol(a, sample) for a in op.arguments if isinstance(a, str)}
            factors = op.arguments[int(op.function in ADDED) :] if op.function in PRODUCTS else ()
            if sum(isinstance(factor, str) for factor in factors) < 2:
                self.assumed.append(called == self._made(op, given))
            elif op.function == "mul_shift":
                self._trace_product(op, called, given)

    def _made(self, op: Op, given: dict[str, Any]) -> Any:
        return self.value(statement(op, self.program).partition(" = ")[2], given)

    def _trace_product(self, op: Op, called: Any, given: dict[str, Any]) -> None:
        """Assume of a product of two values what z3 can use: its sign, and all where one is one of two constants."""
        one, other = (given[str(a)] for a in op.arguments[:2])
        self.assumed += [
            z3.Implies(z3.Or(z3.And(one >= 0, other >= 0), z3.And(one <= 0, other <= 0)), called >= 0),
            z3.Implies(z3.Or(z3.And(one >= 0, other <= 0), z3.And(one <= 0, other >= 0)), called <= 0),
        ]
        for factor in map(str, op.arguments[:2]):
            constants = self._constants(factor)
            self.assumed += [
                z3.Implies(given[factor] == c, called == self._made(op, given | {factor: self.number(repr(c))}))
                for c in constants
            ]

    def _constants(self, name: str) -> tuple[int, ...]:
        """Return the constants of which a value is one, by what it is made of; none where it is not."""
        op = self.writers.get(name)
        if op is None:
            return ()
        if op.function in CHOSEN:
            return tuple(int(x) for x in _literals(op))
        named = [a for a in op.arguments if isinstance(a, str)]
        if len(named) != 1 or op.function in LARGE:
            return ()
        found = self._constants(named[0])
        terms = [z3.simplify(self._made(op, {named[0]: z3.BitVecVal(c, WIDE)})) for c in found]
        return tuple(term.as_signed_long() for term in terms if z3.is_bv_value(term))

    def on_grid(self, value: Any, state: str) -> Any:
        """Return the condition that a value is on the grid of a state."""
        assert self.grids is not None
        start = dict(zip((v.name for v in self.program.state), self.program.start, strict=True))[state]
        return (value - int(start)) & (self.grids[state] - 1) == 0

    def holds(self, condition: Any, effort: int = EFFORT) -> bool:
        """Whether a condition follows from the assumptions, or from fewer of them, which can be easier to see.

        Bit by bit a short chain of additions and choices is seen at once, which z3 may miss by itself.
        """
        bitwise = z3.Then("simplify", *([] if self.fixed else ["fpa2bv", "simplify"]), "solve-eqs", "bit-blast", "sat")
        for solver, assumed, share in (
            (bitwise.solver(), self.assumed, effort // 5),
            (z3.Solver(), (), effort // 5),
            (z3.Solver(), self.assumed, effort),
        ):
            limited(solver, share).add(*assumed, z3.Not(condition))
            if solver.check() == z3.unsat:
                return True
        return False

    def number(self, text: str) -> Any:
        """Return the term of a literal."""
        if self.fixed:
            return z3.BitVecVal(int(float(text)), WIDE)
        kind = np.float32 if self.sort == FLOATS["float32"] else np.float64
        return z3.FPVal(float(kind(text)), self.sort)

    def same(self, one: Any, other: Any, effort: int = EFFORT) -> bool:
        """Whether two terms are equal, bit for bit, under the assumptions."""
        return not (z3.is_bool(one) or z3.is_bool(other)) and self.holds(one == other, effort)

    def _functions(self) -> dict[str, Any]:
        one, zero = z3.BitVecVal(1, WIDE), z3.BitVecVal(0, WIDE)

        def least(a: Any, b: Any) -> Any:
            return z3.If(a < b, a, b)

        def most(a: Any, b: Any) -> Any:
            return z3.If(a > b, a, b)

        def nought(a: Any, b: Any) -> Any:
            gone = [is_it(x) for x in (a, b) for is_it in (z3.fpIsNaN, z3.fpIsInf)]
            return z3.If(z3.Or(*gone), z3.fpNaN(self.sort), z3.FPVal(0, self.sort))

        def ite(condition: Any, a: Any, b: Any) -> Any:
            return z3.If(condition if z3.is_bool(condition) else condition != 0, a, b)

        def whole(text: str) -> Any:
            return z3.BitVecVal(int(text), WIDE)

        found: dict[str, Any] = {"number": self.number, "whole": whole, "ite": ite}
        found["fl_shl_i32"] = lambda a, s: a << s
        found["fl_shr_i32"] = lambda a, s: (a + (one << (s - 1))) >> s
        found["fl_asr_i32"] = lambda a, s: a >> s
        found["fl_wrap_i32"] = lambda a, s: (a << (s + WIDE - 32)) >> (s + WIDE - 32)
        found["fl_mul_down_i32"] = lambda a, b, s: (a * b) >> s
        found["fl_down_i32"] = lambda acc, s: acc >> s
        found["fl_wide_i64"] = lambda a, b: a * b
        found["fl_mac_i64"] = lambda acc, a, b: acc + a * b
        found["fl_high_i32"] = lambda acc, s: (acc >> s) + ((acc >> (s - 1)) & one)
        found["fl_mul_add_i32"] = lambda first, a, b: first + ((a * b + (one << 31)) >> 32)
        found["fl_mul_add_short_i32"] = lambda first, x, b: first + ((x * b) >> 16)
        found["fl_mul_shift_i32"] = lambda a, b, s: (a * b + (one << (s - 1))) >> s
        for end in ("f32", "f64"):
            found[f"fl_lost_{end}"] = lambda a: z3.If(z3.Or(z3.fpIsNaN(a), z3.fpIsInf(a)), one, zero)
            found[f"fl_outside_{end}"] = lambda x, low, high: z3.If(z3.And(x >= low, z3.Not(x > high)), zero, one)
            found[f"fl_beyond_{end}"] = lambda x, low, high: z3.If(x >= low, high, low)
            found[f"fl_nought_{end}"] = nought
            found[f"fl_none_{end}"] = lambda a: z3.If(z3.fpIsNaN(a), one, zero)
            found[f"fl_unset_{end}"] = lambda: z3.fpNaN(self.sort)
        for end in ("i32", "f32", "f64"):
            found[f"fl_min_{end}"] = least
            found[f"fl_max_{end}"] = most
            found[f"fl_clamp_{end}"] = lambda x, low, high: z3.If(x >= low, z3.If(x > high, high, x), low)
            found[f"fl_abs_{end}"] = lambda a: z3.If(a < 0, -a, a)
        return found


def _literal(found: re.Match[str]) -> str:
    """Write a literal of C as one of ours; without a point, an exponent or an F it is an integer, such as a truth."""
    return f"{'number' if found[2] == 'F' or set(found[1]) & set('.e') else 'whole'}('{found[1]}')"


def limited(solver: Any, effort: int) -> Any:
    """Let a solver give up after so much work."""
    solver.set("rlimit", effort)
    solver.set("timeout", TIMEOUT)
    return solver


def _literals(op: Op) -> tuple[float, ...]:
    """Return the constants of which an operation gives one; none where it gives anything else."""
    taken = op.arguments[1:] if op.function == "select" else op.arguments if op.function == "copy" else ()
    found = tuple(a for a in taken if not isinstance(a, str))
    return found if len(found) == len(taken) else ()


def _is_truth(op: Op) -> bool:
    return EVERY[op.function].truth
