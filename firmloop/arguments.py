"""What several commands ask for, and how the words of a command line become values."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from firmloop.project import extent

STEPS, SEED = extent.STEPS, extent.SEED
MOST_VALUE = 1e300  # of a parameter; its range is narrower


def project_and_place(parser: argparse.ArgumentParser, place_shown: str) -> None:
    """Ask for the project and for where the results go."""
    parser.add_argument("project", type=Path, metavar="PROJECT", help="the project's TOML file")
    parser.add_argument("--out", type=place, required=True, metavar=place_shown, help="where the results go")


def campaign(parser: argparse.ArgumentParser) -> None:
    """Ask where to verify, and how much."""
    parser.add_argument(
        "--target", action="append", metavar="NAME", help="instead of the project's targets; may be repeated"
    )
    parser.add_argument("--port", metavar="URL", help="where the board is: /dev/ttyACM0, COM3, socket://host:port")
    parser.add_argument("--steps", type=steps, default=STEPS, metavar="N", help=f"steps per target (default {STEPS})")
    parser.add_argument(
        "--seed", type=seed, default=SEED, metavar="N", help=f"seed of the noise stimuli (default {SEED})"
    )


def fmu(parser: argparse.ArgumentParser, does: str) -> None:
    """Ask for an FMU, and for what it calls our signals."""
    parser.add_argument(
        "--fmu",
        type=Path,
        metavar="FILE.fmu",
        help=f"{does}; it is a program, and runs with your rights",
    )
    parser.add_argument(
        "--wire",
        type=wire,
        action="append",
        default=[],
        metavar="SIGNAL=VARIABLE",
        help="what the FMU calls a signal, where it has another name; may be repeated",
    )


def watched(parser: argparse.ArgumentParser) -> None:
    """Ask where a controller runs, and what of it to watch."""
    parser.add_argument(
        "--target", required=True, metavar="NAME", help="the board or emulated core, as `firmloop targets` calls it"
    )
    parser.add_argument("--port", metavar="URL", help="where the board is: /dev/ttyACM0, COM3, socket://host:port")
    parser.add_argument(
        "--live", type=Path, metavar="FILE.c", help="instead of a port: run it on the emulated core, on this file"
    )
    parser.add_argument(
        "--signals", default="", metavar="A,B", help="inputs, outputs, parameters, status (default inputs, outputs)"
    )
    parser.add_argument("--every", type=steps, default=1, metavar="N", help="only every Nth step (default 1)")


def names(text: str) -> tuple[str, ...]:
    """Read a list of names with commas between them."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def seconds(text: str) -> float:
    """Read how long to watch, s."""
    return number(text, 0.001, 1e6)


def place(text: str) -> Path:
    """Read a path that is to be written."""
    try:
        named = text.strip() and b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        named = False
    if not named:
        raise argparse.ArgumentTypeError("names no place")
    return Path(text)


def steps(text: str) -> int:
    """Read a number of steps."""
    return whole(text, extent.FEWEST_STEPS, extent.MOST_STEPS)


def seed(text: str) -> int:
    """Read the seed of a random generator."""
    return whole(text, 0, extent.LAST_SEED)


def wire(text: str) -> tuple[str, str]:
    """Read SIGNAL=VARIABLE."""
    signal, _, variable = text.partition("=")
    if not signal.strip() or not variable.strip():
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not like speed_rad_s=motor.w")
    return signal.strip(), variable.strip()


def setting(text: str) -> tuple[str, float, float]:
    """Read NAME=VALUE[@SECONDS]."""
    name, equals, rest = text.partition("=")
    value, at, seconds = rest.partition("@")
    if not name.strip() or not equals or (at and not seconds):
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not like kp=1.2 or kp=1.2@5.0")
    return name.strip(), number(value, -MOST_VALUE, MOST_VALUE), number(seconds, 0.0, 1e6) if at else 0.0


def number(text: str, low: float, high: float) -> float:
    """Read a number from `low` to `high`."""
    try:
        value = float(text)
    except ValueError:
        value = low - 1.0
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not a number from {low:g} to {high:g}")
    return value


def whole(text: str, low: int, high: int) -> int:
    """Read a whole number from `low` to `high`."""
    try:
        return extent.whole(text, low, high)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
