"""Prove that a function of the compiler's library multiplies 64-bit words, so that a call of it is a product.

A core without such an instruction multiplies halves of 16 bits, and a solver of bits does not find that this is the
same. So the product is written out by halves, which is an identity of whole numbers, and the function is proven to add
them up.
"""

from __future__ import annotations

import time

from firmloop.verify.proofs.machine.image import MachineCode
from firmloop.verify.proofs.machine.solver import EQUAL, Solver
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm
from firmloop.verify.proofs.machine.vex import UndecidedError
from firmloop.verify.proofs.machine.walk import SAVED, STACK, Tracer

NAMES = ("__aeabi_lmul",)  # run-time ABI for Arm (IHI 0043), section 4.2; words in r0, r1 and r2, r3, low ones first
LONGEST = 20.0  # s


def proven_products(pool: Pool, code: MachineCode) -> frozenset[int]:
    """Return the addresses of the functions that multiply.

    Raises
    ------
    UndecidedError
        when one that is there is not proven to.
    """
    return frozenset(_proven(pool, code, name) for name in NAMES if name in code.functions)


def _proven(pool: Pool, code: MachineCode, name: str) -> int:
    address = code.functions[name][0]
    walk = Tracer(pool, code, frozenset())
    state = walk.met(walk.follow(address, (), {}))
    words = [pool.var(f"r{k}", 32) for k in range(4)]
    wanted = by_halves(pool, *words)
    solver = Solver(pool, {}, time.monotonic() + LONGEST)
    for register, low in (("r0", 0), ("r1", 32)):
        left = state.registers[walk.register(register)]
        if solver.compare(left, pool.extract(wanted, low, 32), LONGEST)[0] != EQUAL:
            raise UndecidedError(f"{name} of the compiler's library is not proven to multiply")
    kept = all(state.registers[walk.register(one)] is pool.var(one, 32) for one in SAVED)
    if not kept or state.registers[walk.register("sp")].value != STACK or any(at >= STACK for at in state.memory):
        raise UndecidedError(f"{name} of the compiler's library does not leave registers and memory as they were")
    return address


def by_halves(pool: Pool, low_a: BitTerm, high_a: BitTerm, low_b: BitTerm, high_b: BitTerm) -> BitTerm:
    """Return the product of two words of 64 bits, of which what lies above 64 bits is lost.

    As one multiplies on paper, in digits of 16 bits: a b = a1 b1 2^32 + (a1 b0 + a0 b1 + a0 b0 / 2^16) 2^16 + ..., and
    of the high words only their products with the low ones stay.
    """

    def halves(word: BitTerm) -> tuple[BitTerm, BitTerm]:
        return pool.extend("zext", pool.extract(word, 0, 16), 32), pool.make("lshr", word, pool.const(16, 32))

    (a0, a1), (b0, b1) = halves(low_a), halves(low_b)
    lowest = pool.make("mul", a0, b0)
    carried = pool.make("lshr", lowest, pool.const(16, 32))
    middle = pool.extend("zext", carried, 64)
    for part in (pool.make("mul", a1, b0), pool.make("mul", a0, b1)):
        middle = pool.make("add", middle, pool.extend("zext", part, 64))
    low = pool.concat(pool.extract(middle, 0, 16), pool.extract(lowest, 0, 16))
    high = pool.extract(middle, 16, 32)
    for part in (pool.make("mul", a1, b1), pool.make("mul", low_a, high_b), pool.make("mul", high_a, low_b)):
        high = pool.make("add", high, part)
    return pool.concat(high, low)
