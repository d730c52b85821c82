"""The house keeps its rules: imports point one way, nothing goes in circles, one noun has one name."""

from __future__ import annotations

import ast
import gc
import re
from collections.abc import Iterable, Iterator, Mapping
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest

from tests.floors import FLOORS, MAY_IMPORT, ROOMS

ROOT = Path(__file__).parents[1]
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
FOLDERS = sorted({path.parent for path in SOURCES})
TEMPLATES = sorted((ROOT / "templates_c").rglob("*.j2"))
OURS = sorted(
    path
    for folder in (*FLOORS, "tests", "templates_c", "bench", "examples", "docs")
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".c", ".h", ".j2") and not _linked(path)
)


def _id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(_text(path))


@cache
def _nodes(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(_tree(path)))


@cache
def _imported(path: Path) -> frozenset[str]:
    """Return the modules that a file imports, and what it takes from them as if those were modules, too."""
    found = set()
    for node in _nodes(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{_id(path)}: imports use the names of the tree"
            found |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(found)


@cache
def _names(path: Path) -> frozenset[str]:
    """Return the names and attributes that a file uses."""
    attributes = {node.attr for node in _nodes(path) if isinstance(node, ast.Attribute)}
    return frozenset(attributes | {node.id for node in _nodes(path) if isinstance(node, ast.Name)})


@pytest.fixture(autouse=True, scope="module")
def _kept_trees() -> Iterator[None]:
    """Keep the trees of all files while these tests run: a million nodes, which no collector need look through."""
    gc.disable()
    yield
    _tree.cache_clear()
    _nodes.cache_clear()
    gc.enable()


def test_every_floor_is_there() -> None:
    assert len(SOURCES) > 40
    assert TEMPLATES
    for package in FLOORS:
        assert (ROOT / package / "__init__.py").is_file()


def _said(faults: Iterable[tuple[Path, str]]) -> list[str]:
    """Return what is wrong, file by file, as an assertion shows it."""
    return [f"{_id(path)} {fault}" for path, fault in faults]


def _imports_to_the_right() -> Iterator[tuple[Path, str]]:
    for path in SOURCES:
        package = path.relative_to(ROOT).parts[0]
        for name in _imported(path):
            first, _, rest = name.partition(".")
            if first in FLOORS and first != "firmloop":
                yield path, f"imports {name}, which is not under the one name firmloop"
            top = rest.split(".")[0] if rest.split(".")[0] in FLOORS else "firmloop"
            if first == "firmloop" and top != package and top not in MAY_IMPORT[package]:
                yield path, f"imports {name}, to its right"


def test_imports_point_to_the_left() -> None:
    assert not _said(_imports_to_the_right())


def test_only_a_link_touches_a_port() -> None:
    others = [path for path in SOURCES if not path.is_relative_to(ROOT / "verify" / "links")]
    assert not [_id(path) for path in others if {name.split(".")[0] for name in _imported(path)} & {"serial", "socket"}]


def test_only_the_console_writes_to_the_terminal() -> None:
    for path in SOURCES:
        if path != ROOT / "firmloop" / "console.py":
            assert "print" not in _names(path), f"{_id(path)} prints"
            assert not re.search(r"sys\.(?:stdout|stderr)\.write|stdout\.buffer", _text(path)), _id(path)


def test_only_commands_ask_for_arguments() -> None:
    for path in SOURCES:
        if path not in (ROOT / "firmloop" / "cli.py", ROOT / "firmloop" / "__main__.py"):
            assert "argv" not in _names(path), f"{_id(path)} reads the command line"
            asks = path.is_relative_to(COMMANDS) or path == ROOT / "firmloop" / "arguments.py"
            assert asks or "argparse" not in _imported(path), f"{_id(path)} asks for arguments"


def _late_imports() -> Iterator[tuple[Path, str]]:
    for path in SOURCES:
        if path in LATE or path.is_relative_to(COMMANDS):
            continue
        tree = _tree(path)
        for node in _nodes(path):
            if isinstance(node, ast.Import | ast.ImportFrom) and node not in tree.body:
                names = [alias.name for alias in node.names]
                if isinstance(node, ast.ImportFrom):
                    scipy = node.module == "scipy"
                    names = [f"scipy.{name}" for name in names] if scipy else [node.module or ""]
                slow = all(any(name == heavy or name.startswith(f"{heavy}.") for heavy in HEAVY) for name in names)
                typed = isinstance(_holder(tree, node), ast.If)  # if TYPE_CHECKING: only a type checker reads it
                if not slow and not typed:
                    yield path, f"line {node.lineno} imports {names} late; only {sorted(HEAVY)} may be"


def test_imports_stand_at_the_top() -> None:
    assert not _said(_late_imports())


def _holder(tree: ast.Module, node: ast.AST) -> ast.AST | None:
    """Return the `if TYPE_CHECKING` at the top of a file that holds `node`, if one does."""
    for part in tree.body:
        if isinstance(part, ast.If) and node in part.body and ast.unparse(part.test) == "TYPE_CHECKING":
            return part
    return None


def test_a_file_says_what_it_is() -> None:
    """The first line of its docstring is a sentence."""
    said = {path: ast.get_docstring(_tree(path)) or "" for path in OURS if path.suffix == ".py"}
    assert not [_id(path) for path, text in said.items() if not text.split("\n")[0].endswith((".", ":"))]


def test_a_file_is_short() -> None:
    lines = {_id(path): len(_text(path).splitlines()) for path in OURS}
    assert not {path: count for path, count in lines.items() if count > LONGEST_FILE}


def test_templates_only_print() -> None:
    """The view has decided what a template would have to ask for."""
    asking = ("{%-", "-%}", "kind ==", "{% set", "{% macro")
    assert not _said((path, f"holds {word}") for path in TEMPLATES for word in asking if word in _text(path))


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
        named = {each for each in _imported(path) if each in modules}
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


def test_no_circle_among_what_stands_in_one_folder() -> None:
    for folder in FOLDERS:
        arrows: dict[str, set[str]] = {}
        for path, imported in _arrows().items():
            if path.is_relative_to(folder):
                here = path.relative_to(folder).parts[0]
                there = {other.relative_to(folder).parts[0] for other in imported if other.is_relative_to(folder)}
                arrows.setdefault(here, set()).update(there - {here})
        assert not _circles(arrows), _id(folder)


def test_a_checker_imports_nothing_of_what_it_judges() -> None:
    folder = ROOT / "verify" / "proofs"
    rooms = {path for room in ("judges", "machine", "forever") for path in (folder / room).glob("*.py")}
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
        said = {str(node.value) for node in _nodes(path) if isinstance(node, ast.Constant)} & names
        assert len(said) < 2, f"{_id(path)} lists the effects {sorted(said)}: let each effect's file say it"


def test_a_folder_is_small() -> None:
    files = [path for path in SOURCES if path.name != "__init__.py"]
    sizes = {_id(folder): len([path for path in files if path.parent == folder]) for folder in FOLDERS}
    assert not {folder: size for folder, size in sizes.items() if size > LARGEST_FOLDER}


def test_every_test_file_is_collected(request: pytest.FixtureRequest) -> None:
    """Of two of one name pytest takes the first, and it goes into no folder that it is told to leave out."""
    files = list((ROOT / "tests").rglob("test_*.py"))
    assert len({path.name for path in files}) == len(files)
    left_out = request.config.getini("norecursedirs")
    parts = {part for path in files for part in path.relative_to(ROOT).parts}
    assert not [part for part in parts for pattern in left_out if fnmatch(part, pattern)]


def _numbers_that_decide() -> Iterator[tuple[Path, str]]:
    for path in SOURCES:
        if path == POLICY or not path.is_relative_to(ROOT / "diagnose"):
            continue
        for node in _tree(path).body:
            if isinstance(node, ast.Assign | ast.AnnAssign) and not isinstance(node.value, ast.Dict):
                names = re.findall(r"\w+", " ".join(map(ast.unparse, getattr(node, "targets", ()) or (node.target,))))
                numbers = [each for each in ast.walk(node) if isinstance(each, ast.Constant) and _is_number(each.value)]
                if numbers and any(name.isupper() for name in names):
                    yield path, f"line {node.lineno} belongs in policy.py"


def test_a_number_that_decides_in_a_diagnosis_stands_in_its_policy() -> None:
    assert not _said(_numbers_that_decide())


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def test_every_number_of_the_policy_is_used() -> None:
    names = {node.targets[0].id for node in _tree(POLICY).body if isinstance(node, ast.Assign)}
    used = {node.id for path in SOURCES for node in _nodes(path) if _reads(node)}
    assert not names - used


def _reads(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)


def test_no_drawer_for_odds_and_ends() -> None:
    names = {path.stem for path in SOURCES} | {path.parent.name for path in SOURCES}
    assert not names & {"utils", "util", "core", "common", "helpers", "misc", "base", "shared", "tools", "stuff"}
