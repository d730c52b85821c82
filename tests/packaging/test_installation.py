"""An installation adds one import name, lives beside pre-commit, and runs in a folder of any contents."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from firmloop.cli import main
from tests.conftest import Once
from tests.firmloop.conftest import PROJECT
from tests.packaging.environments import Environment, make_environment, run

ROOT = Path(__file__).parents[2]
NAME = "firmloop-0.1.0"
INFO = f"{NAME}.dist-info"
# Who is there first, and what of firmloop comes then; what pip makes of an sdist is the wheel of the tree, see below.
ORDERS = (
    pytest.param("pre-commit", ("wheel", "editable"), id="pre-commit"),
    pytest.param("pre-commit", ("sdist",), id="pre-commit, then an sdist", marks=pytest.mark.slow),
    pytest.param("firmloop", ("editable", "wheel"), id="firmloop"),
)
PRECOMMIT = ("pre-commit", "identify")  # it stands on a package whose name is that of a folder of ours
USERS_MODULES = ("design", "verify", "identify", "numpy")  # each would end the program that imports it


@pytest.fixture(scope="session")
def wheels(once: Once) -> Path:
    """Fetch pre-commit and what builds firmloop, once; all that follows needs no network."""
    return once("wheels", _fetch)


def _fetch(folder: Path) -> None:
    wanted = ["pre-commit", "hatchling", "editables"]
    call = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "-q", "-d", str(folder), *wanted]
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"pip cannot fetch pre-commit and hatchling here: {done.stderr.strip().splitlines()[-1]}")


@pytest.fixture(scope="session")
def builder(wheels: Path, once: Once) -> Environment:
    """Return an environment that holds hatchling."""
    folder = once("builder", lambda folder: make_environment(folder, wheels).install("hatchling", "editables"))
    return Environment(folder, wheels)


@pytest.fixture(scope="session")
def archives(builder: Environment, once: Once) -> dict[str, str]:
    """Build what pip is given: a wheel and an sdist of the tree, or the tree itself."""
    out = once("dist", lambda folder: builder.ask("-m", "hatchling", "build", "-d", str(folder), folder=ROOT))
    return {"wheel": str(next(out.glob("*.whl"))), "sdist": str(next(out.glob("*.tar.gz"))), "editable": f"-e{ROOT}"}


def _precommit_works(environment: Environment, folder: Path) -> None:
    assert environment.ask("-m", "pre_commit", "--version", folder=folder).startswith("pre-commit ")
    script = environment.folder / "bin" / "pre-commit"
    assert run([str(script), "--version"], folder).startswith("pre-commit ")
    tags = "from identify import identify; print(sorted(identify.tags_from_filename('motor.py')))"
    assert "'python'" in environment.ask("-c", tags, folder=folder)


def _files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _generated(environment: Environment, folder: Path) -> dict[str, bytes]:
    """Run a verb that goes through design, quantize and codegen, in a folder of modules that would stop it."""
    environment.lend()
    for name in USERS_MODULES:
        (folder / f"{name}.py").write_text("raise SystemExit('a file of the user was imported')\n")
    shown = environment.ask("-m", "firmloop", "--version", folder=folder)
    assert shown.split()[-1] == "0.1.0"
    environment.ask("-m", "firmloop", "generate", "tank.toml", "--out", "out", folder=folder)
    files = _files(folder / "out")
    run([str(environment.folder / "bin" / "firmloop"), "targets"], folder)
    for name in USERS_MODULES:
        (folder / f"{name}.py").unlink()
    shutil.rmtree(folder / "out")
    environment.take_back()
    return files


def _lends_no_other_name_of_the_tree(environment: Environment) -> None:
    tops = sorted(path.name for path in ROOT.iterdir() if path.is_dir() and path.name.isidentifier())
    asked = f"import importlib.util as u; print([n for n in {tops} if u.find_spec(n)])"
    assert environment.ask("-c", asked).strip() == "['firmloop']"


@pytest.mark.parametrize(("first", "kinds"), ORDERS)
def test_firmloop_and_precommit_side_by_side_both_work_with_the_same_c_and_part_cleanly(
    first: str, kinds: tuple[str, ...], archives: dict[str, str], wheels: Path, tmp_path: Path
) -> None:
    environment = make_environment(tmp_path / "venv", wheels)
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "tank.toml").write_text(PROJECT)
    assert main(["generate", str(folder / "tank.toml"), "--out", str(tmp_path / "tree")]) == 0
    of_the_tree = _files(tmp_path / "tree")
    assert "tank_heater/src/tank_heater.c" in of_the_tree
    if first == "pre-commit":
        environment.install("pre-commit")
        _precommit_works(environment, folder)
    for kind in kinds:
        before = environment.names()
        environment.install("--no-deps", archives[kind])
        added = environment.names() - before
        if "pre_commit" not in environment.names():  # which brings a package called identify
            environment.install("editables")  # what an editable install stands on
            _lends_no_other_name_of_the_tree(environment)
        if first == "firmloop":
            again = ("--force-reinstall", "--no-deps") if "pre_commit" in before else ()
            environment.install(*again, *PRECOMMIT)
        if kind == "editable":
            assert INFO in added
            assert all("firmloop" in name for name in added), added
        else:
            assert added == {"firmloop", INFO}
        assert _generated(environment, folder) == of_the_tree
        _precommit_works(environment, folder)
        beside = environment.names()
        environment.pip("uninstall", "-y", "firmloop")
        # Python's own cache of modules that stand in site-packages themselves, as an editable install's does, may stay
        assert environment.names() - {"__pycache__"} == beside - added - {"__pycache__"}
        _precommit_works(environment, folder)


def _contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def test_a_wheel_from_the_sdist_holds_what_a_wheel_from_the_tree_holds(
    archives: dict[str, str], builder: Environment, tmp_path: Path
) -> None:
    with tarfile.open(archives["sdist"]) as archive:
        archive.extractall(tmp_path)  # our own; filters came with Python 3.11.4
    builder.ask("-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path), folder=tmp_path / NAME)
    from_tree, from_sdist = _contents(Path(archives["wheel"])), _contents(next(tmp_path.glob("*.whl")))
    assert sorted(from_tree) == sorted(from_sdist)
    assert from_tree == from_sdist


def test_a_wheel_holds_every_source_template_and_target_of_the_tree(archives: dict[str, str]) -> None:
    held = set(_contents(Path(archives["wheel"])))
    assert {name.split("/")[0] for name in held} == {"firmloop", INFO}
    assert "firmloop/py.typed" in held
    links = [path for path in (ROOT / "firmloop").iterdir() if path.is_symlink()]
    missing = {
        f"firmloop/{link.name}/{top.relative_to(link.resolve())}"
        for link in links
        for top in link.resolve().rglob("*")
        if top.is_file() and "__pycache__" not in top.parts
    } - held
    assert links and not missing


def test_an_sdist_holds_every_file_once(archives: dict[str, str]) -> None:
    with tarfile.open(archives["sdist"]) as archive:
        names = [member.name for member in archive.getmembers() if member.isfile()]
    assert len(names) == len(set(names))
    tops = {name.split("/")[1] for name in names}
    assert {"firmloop", "tests", "README.md", "LICENSE", "pyproject.toml"} <= tops
    assert not tops & {"identify", "design", "codegen", "verify", "out", "build"}


@pytest.mark.slow
def test_a_wheel_with_its_real_dependencies_generates_beside_precommit(
    archives: dict[str, str], wheels: Path, tmp_path: Path
) -> None:
    environment = make_environment(tmp_path / "venv", wheels)
    environment.pip("install", "pre-commit", archives["wheel"])
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "tank.toml").write_text(PROJECT)
    environment.ask("-m", "firmloop", "generate", "tank.toml", "--out", "out", folder=folder)
    _precommit_works(environment, folder)
