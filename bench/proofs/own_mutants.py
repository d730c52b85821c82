"""Change our own Python in one place and see whether a fast test fails: `python -m bench.proofs.own_mutants`.

Mutants are drawn over the packages' functions: an operator, a comparison, a number, a truth value, a condition or a
statement is another one, or gone. Each is run in a process of its own by the tests that call its function, the quickest
first; no file is changed, the loader hands out the changed code (a tree whose packages are links to folders beside them
cannot be copied or changed in place, as the usual tools do, without changing what all other processes see). The tests
that call a function are found once, by a profile of each test, and kept in `--map FILE`.

Prints the survivors, and the share killed by package; the exit status is 1 where a share is below BAR.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import importlib.machinery
import json
import os
import random
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("quantize", "codegen", "verify")
TESTS = ("tests/quantize", "tests/codegen", "tests/verify")
HEAVY = ("numpy", "scipy.signal", "scipy.stats", "scipy.optimize", "casadi", "hypothesis", "jinja2")  # shared by forks
BAR = 0.95
FAST = "not slow and not qemu and not cross"
QUICK = 4.0  # s of a test; slower ones are not asked
MOST_TESTS = 40  # of one mutant
LONGEST = 90.0  # s of all of them; one that never ends is killed
SWAPPED: Mapping[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Add, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.Mod: ast.Add,
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And,
    ast.USub: ast.UAdd,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change: the file, the line of its outermost function, and which change of that file it is."""

    file: str
    function: int
    line: int
    index: int
    says: str


def changes(tree: ast.Module) -> Iterator[tuple[ast.AST, str, int]]:
    """Yield every node that can be changed, what is done to it, and the first line of its outermost function."""
    for top in tree.body:
        inner = top.body if isinstance(top, ast.ClassDef) else [top]
        for function in inner:
            if isinstance(function, ast.FunctionDef):
                first = min([function.lineno, *(one.lineno for one in function.decorator_list)])
                for statement in function.body:
                    yield from ((node, says, first) for node, says in _inside(statement))


