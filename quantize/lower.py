"""Turn a Law into a Program: read its graph, give each node a format, keep what was proven on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from design.law import Law
from identify.signal import Signal
from quantize.builder import Builder, Constant, Operand, Term
from quantize.fixed import FixedBuilder
from quantize.floating import FloatBuilder
from quantize.formats import Formats, choose_formats
from quantize.graph import Graph, read_graph
from quantize.program import Assign, Number, Program, QuantizeError, Rounding, StatusBit, Value

ARITHMETICS = ("float32", "float64", "fixed32", "fixed16")


def lower(law: Law, arithmetic: str) -> Program:
    """Give the law's arithmetic the format `arithmetic`: "float32", "float64", "fixed32" or "fixed16".

    Raises
    ------
    QuantizeError
        when a value has no finite range (fixed point), or a range or coefficient does not fit.
    """
    if arithmetic not in ARITHMETICS:
        raise QuantizeError(f"arithmetic {arithmetic!r} is unknown; known: {', '.join(ARITHMETICS)}")
    if len(law.stages) != 1:
        raise QuantizeError(f"law {law.name!r} has {len(law.stages)} stages; exactly one is needed")
    graph = read_graph(law.stages[0].function)
    bits = int(arithmetic[5:])
    if arithmetic.startswith("fixed"):
        formats, builder = choose_formats(law, graph), FixedBuilder(bits)
        return _Lowering(law, graph, arithmetic, formats, builder, 32).program()
    none = Formats((0,) * len(graph.nodes), (0,) * len(law.inputs), (0,) * len(law.state))
    return _Lowering(law, graph, arithmetic, none, FloatBuilder(bits), bits).program()


class _Lowering:
    """One walk over one law; the builder decides operations, the walk decides order and names."""

    def __init__(
        self,
        law: Law,
        graph: Graph,
        arithmetic: str,
        formats: Formats,
        builder: FixedBuilder | FloatBuilder,
        state_bits: int,
    ) -> None:
        self.law, self.graph, self.arithmetic = law, graph, arithmetic
        self.formats, self.builder, self.state_bits = formats, builder, state_bits
        self.ops: Builder = builder.ops

    def program(self) -> Program:
        law, formats = self.law, self.formats
        next_row, output_row, flag_row = self.graph.results[:3]
        inputs = tuple(self._value(s, q) for s, q in zip(law.inputs, formats.inputs, strict=True))
        outputs = tuple(self._value(s, formats.nodes[n]) for s, n in zip(law.outputs, output_row, strict=True))
        state = tuple(self._state(s, q) for s, q in zip(law.state, formats.state, strict=True))
        used, outside = self._read_inputs(inputs)
        held = [Term(f"self.{v.name}", v.number, v.low, v.high, 0.0) for v in state]
        nodes = self._walk([held, used], self._grids(outputs))
        next_state = tuple(
            Assign(v.name, self._store(nodes[n], v, f"{v.name}_next").name)
            for v, n in zip(state, next_row, strict=True)
        )
        stored = [self._store(nodes[n], v, v.name) for v, n in zip(outputs, output_row, strict=True)]
        return Program(
            name=law.name,
            says=law.says,
            period=law.period,
            arithmetic=self.arithmetic,
            inputs=inputs,
            outputs=outputs,
            state=state,
            start=tuple(self.builder.literal(x, v.number) for x, v in zip(law.start, state, strict=True)),
            tunable=law.tunable,
            body=tuple(self.ops.body),
            next_state=next_state,
            results=tuple(Assign(v.name, t.name) for v, t in zip(outputs, stored, strict=True)),
            status=self._status([nodes[n] for n in flag_row], outside),
            rounding=tuple(Rounding(v.name, t.error, v.unit) for v, t in zip(outputs, stored, strict=True)),
        )

    def _value(self, signal: Signal, q: int) -> Value:
        number = self.builder.signal(signal.low, signal.high, q)
        low, high = self.builder.limits(signal.low, signal.high, number)
        return Value(signal.name, signal.unit, number, low, high)

    def _state(self, signal: Signal, q: int) -> Value:
        number = replace(self.builder.signal(signal.low, signal.high, q), bits=self.state_bits, fraction=q)
        low, high = self.builder.limits(signal.low, signal.high, number)
        if signal.name in self.law.tunable:  # who sets it to the declared end, rounded, is within
            low, high = self.builder.literal(signal.low, number), self.builder.literal(signal.high, number)
        return Value(signal.name, signal.unit, number, low, high)

    def _read_inputs(self, inputs: tuple[Value, ...]) -> tuple[list[Term], list[Term]]:
        """Clamp each input to its declared range; say which ones were outside (a NaN is)."""
        used, outside = [], []
        for value, q in zip(inputs, self.formats.inputs, strict=True):
            low, high = _word(value.number)
            raw = Term(f"in.{value.name}", replace(value.number, bits=self.state_bits), low, high, 0.0)
            self.ops.wish = (value.name, value.unit)
            limited = self.ops.emit("clamp", (raw, value.low, value.high), raw.number, 0.0)
            self.ops.wish = (f"{value.name}_outside", "")
            outside.append(self.ops.emit("ne", (raw, limited), raw.number, 0.0))
            self.ops.wish = (f"{value.name}_wide", value.unit) if q != value.number.fraction else ("", "")
            used.append(self.builder.widened(limited, q))
            self.ops.wish = ("", "")
        return used, outside

    def _grids(self, outputs: tuple[Value, ...]) -> Mapping[int, int]:
        """Return for each constant that limits an output directly the fraction of that output."""
        grids: dict[int, int] = {}
        for value, node in zip(outputs, self.graph.results[1], strict=True):
            pending = [node] if value.number.kind == "fixed" else []
            while pending:
                node = pending.pop()
                kind = self.graph.nodes[node].function
                if kind == "constant":
                    grids[node] = min(value.number.fraction, grids.get(node, value.number.fraction))
                elif kind in ("min", "max"):
                    pending += self.graph.nodes[node].arguments
        return grids

    def _walk(self, arguments: list[list[Term]], grids: Mapping[int, int]) -> list[Operand]:
        names = self._names()
        nodes: list[Operand] = []
        for k, node in enumerate(self.graph.nodes):
            if node.function == "constant":
                nodes.append(Constant(node.value, grids.get(k)))
                continue
            if node.function == "argument":
                nodes.append(arguments[node.place[0]][node.place[1]])
                continue
            operands = [nodes[a] for a in node.arguments]
            self.ops.wish = names.get(k, ("", ""))
            nodes.append(self._node(node.function, operands, self.formats.nodes[k]))
            self.ops.wish = ("", "")
        return nodes

    def _node(self, function: str, operands: list[Operand], q: int) -> Operand:
        match function, operands:
            case (("and" | "or"), [a, b]):
                return self.builder.truth(function, a, b)
            case "if", [condition, a]:
                return self.builder.choose(condition, a, q)
            case _, [a]:
                return self.builder.unary(function, a, q)
            case _, [a, b]:
                return self.builder.binary(function, a, b, q)
        raise AssertionError(function)

    def _names(self) -> Mapping[int, tuple[str, str]]:
        """Names for nodes, the law's own intermediates first, then flags and outputs."""
        names: dict[int, tuple[str, str]] = {}
        rows = (
            (3, [(s.name, s.unit) for s in self.law.stages[0].named]),
            (2, [(f.name, "") for f in self.law.flags]),
            (1, [(f"{s.name}_limited", s.unit) for s in self.law.outputs]),
            (0, [(f"{s.name}_new", s.unit) for s in self.law.state]),
        )
        for row, wishes in rows:
            for node, wish in zip(self.graph.results[row], wishes, strict=True):
                names.setdefault(node, wish)
        return names

    def _store(self, node: Operand, value: Value, name: str) -> Term:
        low, high = value.low, value.high
        return self.builder.store(node, value.number, low, high, (name, value.unit))  # type: ignore[arg-type]

    def _status(self, flags: list[Operand], outside: list[Term]) -> tuple[StatusBit, ...]:
        bits = [
            StatusBit(flag.name, flag.says, k, node.name)
            for k, (flag, node) in enumerate(zip(self.law.flags, flags, strict=True))
            if isinstance(node, Term)
        ]
        first = len(self.law.flags)
        for k, (signal, term) in enumerate(zip(self.law.inputs, outside, strict=True)):
            says = f"{signal.name} was outside its range and was limited to it"
            bits.append(StatusBit(f"{signal.name}_outside", says, first + k, term.name))
        return tuple(bits)


def _word(number: Number) -> tuple[float, float]:
    """Return what a variable of this type can hold."""
    if number.kind == "fixed":
        return -(2 ** (number.bits - 1)), 2 ** (number.bits - 1) - 1
    return float("-inf"), float("inf")
