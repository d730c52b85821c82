"""What the operations of a proof.json give, as terms: 32-bit words, 64-bit products, arithmetic shifts, as in the C."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from firmloop.verify.proofs.claims import Argument, ClaimedOperation, Claims, Held
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm
from firmloop.verify.proofs.machine.vex import UndecidedError

LONG = ("wide", "mac")  # of 64 bits
OF_LONG = {"mac": (0,), "high": (0,), "high_down": (0,)}  # places of operands of 64 bits

Known = Callable[[str], BitTerm]  # the term of a value by its name


def entry(pool: Pool, value: Held, place: str) -> BitTerm:
    """Return what an input or a state is before the step, as a word of its own size."""
    return pool.var(f"{place}.{value.name}", value.bits)


def entries(pool: Pool, claims: Claims) -> dict[str, BitTerm]:
    """Return inputs and states by the names that operations call them by, as 32-bit words."""
    places = [("in", value) for value in claims.inputs] + [("self", value) for value in claims.state]
    return {f"{place}.{value.name}": pool.extend("sext", entry(pool, value, place), 32) for place, value in places}


def stated(pool: Pool, op: ClaimedOperation, known: Known) -> BitTerm:
    """Return what the operation gives of the values that are known."""

    def operand(k: int) -> BitTerm:
        argument = op.arguments[k]
        return known(argument) if isinstance(argument, str) else pool.const(int(argument), 64 if _long(op, k) else 32)

    count = _last(op.arguments)
    a = operand(0)
    b = operand(1) if len(op.arguments) > 1 else a
    c = operand(2) if len(op.arguments) > 2 else a
    zero, one = pool.const(0, 32), pool.const(1, 32)
    match op.function:
        case "add" | "sub" | "mul" | "and" | "or":
            return pool.make(op.function, a, b)
        case "neg":
            return pool.make("sub", zero, a)
        case "not":
            return pool.make("sub", one, a)
        case "copy":
            return a
        case "abs":
            return pool.ite(pool.make("slt", a, zero), pool.make("sub", zero, a), a)
        case "shl":
            return pool.make("shl", a, b)
        case "asr":
            return pool.make("ashr", a, b)
        case "wrap":
            return pool.make("ashr", pool.make("shl", a, b), b)
        case "shr":
            half = pool.const(1 << (count - 1), 32)
            return pool.make("ashr", pool.make("add", a, half), b)
        case "wide":
            return _product(pool, a, b)
        case "mac":
            return pool.make("add", a, _product(pool, b, c))
        case "mul_add":
            half = pool.const(1 << 31, 64)
            total = pool.make("add", pool.make("add", pool.concat(a, zero), _product(pool, b, c)), half)
            return pool.extract(total, 32, 32)
        case "mul_add_short":
            return pool.make("add", a, pool.extract(_product(pool, b, c), 16, 32))
        case "mul_shift" | "mul_down":
            return _shifted(pool, _product(pool, a, b), count, op.function == "mul_shift")
        case "high" | "high_down":
            return _shifted(pool, a, count, op.function == "high")
        case _:
            return _choice(pool, op, a, b, c)


def status_of(pool: Pool, claims: Claims, known: Known) -> BitTerm:
    """Return the word that the step returns."""
    word = pool.const(0, 32)
    for _, bit, value in claims.status:
        word = pool.make("or", word, pool.make("shl", known(value), pool.const(bit, 32)))
    return word


def _choice(pool: Pool, op: ClaimedOperation, a: BitTerm, b: BitTerm, c: BitTerm) -> BitTerm:
    compared: Mapping[str, Callable[[], BitTerm]] = {
        "lt": lambda: pool.make("slt", a, b),
        "le": lambda: pool.make("sle", a, b),
        "eq": lambda: pool.make("eq", a, b),
        "ne": lambda: pool.make("not", pool.make("eq", a, b)),
    }
    if op.function in compared:
        return pool.extend("zext", compared[op.function](), 32)
    match op.function:
        case "min":
            return _least(pool, a, b)
        case "max":
            return _most(pool, a, b)
        case "clamp":
            return _least(pool, _most(pool, a, b), c)
        case "select":
            return pool.ite(pool.make("eq", a, pool.const(0, 32)), c, b)
        case _:
            raise UndecidedError(f"the operation {op.function} is not compared with machine code")


def _least(pool: Pool, a: BitTerm, b: BitTerm) -> BitTerm:
    return pool.ite(pool.make("slt", a, b), a, b)


def _most(pool: Pool, a: BitTerm, b: BitTerm) -> BitTerm:
    return pool.ite(pool.make("slt", b, a), a, b)


def _product(pool: Pool, a: BitTerm, b: BitTerm) -> BitTerm:
    return pool.make("mul", pool.extend("sext", a, 64), pool.extend("sext", b, 64))


def _shifted(pool: Pool, word: BitTerm, count: int, rounds: bool) -> BitTerm:
    high = pool.extract(pool.make("ashr", word, pool.const(count, 64)), 0, 32)
    last = pool.extract(word, count - 1, 1)
    return pool.make("add", high, pool.extend("zext", last, 32)) if rounds else high


def _long(op: ClaimedOperation, place: int) -> bool:
    return place in OF_LONG.get(op.function, ())


def _last(arguments: tuple[Argument, ...]) -> int:
    """Return the last argument, which is the count of a shift."""
    last = arguments[-1]
    return last if isinstance(last, int) else 0
