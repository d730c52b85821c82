"""What the operations and condition codes of VEX, angr's intermediate language, mean as terms.

Condition codes are those of Valgrind's guest_arm_defs.h: an operation, its operands, and the flags from them on demand.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm

_BINARY = {
    "Add": "add",
    "Sub": "sub",
    "Mul": "mul",
    "And": "and",
    "Or": "or",
    "Xor": "xor",
    "Shl": "shl",
    "Shr": "lshr",
    "Sar": "ashr",
}
_COMPARED = {"EQ": "eq", "LTS": "slt", "LES": "sle", "LTU": "ult", "LEU": "ule"}
COPY, ADD, SUB, ADC, SBB, LOGIC, MUL, MULL = range(8)
OVERFLOW, CARRY, ZERO, NEGATIVE = 28, 29, 30, 31  # bits of the flags as one word


class UndecidedError(Exception):
    """What the machine code does is not known here; the message names the place and what it is."""


def operation(pool: Pool, name: str, args: Sequence[BitTerm]) -> BitTerm:
    """Return what the operation Iop_<name> gives."""
    if found := re.fullmatch(r"(Add|Sub|Mul|And|Or|Xor|Shl|Shr|Sar)(8|16|32|64)", name):
        a, b = args
        return pool.make(_BINARY[found[1]], a, pool.extend("zext", b, a.width))
    if found := re.fullmatch(r"Cmp(EQ|NE|LT|LE)(?:8|16|32|64)([SU]?)", name):
        if found[1] == "NE":
            return pool.make("not", pool.make("eq", *args))
        return pool.make(_COMPARED[found[1] + found[2]], *args)
    if found := re.fullmatch(r"Mull([SU])32", name):
        return pool.make("mul", *(pool.extend("sext" if found[1] == "S" else "zext", a, 64) for a in args))
    if re.fullmatch(r"Not(1|8|16|32|64)", name):
        return pool.make("not", *args)
    if found := re.fullmatch(r"(?:1|8|16|32)([SU])to(\d+)", name):
        return pool.extend("sext" if found[1] == "S" else "zext", args[0], int(found[2]))
    if found := re.fullmatch(r"(?:8|16|32|64)to(\d+)", name):
        return pool.extract(args[0], 0, int(found[1]))
    if name == "64HIto32":
        return pool.extract(args[0], 32, 32)
    if name == "32HLto64":
        return pool.concat(*args)
    raise UndecidedError(f"the operation {name} of VEX is not known here")


def helper(pool: Pool, name: str, args: Sequence[BitTerm]) -> BitTerm:
    """Return what a helper of VEX gives for condition codes."""
    known: dict[str, Callable[[int], BitTerm]] = {
        "armg_calculate_flag_n": lambda op: flags(pool, op, args[1:])[0],
        "armg_calculate_flag_z": lambda op: flags(pool, op, args[1:])[1],
        "armg_calculate_flag_c": lambda op: flags(pool, op, args[1:])[2],
        "armg_calculate_flag_v": lambda op: flags(pool, op, args[1:])[3],
        "armg_calculate_condition": lambda op: _condition(pool, op >> 4, op & 15, args[1:]),
    }
    if name == "armg_calculate_flags_nzcv":
        return _chosen(pool, args[0], lambda op: _as_word(pool, flags(pool, op, args[1:])))
    if name not in known:
        raise UndecidedError(f"the helper {name} of VEX is not known here")
    return pool.extend("zext", _chosen(pool, args[0], known[name]), 32)


def _chosen(pool: Pool, op: BitTerm, give: Callable[[int], BitTerm]) -> BitTerm:
    """Return what `give` says of an operation that may be one of several, by where the code came from."""
    if op.value is not None:
        return give(op.value)
    if op.op == "ite":
        return pool.ite(op.args[0], _chosen(pool, op.args[1], give), _chosen(pool, op.args[2], give))
    if op.op == "or" and op.args[1].value is not None:  # a condition, put into the word of the operation
        return _chosen(pool, op.args[0], lambda one: give(one | int(op.args[1].value or 0)))
    raise UndecidedError("the flags of an operation that is not known here")


def flags(pool: Pool, op: int, operands: Sequence[BitTerm]) -> tuple[BitTerm, BitTerm, BitTerm, BitTerm]:
    """Return negative, zero, carry and overflow, one bit each."""
    a, b, more = operands
    nothing = pool.const(0, 32)

    def bit(word: BitTerm, place: int) -> BitTerm:
        return pool.extract(word, place, 1)

    if op == COPY:
        return bit(a, NEGATIVE), bit(a, ZERO), bit(a, CARRY), bit(a, OVERFLOW)
    if op in (LOGIC, MUL):
        carry, over = (bit(b, 0), bit(more, 0)) if op == LOGIC else (bit(more, 1), bit(more, 0))
        return bit(a, 31), pool.make("eq", a, nothing), carry, over
    if op == MULL:
        zero = pool.make("eq", pool.make("or", a, b), nothing)
        return bit(b, 31), zero, bit(more, 1), bit(more, 0)
    if op in (ADD, ADC):
        result = pool.make("add", a, b)
        carry = pool.make("ult", result, a)
        if op == ADC:
            result = pool.make("add", result, more)
            carried = pool.make("eq", more, nothing)
            carry = pool.ite(carried, pool.make("ult", result, a), pool.make("ule", result, a))
        signs = pool.make("and", pool.make("xor", result, a), pool.make("xor", result, b))
    elif op in (SUB, SBB):
        result = pool.make("sub", a, b)
        carry = pool.make("ule", b, a)
        if op == SBB:
            result = pool.make("sub", result, pool.make("xor", more, pool.const(1, 32)))
            carry = pool.ite(pool.make("eq", more, nothing), pool.make("ult", b, a), carry)
        signs = pool.make("and", pool.make("xor", a, b), pool.make("xor", a, result))
    else:
        raise UndecidedError(f"condition codes of operation {op} are not known here")
    zero = pool.make("eq", a, b) if op == SUB else pool.make("eq", result, nothing)
    return bit(result, 31), zero, carry, bit(signs, 31)


def _condition(pool: Pool, condition: int, op: int, operands: Sequence[BitTerm]) -> BitTerm:
    """Return whether one of the sixteen conditions of Arm holds; odd ones are the opposite of the even ones."""
    negative, zero, carry, over = flags(pool, op, operands)
    a, b = operands[:2]
    less = pool.make("slt", a, b) if op == SUB else pool.make("xor", negative, over)
    opposite = pool.make("not", zero)
    holds = {
        0: zero,
        2: carry,
        4: negative,
        6: over,
        8: pool.make("and", carry, opposite),
        10: pool.make("not", less),
        12: pool.make("slt", b, a) if op == SUB else pool.make("and", opposite, pool.make("not", less)),
        14: pool.const(1, 1),
    }[condition & 14]
    return pool.make("not", holds) if condition & 1 and condition < 14 else holds


def _as_word(pool: Pool, four: Sequence[BitTerm]) -> BitTerm:
    word = four[0]
    for one in four[1:]:
        word = pool.concat(word, one)
    return pool.concat(word, pool.const(0, 28))
