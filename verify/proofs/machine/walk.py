"""Follow a function of an image from its call to its return, along every branch, and say what it leaves behind.

Blocks are lifted by angr's VEX. Where two ways meet, a value is the one of the way that was taken, so that each block
is followed once for each place it is called from. What this cannot follow, it refuses to say anything of: loops, places
in memory that depend on values, instructions that are not known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Any

from firmloop.verify.proofs.machine.image import MachineCode
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm
from firmloop.verify.proofs.machine.vex import UndecidedError, helper, operation

BACK = 0xFFFF_FFF0  # where the function returns to
STACK = 0x7000_0000  # first address above the stack
STACK_BYTES = 0x1_0000
BLOCKS_MOST = 4_000
WAYS_MOST = 8  # that are kept apart at the end
SAVED = tuple(f"r{k}" for k in range(4, 12))  # AAPCS: a function leaves these as they were
_INSTRUCTION = 4  # bytes at most
_BEFORE = 64  # bytes in front of a block that VEX looks at, for an IT that reaches into it

Place = tuple[int, tuple[int, ...]]  # an address, and where the calls on the way to it go back to
END: Place = (BACK, ())


@dataclass(frozen=True, slots=True)
class MachineState:
    """Registers by their place in VEX, memory by the byte, and what was true of the values on the way here."""

    registers: dict[int, BitTerm]
    memory: dict[int, BitTerm]
    path: tuple[BitTerm, ...]


class Tracer:
    """Functions of an image; those at `products` are known to multiply words of 64 bits."""

    def __init__(self, pool: Pool, code: MachineCode, products: frozenset[int]) -> None:
        import pyvex

        self._vex, self._arch = pyvex, pyvex.ARCH_ARM_LE
        self._pool, self._flash, self._base, self._products = pool, code.flash, code.base, products
        self._lifted: dict[int, Any] = {}
        self._given: Mapping[int, BitTerm] = {}

    def register(self, name: str) -> int:
        """Return the place of a register in VEX."""
        return int(self._arch.get_register_offset(name))

    def follow(self, address: int, arguments: tuple[int, ...], given: Mapping[int, BitTerm]) -> list[MachineState]:
        """Return what is there when the function at `address` returns, one for each of its ways that meet there.

        `arguments` go in its first registers; `given` are the bytes of memory that it may read beside its own.
        """
        pool, self._given = self._pool, given
        registers = {self.register(f"r{k}"): pool.var(f"r{k}", 32) for k in range(13)}
        registers |= {self.register(f"r{k}"): pool.const(value, 32) for k, value in enumerate(arguments)}
        registers |= {self.register("sp"): pool.const(STACK, 32), self.register("lr"): pool.const(BACK | 1, 32)}
        registers |= {self.register(name): pool.const(0, 32) for name in ("cc_op", "cc_ndep", "itstate")}
        coming: dict[Place, list[MachineState]] = {(address, ()): [MachineState(registers, {}, ())]}
        for place in self._order(address):
            states = coming.pop(place, [])
            if not states:
                continue
            if place == END:
                return states if len(states) <= WAYS_MOST else [self.met(states)]
            state = self.met(states)
            for target, left in self._run(place, state):
                coming.setdefault(target, []).append(left)
        raise UndecidedError("it does not return")

    def _order(self, address: int) -> list[Place]:
        """Return every place that the function may come to, each behind all it is come to from."""
        before: dict[Place, set[Place]] = {(address, ()): set()}
        left: list[Place] = [(address, ())]
        while left:
            place = left.pop()
            if place == END:
                continue
            if len(before) > BLOCKS_MOST:
                raise UndecidedError(f"it has more than {BLOCKS_MOST} blocks")
            for target in self._targets(place):
                if target not in before:
                    before[target] = set()
                    left.append(target)
                before[target].add(place)
        try:
            return list(TopologicalSorter(before).static_order())
        except CycleError as error:
            raise UndecidedError(f"there is a loop at {min(place[0] for place in error.args[1]):#x}") from None

    def _targets(self, place: Place) -> list[Place]:
        address, back = place
        if address in self._products:
            return [(back[-1], back[:-1])]
        block = self._block(address)
        found = [(self._even(one.dst.value), back) for one in block.statements if isinstance(one, self._vex.stmt.Exit)]
        return [*found, self._next(block, address, back)]

    def _next(self, block: Any, address: int, back: tuple[int, ...]) -> Place:
        if block.jumpkind == "Ijk_Ret":
            return (back[-1], back[:-1]) if back else END
        if block.jumpkind not in ("Ijk_Boring", "Ijk_Call") or not isinstance(block.next, self._vex.expr.Const):
            raise UndecidedError(f"where the code goes from {address:#x} ({block.jumpkind}) is not known here")
        target = self._even(block.next.con.value)
        return (target, (*back, address + block.size)) if block.jumpkind == "Ijk_Call" else (target, back)

    @staticmethod
    def _even(address: int) -> int:
        return int(address) & ~1  # the lowest bit says that it is Thumb code

    def _block(self, address: int) -> Any:
        if address not in self._lifted:
            at = address - self._base
            if not _BEFORE <= at < len(self._flash) - _INSTRUCTION:
                raise UndecidedError(f"the code goes to {address:#x}, which is not in the image")
            block = self._vex.lift(self._flash, address | 1, self._arch, bytes_offset=at + 1, opt_level=1)
            if block.size == 0 or block.jumpkind == "Ijk_NoDecode":
                raise UndecidedError(f"the instruction at {address + block.size:#x} is not known to VEX")
            self._lifted[address] = block
        return self._lifted[address]

    def _run(self, place: Place, state: MachineState) -> list[tuple[Place, MachineState]]:
        """Return the places that a block leads to, each with what is there then."""
        address, back = place
        if address in self._products:
            return [((back[-1], back[:-1]), self._multiplied(place, state))]
        block = self._block(address)
        step = _Block(self, self._pool, self._vex, MachineState(dict(state.registers), dict(state.memory), state.path))
        found = []
        for statement in block.statements:
            left = step.take(statement)
            if left is not None:
                found.append(((self._even(statement.dst.value), back), left))
        if step.path_ends():
            return found
        target = self._next(block, address, back)
        said = step.expression(block.next, block.tyenv)
        if said.value is None or self._even(said.value) != target[0]:
            raise UndecidedError(f"the code goes back from {address:#x} to another place than it was called from")
        return [*found, (target, step.state)]

    def _multiplied(self, place: Place, state: MachineState) -> MachineState:
        """Return what a function that multiplies leaves; of registers that it need not keep, nothing is known."""
        pool = self._pool
        a0, a1, b0, b1 = (state.registers[self.register(f"r{k}")] for k in range(4))
        product = pool.make("mul", pool.concat(a1, a0), pool.concat(b1, b0))
        lost = {name: pool.var(f"{name} after {place}", 32) for name in ("r2", "r3", "r12", "lr", "cc_dep1")}
        left = lost | {
            "r0": pool.extract(product, 0, 32),
            "r1": pool.extract(product, 32, 32),
            "cc_op": pool.const(0, 32),
        }
        return MachineState(
            state.registers | {self.register(name): term for name, term in left.items()}, state.memory, state.path
        )

    def met(self, states: list[MachineState]) -> MachineState:
        """Return one state for all ways that meet: each value is the one of the way that was taken."""
        while len(states) > 1:
            # The two that have most of their way in common: their branch is the last one.
            pairs = [(i, j) for i in range(len(states)) for j in range(i)]
            i, j = max(pairs, key=lambda pair: _common(states[pair[0]].path, states[pair[1]].path))
            one, other = states[i], states[j]
            states = [state for k, state in enumerate(states) if k not in (i, j)] + [self._joined(one, other)]
        return states[0]

    def _joined(self, one: MachineState, other: MachineState) -> MachineState:
        pool, shared = self._pool, _common(one.path, other.path)
        here, there = (pool.all_of(path[shared:]) for path in (one.path, other.path))
        either = pool.make("not", pool.make("and", pool.make("not", here), pool.make("not", there)))
        path = one.path[:shared] if here is pool.make("not", there) else (*one.path[:shared], either)
        registers = {
            k: pool.ite(here, self._kept(one.registers, k), self._kept(other.registers, k))
            for k in {*one.registers, *other.registers}
        }
        memory = {
            k: pool.ite(here, self.byte(one.memory, k), self.byte(other.memory, k))
            for k in {*one.memory, *other.memory}
        }
        return MachineState(registers, memory, path)

    def _kept(self, registers: Mapping[int, BitTerm], place: int) -> BitTerm:
        return registers.get(place) or self._pool.var(f"register{place}", 32)

    def byte(self, memory: Mapping[int, BitTerm], address: int) -> BitTerm:
        """Return the byte at an address: written, given, of the image, or left on the stack by somebody else."""
        found = memory.get(address) or self._given.get(address)
        if found is not None:
            return found
        if self._base <= address < self._base + len(self._flash):
            return self._pool.const(self._flash[address - self._base], 8)
        if STACK - STACK_BYTES <= address < STACK:
            return self._pool.var(f"stack{STACK - address}", 8)
        raise UndecidedError(f"it reads at {address:#x}, which is neither its own nor the controller's")


def _common(one: tuple[BitTerm, ...], other: tuple[BitTerm, ...]) -> int:
    pairs = list(zip(one, other, strict=False))
    return next((k for k, (a, b) in enumerate(pairs) if a is not b), len(pairs))


class _Block:
    """The statements of one block, one after the other."""

    def __init__(self, walk: Tracer, pool: Pool, vex: Any, state: MachineState) -> None:
        self._walk, self._pool, self._vex = walk, pool, vex
        self.state = state
        self._values: dict[int, BitTerm] = {}
        self._types: Any = None

    def path_ends(self) -> bool:
        """Tell whether the block has been left for certain."""
        return any(term.value == 0 for term in self.state.path)

    def take(self, statement: Any) -> MachineState | None:
        """Do what a statement says; return what is there where it leaves the block."""
        tag, pool = statement.tag, self._pool
        if tag in ("Ist_IMark", "Ist_NoOp", "Ist_AbiHint", "Ist_MBE"):
            return None
        if tag == "Ist_WrTmp":
            self._values[statement.tmp] = self.expression(statement.data, None)
        elif tag == "Ist_Put":
            self.state.registers[statement.offset] = self.expression(statement.data, None)
        elif tag == "Ist_Store":
            self._write(self.expression(statement.addr, None), self.expression(statement.data, None))
        elif tag == "Ist_LoadG":
            self._load_if(statement)
        elif tag == "Ist_StoreG":
            self._store_if(statement)
        elif tag == "Ist_Exit":
            leaves = self.expression(statement.guard, None)
            before = self.state.path
            stays = pool.make("not", leaves)
            self.state = MachineState(self.state.registers, self.state.memory, self._with(before, stays))
            if leaves.value == 0:
                return None
            return MachineState(dict(self.state.registers), dict(self.state.memory), self._with(before, leaves))
        else:
            raise UndecidedError(f"the statement {tag} of VEX is not known here")
        return None

    @staticmethod
    def _with(path: tuple[BitTerm, ...], condition: BitTerm) -> tuple[BitTerm, ...]:
        return path if condition.value == 1 else (*path, condition)

    def _load_if(self, statement: Any) -> None:
        found = {"Ident32": (4, "zext"), "8Uto32": (1, "zext"), "8Sto32": (1, "sext"), "16Uto32": (2, "zext")}
        found["16Sto32"] = (2, "sext")
        kind = statement.cvt.removeprefix("ILGop_")
        if kind not in found:
            raise UndecidedError(f"the load {kind} of VEX is not known here")
        size, extend = found[kind]
        guard, other = self.expression(statement.guard, None), self.expression(statement.alt, None)
        if guard.value != 0:
            word = self._pool.extend(extend, self._read(self.expression(statement.addr, None), size), 32)
            other = self._pool.ite(guard, word, other)
        self._values[statement.dst] = other

    def _store_if(self, statement: Any) -> None:
        guard, data = self.expression(statement.guard, None), self.expression(statement.data, None)
        if guard.value != 0:
            address = self.expression(statement.addr, None)
            self._write(address, self._pool.ite(guard, data, self._read(address, data.width // 8)))

    def _address(self, address: BitTerm) -> int:
        if address.value is None:
            raise UndecidedError("it uses a place in memory that depends on values")
        return address.value

    def _read(self, address: BitTerm, size: int) -> BitTerm:
        first = self._address(address)
        word = self._walk.byte(self.state.memory, first)
        for k in range(1, size):
            word = self._pool.concat(self._walk.byte(self.state.memory, first + k), word)
        return word

    def _write(self, address: BitTerm, data: BitTerm) -> None:
        first = self._address(address)
        for k in range(data.width // 8):
            self.state.memory[first + k] = self._pool.extract(data, 8 * k, 8)

    def expression(self, told: Any, types: Any) -> BitTerm:
        """Return the value of an expression of VEX."""
        pool = self._pool
        inner: Callable[[Any], BitTerm] = lambda one: self.expression(one, types)  # noqa: E731
        match told.tag:
            case "Iex_Const":
                size = {"U1": 1, "U8": 8, "U16": 16, "U32": 32, "U64": 64}.get(told.con.type.removeprefix("Ity_I"), 0)
                width = size or int(told.con.type.removeprefix("Ity_I"))
                return pool.const(int(told.con.value), width)
            case "Iex_RdTmp":
                return self._values[told.tmp]
            case "Iex_Get":
                if told.ty != "Ity_I32":
                    raise UndecidedError(f"a register is read as {told.ty}")
                return self.state.registers.get(told.offset) or pool.var(f"register{told.offset}", 32)
            case "Iex_Load":
                return self._read(inner(told.addr), int(told.ty.removeprefix("Ity_I")) // 8)
            case "Iex_Unop" | "Iex_Binop":
                return operation(pool, told.op.removeprefix("Iop_"), [inner(arg) for arg in told.args])
            case "Iex_ITE":
                return pool.ite(inner(told.cond), inner(told.iftrue), inner(told.iffalse))
            case "Iex_CCall":
                return helper(pool, told.callee.name, [inner(arg) for arg in told.args])
            case _:
                raise UndecidedError(f"the expression {told.tag} of VEX is not known here")
