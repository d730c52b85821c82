"""Lay out what a step may read and must leave, and follow it through the machine code."""

from __future__ import annotations

from collections.abc import Sequence

from firmloop.verify.proofs.claims import Claims, Held
from firmloop.verify.proofs.machine.image import MachineCode
from firmloop.verify.proofs.machine.products import proven_products
from firmloop.verify.proofs.machine.stated import entry
from firmloop.verify.proofs.machine.sweep import STATUS, Route, Stored
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm
from firmloop.verify.proofs.machine.vex import UndecidedError
from firmloop.verify.proofs.machine.walk import SAVED, STACK, STACK_BYTES, MachineState, Tracer

SELF, IN, OUT = 0x6000_0000, 0x6100_0000, 0x6200_0000  # three places that are no other one's


def step_ways(pool: Pool, claims: Claims, code: MachineCode) -> list[Route]:
    """Return every word that the step leaves on each of its ways, and what each shall be.

    Raises
    ------
    UndecidedError
        when the machine code cannot be followed.
    """
    name = f"{claims.name}_step"
    if name not in code.functions:
        raise UndecidedError(f"the image has no function {name}")
    given: dict[int, BitTerm] = {}
    for base, place, values in ((SELF, "self", claims.state), (IN, "in", claims.inputs)):
        for address, value in laid_out(base, values):
            word = entry(pool, value, place)
            given |= {address + k: pool.extract(word, 8 * k, 8) for k in range(value.bits // 8)}
    walk = Tracer(pool, code, proven_products(pool, code))
    ways = []
    for state in walk.follow(code.functions[name][0], (SELF, IN, OUT), given):
        _check_kept(pool, claims, walk, state)
        status = Stored("the status", state.registers[walk.register("r0")], STATUS)
        ways.append(Route(state.path, (*_stored(pool, claims, walk, state), status)))
    return ways


def laid_out(base: int, values: Sequence[Held]) -> list[tuple[int, Held]]:
    """Return the address of each member of a struct: in order, each at a multiple of its size."""
    found, at = [], base
    for value in values:
        size = value.bits // 8
        at += -at % size
        found.append((at, value))
        at += size
    return found


def _check_kept(pool: Pool, claims: Claims, walk: Tracer, state: MachineState) -> None:
    """Check what a caller relies on: registers, stack, and no memory of anybody else."""
    own = [
        range(address, address + value.bits // 8)
        for base, values in ((SELF, claims.state), (OUT, claims.outputs))
        for address, value in laid_out(base, values)
    ]
    for name in SAVED:
        if state.registers[walk.register(name)] is not pool.var(name, 32):
            raise UndecidedError(f"it does not return {name} as it was, as far as is seen here")
    if state.registers[walk.register("sp")].value != STACK:
        raise UndecidedError("it does not return the stack pointer as it was, as far as is seen here")
    for address in state.memory:
        if not STACK - STACK_BYTES <= address < STACK and not any(address in one for one in own):
            raise UndecidedError(f"it writes at {address:#x}, which is not the controller's")


def _stored(pool: Pool, claims: Claims, walk: Tracer, state: MachineState) -> list[Stored]:
    found = []
    groups = (
        (SELF, "self", claims.state, [claims.following[v.name] for v in claims.state]),
        (OUT, "out", claims.outputs, list(claims.results)),
    )
    for base, place, values, sources in groups:
        for (address, value), source in zip(laid_out(base, values), sources, strict=True):
            word = walk.byte(state.memory, address)
            for k in range(1, value.bits // 8):
                word = pool.concat(walk.byte(state.memory, address + k), word)
            found.append(Stored(f"{place}.{value.name}", pool.extend("sext", word, 32), source))
    return found
