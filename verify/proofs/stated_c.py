"""Say the C that a proof.json stands for, statement by statement, to hold it against a C file.

Nothing of the generator is used: this file knows the shape of the generated C by itself. Comments and layout are left
out, for `c_tokens.py` takes them out of both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from firmloop.verify.proofs.claims import Argument, ClaimedOperation, Claims, Held, ProofError

Statement = tuple[str, str]  # what it is, in words, and its C
TRUTHS = ("and", "or", "not")
WHOLE = ("move", "row")  # their literal arguments are whole in any arithmetic
INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|"}
COMPARED = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
CURVED = {
    "turn": ("fl_turn_i32", 1),
    "turn_sine": ("fl_turn_sine_i32", 0),
    "turn_cosine": ("fl_turn_cosine_i32", 0),
    "whole_root": ("fl_whole_root_i32", 1),
    "inverse": ("fl_inverse_i32", 2),
}
CALLS = {  # function: C name, and how many counts its arguments end with
    "mul_shift": ("fl_mul_shift_i32", 1),
    "mul_add": ("fl_mul_add_i32", 0),
    "mul_add_short": ("fl_mul_add_short_i32", 0),
    "wide": ("fl_wide_i64", 0),
    "mac": ("fl_mac_i64", 0),
    "high": ("fl_high_i32", 1),
    "mul_down": ("fl_mul_down_i32", 1),
    "high_down": ("fl_down_i32", 1),
    "asr": ("fl_asr_i32", 1),
    "wrap": ("fl_wrap_i32", 1),
    "shr": ("fl_shr_i32", 1),
    "shl": ("fl_shl_i32", 1),
    **CURVED,
}
TYPED = (
    *("min", "max", "clamp", "abs", "outside", "beyond", "none", "nought", "lost"),
    *("sin", "cos", "exp", "tanh", "sqrt"),
)
FURTHER = {
    "sqrt": "fl_root.h",
    **dict.fromkeys(CURVED, "fl_curved_i32.h"),
}  # headers of functions that few programs need
PLANNED = {"solve": "fl_qp", "sweeps": "fl_sweeps", "tree": "fl_tree", "rows": "fl_rows"}


def c_type(value: Held) -> str:
    """Return the C type of a value."""
    if value.kind == "float":
        return "float" if value.bits == 32 else "double"
    return f"int{value.bits}_t"


class Writer:
    """Writes the C of one program's claims."""

    def __init__(self, claims: Claims) -> None:
        self.claims = claims
        self.end = "i32" if claims.fixed else f"f{claims.arithmetic[5:]}"
        self.real = "int32_t" if claims.fixed else ("float" if claims.arithmetic == "float32" else "double")
        operations = [*claims.operations, *(op for routine in claims.routines for op in routine.operations)]
        own = sorted({FURTHER[op.function] for op in operations if op.function in FURTHER})
        self.supports = ["fl_fixed.h" if claims.fixed else "fl_float.h", *own]

    def literal(self, value: int | float | None) -> str:
        """Return a constant of this arithmetic; None is no number."""
        if value is None:
            return f"fl_unset_{self.end}()"
        text = repr(int(value) if self.claims.fixed else float(value)) + ("F" if self.end == "f32" else "")
        if self.claims.fixed and value == -(2**31):
            return "(-2147483647 - 1)"
        return f"({text})" if text.startswith("-") else text

    def source(self) -> Iterator[Statement]:
        """Give every statement of the .c file, in its order."""
        claims = self.claims
        name = claims.name
        yield "the includes", f'#include "{name}.h"\n' + "".join(f'#include "{support}"\n' for support in self.supports)
        for table in claims.tables:
            yield from self._table(table)
        for routine in claims.routines:
            place = {f"in.{one}": f"both[{k}]" for k, one in enumerate(routine.inputs)}
            inner = partial(_inner, place)
            yield f"routine {routine.name}", f"static void {routine.name}(const fl_real *both, fl_real *found) {{"
            for op in routine.operations:
                yield f"operation {op.says()} of {routine.name}", self.statement(op, inner)
            for k, source in enumerate(routine.results):
                yield f"result {k} of {routine.name}", f"found[{k}] = {inner(source)};"
            yield f"the end of {routine.name}", "}"
        size = sum(v.bits // 8 for v in claims.state) or 4
        yield "the size of the state", f"typedef char {name}_assert_layout[(sizeof({name}_t) == {size}U) ? 1 : -1];"
        yield "the head of init", f"void {name}_init({name}_t *self) {{"
        for value, first in zip(claims.state, claims.start, strict=True):
            yield f"the start of {value.name}, {first}", f"self->{value.name} = {self.literal(first)};"
        yield "the end of init", ("" if claims.state else "self->unused = 0;") + "}"
        for value in self._parameters():
            macro = f"{name}_{value.name}".upper()
            yield (
                f"the setter of {value.name}",
                f"bool {name}_set_{value.name}({name}_t *self, {c_type(value)} {value.name}) {{ bool inside = false; "
                f"if (({value.name} >= {macro}_LOW) && ({value.name} <= {macro}_HIGH)) "
                f"{{ self->{value.name} = {value.name}; inside = true; }} return inside; }}",
            )
        yield "the head of step", f"uint32_t {name}_step({name}_t *self, const {name}_in_t *in, {name}_out_t *out) {{"
        for op in claims.operations:
            yield f"operation {op.says()}", self.statement(op, _placed)
            if claims.safe and op.result.name == claims.status[-1][2]:
                yield "what an input commands that is not a number", self._safe()
        for output, source in zip(claims.outputs, claims.results, strict=True):
            cast = "(int16_t)" if c_type(output) == "int16_t" else ""
            yield f"output {output.name} = {source}", f"out->{output.name} = {cast}{_placed(source)};"
        for state, source in claims.following.items():
            if source != f"self.{state}":
                yield f"state {state} = {source}", f"self->{state} = {_placed(source)};"
        open_bits = claims.status[:-1] if claims.safe else claims.status
        bits = " | ".join(
            f"((uint32_t){source} << {bit}U)" if bit else f"(uint32_t){source}" for _, bit, source in open_bits
        )
        yield "the status", f"{'' if claims.state else '(void)self;'} return {bits or '0U'}; }}"

    def header(self) -> Iterator[Statement]:
        """Give every statement of the .h file, in its order."""
        claims = self.claims
        name, macro = claims.name, claims.name.upper()
        uses = "#include <stdbool.h>\n" if claims.parameters else ""
        yield "the includes", f"#ifndef {macro}_H\n#define {macro}_H\n{uses}#include <stdint.h>\n"
        yield "the start", '#ifdef __cplusplus\nextern "C" {\n#endif\n'
        yield f"program id {claims.program_id}", f'#define {macro}_PROGRAM_ID "{claims.program_id}"\n'
        yield f"the period {claims.period} s", f"#define {macro}_PERIOD_S {claims.period!r}\n"
        if claims.fixed:
            for value in (*claims.inputs, *claims.outputs, *self._parameters()):
                yield f"the fraction of {value.name}", f"#define {macro}_{value.name.upper()}_Q {value.fraction}\n"
        for parameter, low, high, begins in claims.parameters:
            for macro_end, end in (("DEFAULT", begins), ("LOW", low), ("HIGH", high)):
                says = f"{macro_end.lower()} of parameter {parameter}, {end}"
                yield says, f"#define {macro}_{parameter.upper()}_{macro_end} {self.literal(end)}\n"
        masks = ", ".join(f"{macro}_{bit.upper()} = {1 << place}" for bit, place, _ in claims.status)
        yield "the status bits", f"enum {{ {masks} }};"
        for what, suffix, values in (
            ("inputs", "_in_t", claims.inputs),
            ("outputs", "_out_t", claims.outputs),
            ("state", "_t", claims.state),
        ):
            members = " ".join(f"{c_type(v)} {v.name};" for v in values)
            if what == "state" and not values:
                members = "int32_t unused;"
            yield f"the {what}", f"typedef struct {{ {members} }} {name}{suffix};"
        yield "the declarations", f"void {name}_init({name}_t *self);"
        yield "the declarations", f"uint32_t {name}_step({name}_t *self, const {name}_in_t *in, {name}_out_t *out);"
        for value in self._parameters():
            yield "the declarations", f"bool {name}_set_{value.name}({name}_t *self, {c_type(value)} {value.name});"
        yield "the end", "#ifdef __cplusplus\n}\n#endif\n#endif\n"

    def statement(self, op: ClaimedOperation, placed: Callable[[str], str]) -> str:
        """Return the line of one operation."""
        return f"const {self._result(op)} {op.result.name} = {self._expression(op, placed)};"

    def _safe(self) -> str:
        bit, _, test = self.claims.status[-1]
        outputs = zip(self.claims.outputs, self.claims.safe, strict=True)
        stores = " ".join(f"out->{output.name} = {self.literal(safe)};" for output, safe in outputs)
        return f"if ({test} != 0) {{ {stores} return (uint32_t){self.claims.name.upper()}_{bit.upper()}; }}"

    def _result(self, op: ClaimedOperation) -> str:
        if op.function == "rows":
            return "fl_sums_t"
        return "fl_plan_t" if op.function in (*PLANNED, "improve") else c_type(op.result)

    def _expression(self, op: ClaimedOperation, placed: Callable[[str], str]) -> str:
        function = op.function
        whole = function in (*TRUTHS, *WHOLE)

        def said(argument: Argument) -> str:
            if isinstance(argument, str):
                return placed(argument)
            if whole:
                return f"({argument})"
            return self.literal(argument)

        a = [said(argument) for argument in op.arguments]
        try:
            if function in INFIX:
                return f"{a[0]} {INFIX[function]} {a[1]}"
            if function in COMPARED:
                return f"({a[0]} {COMPARED[function]} {a[1]}) ? 1 : 0"
            if function in CALLS:
                call, counts = CALLS[function]
                plain = len(a) - counts
                return f"{call}({', '.join([*a[:plain], *(f'{count}U' for count in op.arguments[plain:])])})"
            if function in TYPED:
                return self._called(function, a)
            if function in PLANNED:
                end = "_i32" if self.claims.fixed else ""
                return f"{PLANNED[function]}{end}(&{a[0]}, (const {self._element()}[]){{ {', '.join(a[1:])} }})"
            match function:
                case "improve":
                    return f"fl_rti(&{a[0]}, {a[1]}, (const {self._element()}[]){{ {', '.join(a[2:])} }})"
                case "none_where":
                    return f"({a[0]} != 0) ? {self._called('none', a[1:])} : 0"
                case "copy" | "neg":
                    return a[0] if function == "copy" else f"-{a[0]}"
                case "capped" | "infeasible":
                    return f"({a[0]}.status == FL_QP_{function.upper()}) ? 1 : 0"
                case "not":
                    return f"(1) - {a[0]}"
                case "select":
                    return f"({a[0]} != 0) ? {a[1]} : {a[2]}"
                case "move" | "row":
                    return f"{a[0]}.{function}[{op.arguments[1]}]"
        except IndexError:
            raise ProofError(f"{op.says()}: {function} takes more arguments") from None
        raise ProofError(f"{op.says()}: operation {function!r} is not known to the checker")

    def _called(self, function: str, arguments: Sequence[str]) -> str:
        return f"fl_{function}_{self.end}({', '.join(arguments)})"

    def _element(self) -> str:
        return "int32_t" if self.claims.fixed else "fl_real"

    def _parameters(self) -> list[Held]:
        return list(self.claims.state[len(self.claims.state) - len(self.claims.parameters) :])

    def _table(self, table: Mapping[str, Any]) -> Iterator[Statement]:
        name = table["name"]
        sizes = ", ".join(f"{key} = {size}" for key, size in table["sizes"].items())
        yield f"the sizes of {name}", f"enum {{ {sizes} }};"
        yield f"the type of {name}", f'typedef {self.real} fl_real;\n#include "{table["support"]}"\n'
        yield f"the head of {name}", f"static const {table['form']} {name} = {{"
        for key, values in table["numbers"].items():
            numbers = values if isinstance(values, list) else [values]
            text = ", ".join(f"({x})" if isinstance(x, int) and x != -(2**31) else self.literal(x) for x in numbers)
            yield f"{key} of {name}", f".{key} = {f'{{ {text} }}' if isinstance(values, list) else text},"
        yield f"the end of {name}", "};"


def _inner(place: Mapping[str, str], name: str) -> str:
    """Return a value inside a routine, which has arrays in place of structures."""
    return place.get(name, name)


def _placed(name: str) -> str:
    place, dot, member = name.partition(".")
    return {"in": "in->", "self": "self->", "table": "", "routine": ""}[place] + member if dot else name
