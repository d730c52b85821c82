"""Explain a difference: which operation of the C first departs from the reference, with the values it read."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.host import trace_files
from firmloop.codegen.view import physical, statement
from firmloop.identify.simulation.compiler import ToolError, shared_library
from firmloop.quantize.ops import EVERY
from firmloop.quantize.program import Op, Program
from firmloop.verify.packing import records
from firmloop.verify.reference import Machine, Raw, element_type, set_parameter, start_state, working_type

TRACE_FLAGS = ("-std=c99", "-O1", "-ffp-contract=off", "-w")


def explain(program: Program, bundle: Bundle, lane: Raw, step: int, output: str, settings: Raw | None = None) -> str:
    """Return one sentence about the first operation that differs while `lane` (steps, m) runs up to `step`.

    `settings` (steps, k) is what the parameters were asked to be meanwhile.

    The C is built once more for the host with every value kept. Where its values are all right there, the fault
    is not in the text: compiler, flags or core are left.
    """
    try:
        files, places = trace_files(bundle)
        library = ctypes.CDLL(str(shared_library(files, (f"{bundle.name}.c", "trace.c"), TRACE_FLAGS)))
    except (ToolError, OSError):
        return f"{_writer(program, output)}: could not be traced on the host"
    return _walk(program, library, places, lane[: step + 1], settings) or (
        f"{_writer(program, output)}: every operation of the same C is right on the host, "
        "so the target's compiler, its flags or the core make the difference"
    )


def _walk(
    program: Program, library: ctypes.CDLL, places: dict[str, int] | Any, lane: Raw, settings: Raw | None
) -> str | None:
    machine = Machine(program)
    values = (ctypes.c_double * max(1, len(places))).in_dll(library, "fl_trace")
    memory = ctypes.create_string_buffer(4096 + 8 * len(program.state))
    out = ctypes.create_string_buffer(64 * max(1, len(program.outputs)))
    library.trace_init(memory)
    problem = _state_problem(program, memory, start_state(program, 1), "init()")
    if problem:
        return problem
    state = start_state(program, 1)
    kind = working_type(program)
    with np.errstate(all="ignore"):
        for k, row in enumerate(lane):
            asked = None if settings is None else settings[k : k + 1]
            library.trace_step(memory, records(program, row[None, :], asked), out)
            if asked is not None:
                first = len(state) - len(program.tunable)
                for j, parameter in enumerate(program.parameters):
                    state[first + j] = set_parameter(parameter, state[first + j], asked[:, j].astype(kind))
            slots = machine.step([np.array([x]).astype(kind) for x in row], state)
            named = machine.named(slots)
            for op in program.body:
                if EVERY[op.function].record:  # its parts are told one by one
                    continue
                place = places.get(op.result.name)
                if place is None:
                    return f"step {k}: the operation {statement(op, program)} is missing from the C"
                expected = float(np.asarray(named[op.result.name]).ravel()[0])
                if not _same(expected, values[place]):
                    return _sentence(program, op, k, expected, values[place], named)
                if program.safe and op.result.name == program.status[-1].source and expected:
                    break  # the step has ended there
            state = [np.broadcast_to(np.asarray(slots[s]), 1) for s in machine.next]
            problem = _state_problem(program, memory, state, f"step {k}") or _output_problem(
                program, out, [slots[s] for s in machine.results], k
            )
            if problem:
                return problem
    return None


def _sentence(program: Program, op: Op, step: int, expected: float, got: float, named: Any) -> str:
    reads = [a for a in op.arguments if isinstance(a, str)]
    values = ", ".join(f"{a} = {float(np.asarray(named[a]).ravel()[0]):.9g}" for a in reads)
    number = op.result.number
    unit = f" ({physical(expected, number):.9g} {op.result.unit})" if op.result.unit else ""
    return f"step {step}: {statement(op, program)} should be {expected:.9g}{unit}, is {got:.9g}; {values}"


def _state_problem(program: Program, memory: Any, state: list[Raw], when: str) -> str | None:
    offset = 0
    for value, expected in zip(program.state, state, strict=True):
        kind = element_type(value.number)
        got = np.frombuffer(memory, dtype=kind, count=1, offset=offset)[0]
        offset += kind.itemsize
        if not _same(float(expected[0]), float(got)):
            return f"{when}: state {value.name} should be {float(expected[0]):.9g}, is {float(got):.9g}"
    return None


def _output_problem(program: Program, out: Any, results: list[Raw], step: int) -> str | None:
    offset = 0
    for value, assign, result in zip(program.outputs, program.results, results, strict=True):
        kind = element_type(value.number)
        got = np.frombuffer(out, dtype=kind, count=1, offset=offset)[0]
        offset += kind.itemsize
        expected = float(np.asarray(result).ravel()[0])
        if not _same(expected, float(got)):
            return (
                f"step {step}: out->{value.name} = {assign.source} should store {expected:.9g}, stores {float(got):.9g}"
            )
    return None


def _same(a: float, b: float) -> bool:
    return a == b or (a != a and b != b)


def _writer(program: Program, output: str) -> str:
    sources = {a.target: a.source for a in program.results}
    for op in program.body:
        if op.result.name == sources.get(output):
            return statement(op, program)
    return output
