"""Skip with a sentence what this machine cannot run."""

import contextlib
import fcntl
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

from firmloop.arithmetic import settle
from firmloop.codegen.target import Target, load_target, target_names

settle()  # as the command line does, before anything loads numpy

RECORDINGS = Path(os.environ.get("FIRMLOOP_RECORDINGS", Path(__file__).parent.parent.parent / "shared" / "recordings"))
Once = Callable[[str, Callable[[Path], object]], Path]  # see the fixture `once`

# The same examples in every run, and no limit of time: what fails here fails everywhere.
settings.register_profile("firmloop", deadline=None, derandomize=True)
settings.load_profile("firmloop")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regold", action="store_true", help="write tests/golden anew; then read the difference")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    cross = "" if shutil.which("arm-none-eabi-gcc") else "arm-none-eabi-gcc is not installed"
    qemu = cross or ("" if shutil.which("qemu-system-arm") else "qemu-system-arm is not installed")
    recordings = "" if RECORDINGS.is_dir() else f"no bench recordings at {RECORDINGS.name}; set FIRMLOOP_RECORDINGS"
    slow = "" if "slow" in (config.option.markexpr or "") else "slow; run with -m slow"
    targets = {name: _missing_of(load_target(name)) for name in target_names()}
    for item in items:
        named = item.callspec.params.values() if isinstance(item, pytest.Function) and hasattr(item, "callspec") else ()
        for tool in {targets[each] for each in named if isinstance(each, str) and targets.get(each)}:
            item.add_marker(pytest.mark.skip(reason=f"{tool} is not installed"))
    for mark, reason in (("cross", cross), ("qemu", qemu), ("recordings", recordings), ("slow", slow)):
        for item in items:
            if reason and item.get_closest_marker(mark):  # keywords would hold the names of folders, too
                item.add_marker(pytest.mark.skip(reason=reason))


def _missing_of(target: Target) -> str:
    """The first program that this machine lacks of those that a target's image is built and run with."""
    tools = (target.compiler, *((target.qemu.program,) if target.qemu is not None else ()))
    return next((tool for tool in tools if shutil.which(tool) is None), "")


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """Return the folder of a name, filled by the first test of this run that asks, in whichever process that is.

    Tests look at what is there; none changes it.
    """
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "once"
    shared.mkdir(exist_ok=True)

    def folder_of(name: str, fill: Callable[[Path], object]) -> Path:
        folder = shared / name
        with (shared / f"{name}.lock").open("a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # another process may be filling it
            if os.fstat(lock.fileno()).st_size == 0:
                shutil.rmtree(folder, ignore_errors=True)  # of one that failed
                folder.mkdir()
                fill(folder)
                lock.write("filled")
        return folder

    return folder_of


@pytest.fixture(autouse=True, scope="session")
def no_power_cut() -> None:
    """No test cuts the power, after which alone it matters that a disk was waited for, some 7 ms a file."""
    os.fsync = lambda descriptor: None


@pytest.fixture(scope="session")
def built(once: Once) -> Path:
    """Return what XDG_CACHE_HOME may name: a folder without what other runs have built, for programs of their own.

    What steps the programs of all of them is there: to compile it takes seven seconds.
    """
    return once("built", _stepping)


def _stepping(folder: Path) -> None:
    from firmloop.identify.simulation.compiler import ToolError
    from firmloop.verify.lanes.compiled import library_file  # loads numpy, which has to be settled before

    (folder / "firmloop").mkdir(mode=0o700)
    folder.chmod(0o700)
    with contextlib.suppress(ToolError):  # not the one that is loaded: it may be of a test whose folder is gone
        shutil.copy2(library_file(), folder / "firmloop")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the bench recordings; ask for it together with the mark `recordings`."""
    return RECORDINGS