def _inside(node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    """Yield what can be changed in a statement, itself included; messages, annotations and docstrings cannot."""
    if isinstance(node, ast.Raise | ast.Assert | ast.JoinedStr):
        return
    if isinstance(node, ast.BinOp | ast.BoolOp | ast.UnaryOp) and type(node.op) in SWAPPED:
        yield node, f"{type(node.op).__name__} is {SWAPPED[type(node.op)].__name__}"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield node, "not is left out"
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPPED:
        yield node, f"{type(node.ops[0]).__name__} is {SWAPPED[type(node.ops[0])].__name__}"
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
        yield node, f"{node.value!r} is another number"
    elif isinstance(node, ast.If | ast.IfExp):
        yield node, "the condition never holds"
    elif isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
        yield node, "the statement is left out"
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _inside(child)


def changed(tree: ast.Module, index: int) -> ast.Module:
    """Return the module with change number `index` made."""
    made = copy.deepcopy(tree)
    node, _, _ = list(changes(made))[index]
    match node:
        case ast.UnaryOp(op=ast.Not()):
            node.op = ast.UAdd()
            node.operand = ast.Call(ast.Name("bool", ast.Load()), [node.operand], [])
        case ast.BinOp() | ast.BoolOp() | ast.UnaryOp():
            node.op = SWAPPED[type(node.op)]()  # type: ignore[assignment]
        case ast.Compare():
            node.ops = [SWAPPED[type(node.ops[0])](), *node.ops[1:]]  # type: ignore[list-item]
        case ast.Constant(value=bool()):
            node.value = not node.value
        case ast.Constant():
            node.value = node.value + 1 if isinstance(node.value, int) else 1.25 * node.value + 0.5  # type: ignore
        case ast.If() | ast.IfExp():
            node.test = ast.Constant(False)
        case _:
            _left_out(made, node)
    return ast.fix_missing_locations(made)


def _left_out(tree: ast.Module, gone: ast.AST) -> None:
    for parent in ast.walk(tree):
        for _, value in ast.iter_fields(parent):
            if isinstance(value, list) and any(child is gone for child in value):
                value[:] = [ast.Pass() if child is gone else child for child in value]
                return


class Profile:
    """Notes which functions of the packages each test calls, and how long it takes."""

    def __init__(self) -> None:
        self.calls: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self._known: dict[CodeType, str | None] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Profile one test."""
        seen = self.calls[item.nodeid]

        def note(frame: FrameType, event: str, argument: object) -> None:
            if event == "call" and (place := self._place(frame.f_code)) is not None:
                seen.add(place)

        begin = time.process_time()
        sys.setprofile(note)
        try:
            return (yield)
        finally:
            sys.setprofile(None)
            self.seconds[item.nodeid] = time.process_time() - begin

    def _place(self, code: CodeType) -> str | None:
        if code not in self._known:
            path = os.path.realpath(code.co_filename)
            inside = any(path.startswith(f"{ROOT / name}{os.sep}") for name in PACKAGES)
            self._known[code] = f"{os.path.relpath(path, ROOT)}:{code.co_firstlineno}" if inside else None
        return self._known[code]


def mapped(file: Path) -> dict[str, list[str]]:
    """Return the tests of every function, the quickest first; read from `file` where it is there."""
    if not file.exists():
        profile = Profile()
        pytest.main(["-q", "-p", "no:cacheprovider", "--no-header", "-m", FAST, *TESTS], plugins=[profile])
        found: dict[str, list[str]] = defaultdict(list)
        for test in sorted(profile.seconds, key=lambda name: profile.seconds[name]):
            if profile.seconds[test] <= QUICK:
                for place in profile.calls[test]:
                    found[place].append(test)
        file.write_text(json.dumps(found))
    return dict(json.loads(file.read_text()))


def drawn(package: str, count: int, dice: random.Random) -> list[Mutant]:
    """Draw so many mutants of a package."""
    every = []
    for path in sorted((ROOT / package).rglob("*.py")):
        name, tree = str(path.relative_to(ROOT)), ast.parse(path.read_text())
        for index, (node, says, first) in enumerate(changes(tree)):
            every.append(Mutant(name, first, node.lineno, index, says))  # type: ignore[attr-defined]
    return dice.sample(every, min(count, len(every)))


def started(mutant: Mutant, tests: Sequence[str]) -> int:
    """Run tests against a mutant in a process of its own; return its id."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(nothing, descriptor)
        _plant(mutant)
        status = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:faulthandler", *tests]))
    finally:
        os._exit(status)


def _plant(mutant: Mutant) -> None:
    """Let the loader hand out the changed code."""
    target = os.path.realpath(ROOT / mutant.file)
    code = compile(changed(ast.parse(Path(target).read_text()), mutant.index), target, "exec")
    usual = importlib.machinery.SourceFileLoader.get_code

    def get_code(self: importlib.machinery.SourceFileLoader, name: str) -> CodeType | None:
        return code if os.path.realpath(self.path) == target else usual(self, name)

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[method-assign, assignment]


def survivors(mutants: Sequence[Mutant], tests: Mapping[str, list[str]], jobs: int) -> Iterator[tuple[Mutant, bool]]:
    """Yield every mutant and whether a test has killed it, as they end; one that no test calls survives."""
    waiting, running = list(mutants), dict[int, tuple[Mutant, float]]()
    while waiting or running:
        while waiting and len(running) < jobs:
            mutant = waiting.pop()
            asked = tests.get(f"{mutant.file}:{mutant.function}", [])[:MOST_TESTS]
            if asked:
                running[started(mutant, asked)] = mutant, time.monotonic()
            else:
                yield mutant, False
        for child, (mutant, begin) in list(running.items()):
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                del running[child]
                yield mutant, os.waitstatus_to_exitcode(status) != 0
            elif time.monotonic() - begin > LONGEST:
                os.kill(child, signal.SIGKILL)
        time.sleep(0.02)


def main() -> int:
    """Draw and run them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("packages", nargs="*", default=list(PACKAGES), metavar="PACKAGE")
    parser.add_argument("--count", type=int, default=200, help="in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--map", type=Path, default=ROOT / ".own_mutants.json")
    arguments = parser.parse_args()
    if not arguments.map.exists():
        child = os.fork()  # so that nothing of firmloop is loaded here
        if not child:
            mapped(arguments.map)
            os._exit(0)
        os.waitpid(child, 0)
    tests = mapped(arguments.map)
    for name in HEAVY:
        importlib.import_module(name)
    dice, low = random.Random(arguments.seed), False
    for package in arguments.packages:
        mutants = drawn(package, arguments.count // len(arguments.packages), dice)
        killed = reached = 0
        for mutant, dead in survivors(mutants, tests, arguments.jobs):
            killed += dead
            reached += f"{mutant.file}:{mutant.function}" in tests
            if not dead:
                why = "" if f"{mutant.file}:{mutant.function}" in tests else " (no fast test calls it)"
                print(f"survives: {mutant.file}:{mutant.line}: {mutant.says}{why}", flush=True)
        share = killed / max(1, len(mutants))
        low |= share < BAR
        print(
            f"{package}: {killed} of {len(mutants)} killed, {share:.1%}; {reached} in reach of a fast test", flush=True
        )
    return int(low)


if __name__ == "__main__":
    sys.exit(main())
