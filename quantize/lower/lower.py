"""Turn a Law into a Program: read its graph, give each node a format, keep what was proven on the way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from firmloop.design.law import Horizon, Law, Quadratic, Tree
from firmloop.identify.signal import Signal
from firmloop.quantize.formats.quadratic import table_of
from firmloop.quantize.formats.rti import table_of as course_table
from firmloop.quantize.lower.budget import budget_of
from firmloop.quantize.lower.builder import Builder, Constant, Operand, Term
from firmloop.quantize.lower.curves import rotated
from firmloop.quantize.lower.first_sample import in_one_branch
from firmloop.quantize.lower.fixed import FixedBuilder
from firmloop.quantize.lower.floating import FloatBuilder
from firmloop.quantize.lower.graph import FLOATING_ONLY, Node, needed, with_own_constants
from firmloop.quantize.lower.held_state import from_any_state, with_limited_parameters
from firmloop.quantize.lower.limits import with_limits
from firmloop.quantize.lower.opening import Opened, opened
from firmloop.quantize.lower.products import better_wide
from firmloop.quantize.lower.q_formats import Formats, choose_formats
from firmloop.quantize.lower.reciprocals import with_reciprocals
from firmloop.quantize.lower.sums import Sum, gather, is_linear
from firmloop.quantize.lower.sweep_formats import Planned, fixed_sweeps, float_sweeps
from firmloop.quantize.lower.tree_formats import fixed_tree, float_tree
from firmloop.quantize.lower.words import ROUNDINGS
from firmloop.quantize.not_a_number import guarded
from firmloop.quantize.program import Assign, Program, QuantizeError, Rounding, StatusBit, Table, Value
from firmloop.quantize.rows import in_rows

PLAN, PLAN_DATA, MODEL = "plan", "plan_data", "plan_model"  # a program's solution, its constants and its model
ARITHMETICS = ("float32", "float64", "fixed32", "fixed16")


def lower(law: Law, arithmetic: str, rounds: str = "nearest") -> Program:
    """Give the law's arithmetic the format `arithmetic`: "float32", "float64", "fixed32" or "fixed16".

    `rounds` is what fixed point does with the places that it drops, one of ROUNDINGS; a float rounds to nearest.

    Raises
    ------
    QuantizeError
        when a value has no finite range (fixed point), or a range or coefficient does not fit.
    """
    if arithmetic not in ARITHMETICS:
        raise QuantizeError(f"arithmetic {arithmetic!r} is unknown; known: {', '.join(ARITHMETICS)}")
    floating = arithmetic.startswith("float")
    if not floating:
        return _bare(law, arithmetic, rounds)
    return in_rows(guarded(_bare(law, arithmetic, rounds), law.safe))


def _bare(law: Law, arithmetic: str, rounds: str) -> Program:
    """Lower the law as it is: what a value that is not a number does is left to its operations."""
    floating = arithmetic.startswith("float")
    if law.solve is not None and law.solve.method is None and not floating:
        raise QuantizeError(
            f"{law.name} solves a program in every step, which has no fixed-point form: use "
            'arithmetic.number = "float32"'
            + (' or controller.solver = "fixed_iterations"' if isinstance(law.solve.problem, Quadratic) else "")
        )
    found = opened(law, floating)
    curved = sorted({node.function for node in found.graph.nodes if node.function in FLOATING_ONLY})
    if curved and not floating:
        raise QuantizeError(
            f'{law.name} computes {", ".join(curved)}, which has no fixed-point form: use arithmetic.number = "float32"'
        )
    if floating:
        found = replace(found, graph=in_one_branch(with_limits(found.graph)))
        order, states = len(found.graph.nodes), len(found.law.state)
        none = Formats((0,) * order, (0,) * len(law.inputs), (0,) * states)
        program = _Lowering(found, {}, arithmetic, none, FloatBuilder(int(arithmetic[5:]))).program()
        return with_limited_parameters(program)
    for node in found.graph.nodes:
        if not math.isfinite(node.value):
            raise QuantizeError(
                "a number of the law is beyond all numbers; a range or a key of the controller is too small or too "
                "large: correct it"
            )
    found = replace(found, graph=with_own_constants(with_reciprocals(found.graph)))
    sums = gather(found.graph)
    formats = choose_formats(found.law, found.graph, sums, int(arithmetic[5:]))
    wide: frozenset[str] = frozenset()
    while True:  # until no more inputs are widened than were said to be
        builder = FixedBuilder(int(arithmetic[5:]), ROUNDINGS[rounds], wide=wide)
        program = _Lowering(found, sums, arithmetic, formats, builder).program()
        asked = better_wide(program.body, builder.short)
        if asked <= wide:
            return replace(from_any_state(program), rounds=rounds)
        wide |= asked


class _Lowering:
    """One walk over one law; the builder decides operations, the walk decides order and names."""

    def __init__(
        self,
        found: Opened,
        sums: Mapping[int, Sum],
        arithmetic: str,
        formats: Formats,
        builder: FixedBuilder | FloatBuilder,
    ) -> None:
        self.found, self.law, self.graph = found, found.law, found.graph
        self.sums, self.arithmetic = sums, arithmetic
        self.formats, self.builder = formats, builder
        self.ops: Builder = builder.ops
        self.tables: tuple[Table, ...] = ()

    def program(self) -> Program:
        law, formats = self.law, self.formats
        next_row, output_row, flag_row = self.graph.results[:3]
        inputs = tuple(self._value(s, q) for s, q in zip(law.inputs, formats.inputs, strict=True))
        outputs = tuple(self._value(s, formats.nodes[n]) for s, n in zip(law.outputs, output_row, strict=True))
        state = tuple(self._state(s, q) for s, q in zip(law.state, formats.state, strict=True))
        read = [self.builder.read(v) for v in inputs]
        held = [Term(f"self.{v.name}", v.number, v.low, v.high, 0.0) for v in state]
        nodes = self._walk([held, read, self._fresh(held)], self._grids(outputs))
        next_state: list[Assign] = []
        for v, n in zip(state, next_row, strict=True):
            stored = self._store(nodes[n], v, f"{v.name}_next")
            if stored.name in {f"self.{a.target}" for a in next_state}:  # it will have been written by then
                self.ops.wish = (f"{v.name}_next", v.unit)
                stored = self.ops.emit("copy", (stored,), stored.number, stored.error)
            next_state.append(Assign(v.name, stored.name))
        results = [self._store(nodes[n], v, v.name) for v, n in zip(outputs, output_row, strict=True)]
        status = self._status([nodes[n] for n in flag_row])
        return Program(
            name=law.name,
            says=law.says,
            period=law.period,
            arithmetic=self.arithmetic,
            inputs=inputs,
            outputs=outputs,
            state=state,
            start=tuple(
                self.builder.unset if k == self.found.unset else self.builder.literal(x, v.number)
                for k, (x, v) in enumerate(zip(law.start, state, strict=True))
            ),
            unset=state[self.found.unset].name if self.found.unset is not None else None,
            tunable=law.tunable,
            body=self.ops.used([a.source for a in next_state] + [t.name for t in results] + [b.source for b in status]),
            next_state=tuple(next_state),
            results=tuple(Assign(v.name, t.name) for v, t in zip(outputs, results, strict=True)),
            status=status,
            rounding=tuple(Rounding(v.name, t.error, v.unit) for v, t in zip(outputs, results, strict=True)),
            tables=self.tables,
            routines=self._routines(),
        )

    def _value(self, signal: Signal, q: int) -> Value:
        number = self.builder.signal(signal.low, signal.high, q)
        low, high = self.builder.limits(signal.low, signal.high, number)
        if low >= high:
            raise QuantizeError(
                f"signals.{signal.name} from {signal.low:g} to {signal.high:g} {signal.unit} holds no two numbers of "
                f"this format ({number.bits} bits, Q{number.fraction}); "
                "give it in a smaller unit or lower the gains beside it"
            )
        return Value(signal.name, signal.unit, number, low, high)

    def _state(self, signal: Signal, q: int) -> Value:
        number = replace(self.builder.signal(signal.low, signal.high, q), fraction=q)
        if number.kind == "fixed":
            number = replace(number, bits=32)
        if signal.name in self.law.tunable:  # who sets it to the declared end, rounded, is within
            low, high = self.builder.literal(signal.low, number), self.builder.literal(signal.high, number)
        else:
            low, high = self.builder.held(signal.low, signal.high, number)
        return Value(signal.name, signal.unit, number, low, high)

    def _fresh(self, held: Sequence[Term]) -> list[Term]:
        """Return the truth value that asks whether this is the first sample; none where nobody asks."""
        if not any(node.place == (2, 0) for node in self.graph.nodes if node.function == "argument"):
            return []
        return [self.builder.fresh([held[k] for k in self.found.probes], self.found.asks)]

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
        computed = needed(self.graph, 3)  # a name alone is no reason to compute a value
        nodes: list[Operand] = []
        for k, node in enumerate(self.graph.nodes):
            self.ops.wish = names.get(k, ("", ""))
            try:
                nodes.append(self._found(k, node, nodes, arguments, grids, k in computed))
            except QuantizeError as error:
                raise QuantizeError(f"for {self._fed(k)}: {error}") from error
            self.ops.wish = ("", "")
        return nodes

    def _found(
        self,
        k: int,
        node: Node,
        nodes: list[Operand],
        arguments: list[list[Term]],
        grids: Mapping[int, int],
        computed: bool,
    ) -> Operand:
        """Return node `k` from those before it."""
        if node.function == "constant":
            return Constant(node.value, grids.get(k))
        if node.function == "argument":
            return arguments[node.place[0]][node.place[1]]
        turned = self._turned(k, nodes) if k in self.sums else None
        if turned is not None:
            return turned
        if k in self.sums:
            parts = [(weight, _term(nodes[a])) for a, weight in self.sums[k].terms.items()]
            return self.builder.total(parts, self.sums[k].constant, self.formats.nodes[k])
        if not computed or (self.sums and is_linear(self.graph, k)):
            return Constant(0.0)  # multiplied out, or nobody asks for it
        return self._node(node, [self._operand(nodes, a) for a in node.arguments], self.formats.nodes[k])

    def _turned(self, k: int, nodes: list[Operand]) -> Operand | None:
        """Return a sum of two values, each times a sine or cosine, as one sum of products; None where it is another."""
        total, products = self.sums[k], []
        for a, weight in total.terms.items():
            node = self.graph.nodes[a]
            wave = next((b for b in node.arguments if self.graph.nodes[b].function in ("sin", "cos")), None)
            if node.function != "mul" or wave is None:
                return None
            other = next((b for b in node.arguments if b != wave), wave)
            products.append((float(weight), _term(nodes[wave]), _term(self._operand(nodes, other))))
        if len(products) != 2 or total.constant or isinstance(self.builder, FloatBuilder):
            return None
        return rotated(self.builder, products, self.formats.nodes[k])

    def _fed(self, k: int) -> str:
        """Name the outputs and state variables that a node is computed for, in this step or a later one."""
        fed, before = {k}, 0
        held = {node.place: place for place, node in enumerate(self.graph.nodes) if node.function == "argument"}
        while len(fed) > before:
            before = len(fed)
            fed |= {later for later, node in enumerate(self.graph.nodes) if fed.intersection(node.arguments)}
            fed |= {held[0, j] for j, node in enumerate(self.graph.results[0]) if node in fed and (0, j) in held}
        rows = zip((*self.graph.results[1], *self.graph.results[0]), (*self.law.outputs, *self.law.state), strict=True)
        return ", ".join(signal.name for node, signal in rows if node in fed) or self.law.name

    def _operand(self, nodes: list[Operand], k: int) -> Operand:
        """Return a node as an operation other than a sum takes it: in the format of what it meets."""
        found = nodes[k]
        if self.graph.nodes[k].function == "argument" and isinstance(found, Term):
            return self.builder.widened(found, self.formats.nodes[k] if self.graph.nodes[k].place[0] < 2 else 0)
        return found

    def _node(self, node: Node, operands: list[Operand], q: int) -> Operand:
        function = node.function
        match function, operands:
            case "solve", parameters:
                return self._plan(parameters, q)
            case "improve", parameters:
                return self._course(parameters)
            case "move", [plan]:
                return self.builder.part(function, plan, q, node.place[1])
            case (("capped" | "infeasible"), [plan]):
                return self.builder.part(function, plan, 0)
            case (("none" | "lost"), [a]):
                assert isinstance(self.builder, FloatBuilder), "seen in floating point only"
                return self.builder.gone(function, a)
            case (("and" | "or"), [a, b]):
                return self.builder.truth(function, a, b)
            case "if", [condition, a]:
                return self.builder.choose(condition, a, Constant(0.0), q)
            case (("clamp" | "outside" | "beyond"), [a, low, high]):
                assert isinstance(self.builder, FloatBuilder), "seen in floating point only"
                return self.builder.limit(function, a, low, high)
            case "choose", [condition, a, b]:
                return self.builder.choose(condition, a, b, q)
            case _, [a]:
                return self.builder.unary(function, a, q)
            case _, [a, b]:
                return self.builder.binary(function, a, b, q)
        raise AssertionError(function)

    def _plan(self, parameters: list[Operand], q: int) -> Term:
        """Solve the quadratic program, the moves at fraction `q`."""
        assert self.law.solve is not None
        self.ops.wish = (PLAN, "")
        problem, method = self.law.solve.quadratic, self.law.solve.method
        terms = [_term(parameter) for parameter in parameters]
        if method is None:
            budget, checked = budget_of(self.law, problem, self.arithmetic)
            table = table_of(problem, self.arithmetic, PLAN_DATA, problem.budget or budget, checked)
            planned = Planned("solve", table, -math.inf, math.inf, math.inf)
        elif isinstance(self.builder, FloatBuilder):
            if isinstance(method, Tree):
                planned = float_tree(method, self.arithmetic, PLAN_DATA)
            else:
                planned = float_sweeps(method, terms, self.arithmetic, PLAN_DATA)
        elif isinstance(method, Tree):
            planned = fixed_tree(method, problem, terms, q, PLAN_DATA)
        else:
            planned = fixed_sweeps(method, terms, q, PLAN_DATA)
        self.tables = (planned.table,)
        read = Term(f"table.{PLAN_DATA}", self.builder.inner(q), planned.low, planned.high, 0.0)
        return self.ops.emit(planned.function, (read, *terms), read.number, planned.error)

    def _course(self, parameters: list[Operand]) -> Operand:
        """Take a step in the nonlinear program."""
        assert self.law.solve is not None and isinstance(self.law.solve.problem, Horizon)
        assert isinstance(self.builder, FloatBuilder), "a nonlinear program has no fixed-point form"
        self.ops.wish = (PLAN, "")
        self.tables = (course_table(self.law.solve.problem, self.arithmetic, PLAN_DATA, len(parameters)),)
        return self.builder.course(PLAN_DATA, MODEL, parameters)

    def _routines(self) -> tuple[Program, ...]:
        if self.law.solve is None or not isinstance(self.law.solve.problem, Horizon):
            return ()
        return (replace(_bare(self.law.solve.problem.model, self.arithmetic, "nearest"), name=MODEL),)

    def _names(self) -> Mapping[int, tuple[str, str]]:
        """Names for nodes, the law's own intermediates first, then flags and outputs."""
        names: dict[int, tuple[str, str]] = {}
        rows = (
            (3, [(s.name, s.unit) for s in self.law.last.named]),
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
        try:
            return self.builder.store(node, value.number, low, high, (name, value.unit))  # type: ignore[arg-type]
        except QuantizeError as error:
            raise QuantizeError(f"for {value.name}: {error}") from error

    def _status(self, flags: list[Operand]) -> tuple[StatusBit, ...]:
        return tuple(
            StatusBit(flag.name, flag.says, k, node.name)
            for k, (flag, node) in enumerate(zip(self.law.flags, flags, strict=True))
            if isinstance(node, Term)
        )


def _term(operand: Operand) -> Term:
    assert isinstance(operand, Term), "a sum is of values; what is constant in it has been added up"
    return operand
