"""Fetch the peers from the Python package index, each into an environment that is thrown away afterwards."""

from __future__ import annotations

import atexit
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from bench.mpc.peers.image import PeerError

PATIENCE = 1800  # seconds for a package and what it needs


@cache
def _workshop() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="peers-")
    atexit.register(folder.cleanup)
    return Path(folder.name)


@cache
def interpreter_with(package: str) -> Path:
    """Return the Python of a fresh environment that has `package`, with the version given."""
    place = _workshop() / package.partition("==")[0]
    _call([sys.executable, "-m", "venv", str(place)], package)
    python = place / "bin" / "python"
    _call([str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", package], package)
    return python


@cache
def source_of(package: str) -> Path:
    """Return the source archive of `package`."""
    name = package.partition("==")[0]
    place = _workshop() / f"{name}-source"
    _call(
        [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--no-binary", name, "-d", str(place), package],
        package,
    )
    return next(place.glob("*.tar.gz"))


def emit(package: str, script: Path, arguments: list[str]) -> None:
    """Run `script` where `package` is installed; what it cannot do becomes a row's sentence."""
    _call([str(interpreter_with(package)), str(script), *arguments], package)


def _call(command: list[str], package: str) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired as late:
        raise PeerError(f"{package} was not there after {PATIENCE} s") from late
    if done.returncode:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:]
        raise PeerError(f"{package} cannot be had here: {last[0] if last else 'no reason given'}")
