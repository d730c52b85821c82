"""Install firmloop and what it depends on into a fresh environment and print what that takes on disk, by package.

    python -m bench.host.installed_size [EXTRA ...]

Aim: at most 700 MB for the base. Compiled modules of Python (__pycache__) count, pip itself does not.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from importlib.metadata import Distribution, distributions
from pathlib import Path

ROOT = Path(__file__).parents[2]
AIM = 700.0  # MB
SHOWN = 5.0  # MB; smaller packages are one line together


def measure(extras: list[str], folder: Path) -> dict[str, float]:
    """Install into the folder and return the size of each package, MB."""
    venv.create(folder, symlinks=True, with_pip=False)
    wanted = f"{ROOT}[{','.join(extras)}]" if extras else str(ROOT)
    call = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "install", "-q", wanted]
    subprocess.run(call, check=True)
    packages = next((folder / "lib").glob("python*/site-packages"))
    return {found.metadata["Name"]: _size(found) for found in distributions(path=[str(packages)])}


def _size(package: Distribution) -> float:
    paths = {Path(str(file.locate())) for file in package.files or ()}
    return sum(path.stat().st_size for path in paths if path.is_file()) / 1e6


def main() -> int:
    """Print the table; the exit status is 1 above the aim."""
    with tempfile.TemporaryDirectory(prefix="firmloop-size-") as folder:
        sizes = measure(sys.argv[1:], Path(folder))
    small = {name for name, size in sizes.items() if size < SHOWN}
    for name in sorted(sizes.keys() - small, key=lambda n: -sizes[n]):
        print(f"{name:20} {sizes[name]:7.1f} MB")
    print(f"{f'{len(small)} smaller ones':20} {sum(sizes[name] for name in small):7.1f} MB")
    total = sum(sizes.values())
    print(f"{'all':20} {total:7.1f} MB, aim {AIM:.0f}")
    return 1 if total > AIM else 0


if __name__ == "__main__":
    sys.exit(main())
