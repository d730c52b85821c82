"""The house keeps its rules: imports point left, one printer, one reader of argv, ports in one folder."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# From the data's first stop to its last; a package may import from those on its left, and those listed for it.
FLOORS = ("identify", "design", "quantize", "codegen", "verify", "diagnose", "firmloop")
MAY_IMPORT = {
    "identify": (),
    "design": ("identify",),
    "quantize": ("identify", "design"),
    "codegen": ("quantize", "identify"),  # not design: C is printed from a Program, which knows no law
    "verify": ("identify", "design", "quantize", "codegen"),
    "diagnose": ("identify", "verify"),
    "firmloop": ("identify", "design", "quantize", "codegen", "verify", "diagnose"),
}
LONGEST_FILE = 400
# Libraries that take a tenth of a second or more, or 40 MB, and that most commands do without: imported where used.
HEAVY = {
    "scipy.signal",
    "scipy.optimize",
    "matplotlib",
    "casadi",
    "pandas",
    "numba",
    "z3",
    "h5py",
    "control",
    "nfoursid",
}
LATE = {  # files whose imports of our own code stand inside a function, with the reason
    ROOT / "firmloop" / "cli.py": "a command imports what it needs when it is called, so that help answers at once",
    ROOT / "quantize" / "twins" / "qp.py": "only a search waits half a second for the compiler of its loops",
}


def _linked(path: Path) -> bool:
    """Tell whether a path leads through one of the links in firmloop/ to a folder at the top."""
    return any(parent.is_symlink() for parent in path.parents)


SOURCES = sorted(path for package in FLOORS for path in (ROOT / package).rglob("*.py") if not _linked(path))
TEMPLATES = sorted((ROOT / "templates_c").rglob("*.j2"))
OURS = sorted(
    path
    for folder in (*FLOORS, "tests", "templates_c", "bench", "examples", "docs")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".c", ".h", ".j2") and not _linked(path)
)


def _id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports use the names of the tree"
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_every_floor_is_there() -> None:
    assert len(SOURCES) > 40
    assert TEMPLATES
    for package in FLOORS:
        assert (ROOT / package / "__init__.py").is_file()


@pytest.mark.parametrize("path", SOURCES, ids=_id)
def test_source(path: Path) -> None:
    tree = _tree(path)
    package = path.relative_to(ROOT).parts[0]
    imported = set(_imported(tree))
    for name in imported:
        first, _, rest = name.partition(".")
        assert first not in FLOORS or first == "firmloop", f"imports {name}, which is not under the one name firmloop"
        if first == "firmloop":
            top = rest.split(".")[0] if rest.split(".")[0] in FLOORS else "firmloop"
            assert top == package or top in MAY_IMPORT[package], f"imports {name}, to its right"
    if not path.is_relative_to(ROOT / "verify" / "links"):
        assert not {name.split(".")[0] for name in imported} & {"serial", "socket"}, "touches a port"
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    attributes = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    if path != ROOT / "firmloop" / "console.py":
        assert "print" not in names, "prints"
        written = re.findall(r"sys\.(?:stdout|stderr)\.write|stdout\.buffer", path.read_text(encoding="utf-8"))
        assert not written, "writes to the terminal"
    if path not in (ROOT / "firmloop" / "cli.py", ROOT / "firmloop" / "__main__.py"):
        assert "argv" not in attributes | names and "argparse" not in imported, "reads the command line"


@pytest.mark.parametrize("path", SOURCES, ids=_id)
def test_imports_stand_at_the_top(path: Path) -> None:
    if path in LATE:
        pytest.skip(LATE[path])
    tree = _tree(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and node not in tree.body:
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
            if isinstance(node, ast.ImportFrom) and node.module == "scipy":
                names = [f"scipy.{alias.name}" for alias in node.names]
            slow = all(any(name == heavy or name.startswith(f"{heavy}.") for heavy in HEAVY) for name in names)
            typed = isinstance(_holder(tree, node), ast.If)  # if TYPE_CHECKING: only a type checker reads it
            assert slow or typed, f"line {node.lineno} imports {names} late; only {sorted(HEAVY)} may be"


def _holder(tree: ast.Module, node: ast.AST) -> ast.AST | None:
    """Return the `if TYPE_CHECKING` at the top of a file that holds `node`, if one does."""
    for part in tree.body:
        if isinstance(part, ast.If) and node in part.body and ast.unparse(part.test) == "TYPE_CHECKING":
            return part
    return None


@pytest.mark.parametrize("path", [path for path in OURS if path.suffix == ".py"], ids=_id)
def test_a_file_says_what_it_is(path: Path) -> None:
    said = ast.get_docstring(_tree(path))
    assert said and said.split("\n")[0].endswith((".", ":")), "the first line of the docstring is a sentence"


@pytest.mark.parametrize("path", OURS, ids=_id)
def test_a_file_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE


@pytest.mark.parametrize("path", TEMPLATES, ids=_id)
def test_templates_only_print(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for word in ("{%-", "-%}", "kind ==", "{% set", "{% macro"):
        assert word not in text, f"holds {word}: the view should have decided that"


def test_no_drawer_for_odds_and_ends() -> None:
    names = {path.stem for path in SOURCES} | {path.parent.name for path in SOURCES}
    assert not names & {"utils", "util", "core", "common", "helpers", "misc"}
