"""The house keeps its rules: imports point one way, nothing goes in circles, one noun has one name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
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
# Inside a package, low to high: what stands beside one another imports nothing of its own floor's other rooms.
ROOMS: dict[str, tuple[tuple[str, ...], ...]] = {
    "identify": (
        ("error", "extras", "normal", "regular_file", "signal"),
        ("printed_units",),
        ("units",),
        ("plants",),
        ("recordings",),
        ("simulation",),
        ("fitting",),
        ("bench_tests",),
    ),
    "design": (
        ("law", "outcome", "draft"),
        ("table", "roles", "optimum"),
        ("design", "safe_output"),
        ("tunable", "discretize", "quadratic"),
        ("linear",),
        ("models",),
        ("tuning",),
        ("kinds",),
        ("analysis",),
    ),
    "quantize": (
        ("shifts",),
        ("program",),
        ("twins", "not_a_number"),
        ("formats",),
        ("ops",),
        ("free_state",),
        ("lower", "proof"),
    ),
    "verify": (
        ("lanes",),
        ("reference", "link", "judgement"),
        ("packing", "scaling", "block"),
        ("compare",),
        ("verdict",),
        ("stimuli", "links"),
        ("build",),
        ("proofs",),
        ("explain", "replay", "searches"),
        ("trial",),
        ("run",),
    ),
    "codegen": (
        ("bundle", "toolchain"),
        ("environment", "misra", "names", "toml_table", "view"),
        ("delivery", "emit", "host", "target"),
        ("firmware", "fmu", "packages"),
    ),
    "diagnose": (
        ("policy", "finding"),
        ("data",),
        ("model",),
        ("search",),
        ("discrepancy", "controller"),
        ("completion", "sentences"),
        ("verdict",),
        ("run",),
    ),
    "firmloop": (
        ("console", "project", "version"),
        ("output", "stages"),
        ("presentation", "scope"),
        ("door",),
        ("told", "arguments"),
        ("commands",),
        ("cli",),
        ("__main__",),
    ),
}
# What a checker of a proof may import: each other, and nothing of what made the proof or the C that it judges.
CHECKERS = (
    *("claims", "reading", "judge", "c_checker", "c_tokens", "stated_c"),
    *("interval_checker", "table_checker", "z3_checker"),
)
POLICY = ROOT / "diagnose" / "policy.py"
EFFECTS = ROOT / "identify" / "plants" / "effects"
LONGEST_FILE = 400
LARGEST_FOLDER = 20
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
    "pyvex",
    "bitwuzla",
}
COMMANDS = ROOT / "firmloop" / "commands"
LATE = {  # files whose imports of our own code stand inside a function, with the reason
    ROOT / "firmloop" / "cli.py": "a command imports what it needs when it is called, so that help answers at once",
    ROOT / "quantize" / "twins" / "qp.py": "only a search waits half a second for the compiler of its loops",
    ROOT / "verify" / "proofs" / "judges" / "bit_vectors.py": "only fixed point waits for z3",
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
        assert "argv" not in attributes | names, "reads the command line"
        asks = path.is_relative_to(COMMANDS) or path == ROOT / "firmloop" / "arguments.py"
        assert asks or "argparse" not in imported, "asks for arguments"


@pytest.mark.parametrize("path", SOURCES, ids=_id)
def test_imports_stand_at_the_top(path: Path) -> None:
    if path in LATE or path.is_relative_to(COMMANDS):
        pytest.skip(LATE.get(path, LATE[ROOT / "firmloop" / "cli.py"]))
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


def _modules() -> dict[str, Path]:
    """Return every module of ours by the name it is imported by."""
    found = {}
    for path in SOURCES:
        parts = path.relative_to(ROOT).with_suffix("").parts
        parts = parts if parts[0] == "firmloop" else ("firmloop", *parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def _arrows() -> dict[Path, frozenset[Path]]:
    """Return which files each file imports."""
    modules = _modules()
    found = {}
    for name, path in modules.items():
        named = {each for each in _imported(_tree(path)) if each in modules}
        named -= {each for each in named if modules[each].name == "__init__.py" and _only_parent(each, named)}
        found[path] = frozenset(modules[each] for each in named if each != name)
    return found


def _only_parent(name: str, named: set[str]) -> bool:
    """Tell whether a package is named only because one of its modules is taken from it."""
    return any(each.startswith(f"{name}.") for each in named)


def _circles(arrows: Mapping[str, set[str]]) -> list[set[str]]:
    """Return the groups in which each reaches each other one."""
    reach = {name: set(to) for name, to in arrows.items()}
    while True:
        wider = {name: to.union(*(reach.get(each, set()) for each in to)) for name, to in reach.items()}
        if wider == reach:
            break
        reach = wider
    groups = [{other for other in to if name in reach.get(other, set())} for name, to in reach.items() if name in to]
    return [group for k, group in enumerate(groups) if group not in groups[:k]]


def _room(package: str, path: Path) -> str:
    """Return the room of a package, or the file on its ground, that a file belongs to."""
    return path.relative_to(ROOT / package).parts[0].removesuffix(".py")


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_every_room_has_a_floor(package: str) -> None:
    rooms = {_room(package, path) for path in SOURCES if path.relative_to(ROOT).parts[0] == package} - {"__init__"}
    listed = [room for floor in ROOMS[package] for room in floor]
    assert sorted(listed) == sorted(rooms)


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_no_arrow_points_back_up_inside_a_package(package: str) -> None:
    level = {room: k for k, floor in enumerate(ROOMS[package]) for room in floor} | {"__init__": len(ROOMS[package])}
    back = []
    for path, imported in _arrows().items():
        for other in imported:
            if {p.relative_to(ROOT).parts[0] for p in (path, other)} != {package}:
                continue
            here, there = _room(package, path), _room(package, other)
            if here != there and level[there] >= level[here]:
                back.append(f"{_id(path)} -> {_id(other)}")
    assert not back


def test_no_files_import_each_other_in_a_circle() -> None:
    arrows = {_id(path): {_id(other) for other in imported} for path, imported in _arrows().items()}
    assert not _circles(arrows)


@pytest.mark.parametrize("folder", sorted({path.parent for path in SOURCES}), ids=_id)
def test_no_circle_among_what_stands_in_one_folder(folder: Path) -> None:
    arrows: dict[str, set[str]] = {}
    for path, imported in _arrows().items():
        if path.is_relative_to(folder):
            here = path.relative_to(folder).parts[0]
            there = {other.relative_to(folder).parts[0] for other in imported if other.is_relative_to(folder)}
            arrows.setdefault(here, set()).update(there - {here})
    assert not _circles(arrows)


def test_a_checker_imports_nothing_of_what_it_judges() -> None:
    folder = ROOT / "verify" / "proofs"
    rooms = {path for room in ("judges", "machine") for path in (folder / room).glob("*.py")}
    judges = {folder / f"{name}.py" for name in CHECKERS} | rooms
    allowed = judges | {folder / "__init__.py", ROOT / "verify" / "judgement.py"}
    for path in judges:
        wrong = _arrows()[path] - allowed
        assert not wrong, f"{_id(path)} imports {sorted(map(_id, wrong))}"


def test_one_noun_has_one_name() -> None:
    found: dict[str, list[str]] = {}
    for path in SOURCES:
        for node in _tree(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(_id(path))
    repeated = {name: places for name, places in found.items() if len(places) > 1}
    assert not repeated, f"two nouns have one name: {repeated}"


def test_effects_are_named_in_their_own_files_alone() -> None:
    names = {path.stem for path in EFFECTS.rglob("*.py")} - {"__init__"}
    for path in SOURCES:
        if path.is_relative_to(EFFECTS):
            continue
        said = {str(node.value) for node in ast.walk(_tree(path)) if isinstance(node, ast.Constant)} & names
        assert len(said) < 2, f"{_id(path)} lists the effects {sorted(said)}: let each effect's file say it"


@pytest.mark.parametrize("folder", sorted({path.parent for path in SOURCES}), ids=_id)
def test_a_folder_is_small(folder: Path) -> None:
    assert len([path for path in folder.glob("*.py") if path.name != "__init__.py"]) <= LARGEST_FOLDER


@pytest.mark.parametrize("path", [path for path in SOURCES if path.is_relative_to(ROOT / "diagnose")], ids=_id)
def test_a_number_that_decides_in_a_diagnosis_stands_in_its_policy(path: Path) -> None:
    if path == POLICY:
        pytest.skip("that is the policy")
    for node in _tree(path).body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and not isinstance(node.value, ast.Dict):
            names = re.findall(r"\w+", " ".join(map(ast.unparse, getattr(node, "targets", ()) or (node.target,))))
            numbers = [each for each in ast.walk(node) if isinstance(each, ast.Constant) and _is_number(each.value)]
            assert not (numbers and any(name.isupper() for name in names)), f"line {node.lineno} belongs in policy.py"


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def test_every_number_of_the_policy_is_used() -> None:
    names = {node.targets[0].id for node in _tree(POLICY).body if isinstance(node, ast.Assign)}
    used = {node.id for path in SOURCES for node in ast.walk(_tree(path)) if _reads(node)}
    assert not names - used


def _reads(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)


def test_no_drawer_for_odds_and_ends() -> None:
    names = {path.stem for path in SOURCES} | {path.parent.name for path in SOURCES}
    assert not names & {"utils", "util", "core", "common", "helpers", "misc", "base", "shared", "tools", "stuff"}
