"""Make throw-away environments, install into them with pip, and ask what they hold."""

from __future__ import annotations

import os
import subprocess
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

import pip

OURS = sysconfig.get_path("purelib")  # where the libraries stand that these tests run with
# What `pip --python` starts in turn: to start it at once saves the time that pip itself takes to load.
PIP = str(Path(pip.__file__).with_name("__pip-runner__.py"))
DEPENDENCIES = "dependencies-of-the-tests.pth"


def run(command: list[str], folder: Path) -> str:
    """Return what a command prints; what it says on its way to a failure is the message of the assertion."""
    # Neither the environment that runs the tests nor a user's own packages may lend what is missing.
    rest = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    done = subprocess.run(
        command, cwd=folder, env=rest | {"PYTHONNOUSERSITE": "1"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
    return done.stdout


@dataclass(frozen=True, slots=True)
class Environment:
    """A virtual environment without pip: the one that runs the tests installs into it."""

    folder: Path
    wheels: Path  # all that may be installed; nothing is fetched

    @property
    def python(self) -> str:
        """Return its interpreter."""
        return str(self.folder / "bin" / "python")

    @property
    def packages(self) -> Path:
        """Return its site-packages."""
        return next((self.folder / "lib").glob("python*/site-packages"))

    def names(self) -> set[str]:
        """Return what stands in site-packages."""
        return {path.name for path in self.packages.iterdir()}

    def pip(self, *arguments: str) -> None:
        """Run pip on this environment, from the wheels alone."""
        run([self.python, PIP, "--disable-pip-version-check", "-q", *arguments], self.folder)

    def install(self, *what: str) -> None:
        """Install with all that is needed at run time, or a firmloop without it: see `lend`."""
        self.pip("install", "--no-compile", "--no-index", "--find-links", str(self.wheels), *what)

    def ask(self, *arguments: str, folder: Path | None = None) -> str:
        """Return what its Python prints, started in a folder."""
        return run([self.python, *arguments], folder or self.folder)

    def lend(self) -> None:
        """Let it import numpy and the like from the environment of the tests; pip must not see these."""
        (self.packages / DEPENDENCIES).write_text(OURS + "\n")

    def take_back(self) -> None:
        """End `lend`."""
        (self.packages / DEPENDENCIES).unlink()


def make_environment(folder: Path, wheels: Path) -> Environment:
    """Make an environment that holds nothing."""
    venv.create(folder, symlinks=True, with_pip=False)
    return Environment(folder, wheels)
