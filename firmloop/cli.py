"""The command line: argv in, exit status out, and never a traceback.

Exit status: 0 agrees; 1 differs; 2 the user's file or command is wrong; 3 a tool, port or board is not there.
Besides: 70 a fault of firmloop itself (FIRMLOOP_DEBUG=1 shows where), 130 stopped, 141 nobody reads any more.

What a verb needs is imported when it is called, so that help, `targets` and a typo in a project file answer at once.
"""

from __future__ import annotations

import argparse
import difflib
import os
import re
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import NoReturn

from firmloop.console import Console, JsonConsole, TextConsole, complain
from firmloop.project.table import ProjectError

WRONG_FILE, NO_TOOL, OUR_FAULT, STOPPED, NO_READER = 2, 3, 70, 130, 141
STEPS, MOST_STEPS = 100_000, 1_000_000_000
MOST_VALUE = 1e300  # of a parameter; its range is narrower
SEED = 1


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows ASCII only must not end a walk
    arguments = _parser().parse_args(argv)
    console: Console = JsonConsole() if arguments.json else TextConsole()
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _stopped)
    try:
        with warnings.catch_warnings():
            if not _debugging():
                warnings.simplefilter("ignore")
            status = _run(arguments, console)
        console.close()
        return status
    except BrokenPipeError:
        # Python flushes stdout once more when it ends; give it something to flush into.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NO_READER
    except (KeyboardInterrupt, _Stopped):
        complain("stopped; nothing was written")
        return STOPPED
    except Exception as error:
        return _failed(error, console)


def _run(arguments: argparse.Namespace, console: Console) -> int:
    """Hand the command over to its verb."""
    if arguments.verb in ("targets", "doctor"):
        from firmloop import machine

        if arguments.verb == "doctor":
            return machine.doctor(console)
        return machine.ports(console) if arguments.ports else machine.targets(console)

    if arguments.verb == "prove":
        try:
            from firmloop.prove import prove
        except ModuleNotFoundError as error:
            if error.name != "z3":
                raise
            from firmloop.identify.simulation.compiler import ToolError

            raise ToolError("z3, the second judge, is not installed; install it: pip install z3-solver") from None
        return prove(arguments.folder, console)

    from firmloop.project.project import read_project

    project = read_project(arguments.project)
    if arguments.verb in ("verify", "run"):
        from firmloop.project.project import Campaign, campaign_targets

        targets = campaign_targets(project, arguments.target or ())
        campaign = Campaign(targets, arguments.steps, arguments.seed, arguments.port)
        if arguments.verb == "verify":
            campaign = replace(campaign, baseline=arguments.baseline, growth=arguments.growth)

    if arguments.verb == "diagnose":
        from firmloop.diagnosis import diagnose_project

        return diagnose_project(project, arguments.out, console)

    if arguments.verb == "flash":
        from firmloop.flash import flash
        from firmloop.project.project import campaign_targets

        name = campaign_targets(project, (arguments.target,))[0]
        return flash(project, name, arguments.live, arguments.out, console)
    if arguments.verb == "monitor":
        from firmloop.monitor import Watch, monitor
        from firmloop.project.project import campaign_targets

        name = campaign_targets(project, (arguments.target,))[0]
        names = tuple(part.strip() for part in arguments.signals.split(",") if part.strip())
        settings = tuple(arguments.settings)
        watch = Watch(arguments.port, name, names, arguments.every, arguments.seconds, settings)
        return monitor(project, watch, arguments.out, console)

    if arguments.verb == "datasheet":
        from firmloop.datasheet import datasheet

        return datasheet(project, arguments.out, console)
    if arguments.verb == "excite":
        from firmloop.excite import excite

        return excite(project, arguments.out, console)
    if arguments.verb == "model":
        from firmloop.model import model

        return model(project, arguments.out, console)
    if arguments.verb == "step":
        from firmloop.step import step

        return step(project, arguments.out, console)
    if arguments.verb == "examine":
        from firmloop.examine import examine

        return examine(project, arguments.out, arguments.draws, arguments.seed, console)
    if arguments.verb == "tune":
        from firmloop.tuning import tune

        return tune(project, arguments.out, console)
    if arguments.verb == "generate":
        from firmloop.generate import generate

        return generate(project, arguments.out, console)

    from firmloop import verbs

    if arguments.verb == "identify":
        return verbs.identify(project, arguments.out, console)
    if arguments.verb == "simulate":
        start = verbs.as_recorded if arguments.fit_initial else verbs.at_rest
        return verbs.simulate(project, arguments.recording, arguments.out, start, console)
    if arguments.verb == "design":
        return verbs.design(project, arguments.out, console)
    if arguments.verb == "verify":
        return verbs.verify(project, campaign, arguments.out, console)
    return verbs.run(project, campaign, arguments.out, console)


def _failed(error: Exception, console: Console) -> int:
    """Say what went wrong in one message; return the exit status."""
    # Only now: a command that went well need not load every package.
    from firmloop.codegen.bundle import CodegenError
    from firmloop.design.law import DesignError
    from firmloop.identify.error import IdentifyError
    from firmloop.identify.simulation.compiler import ToolError
    from firmloop.quantize.program import QuantizeError
    from firmloop.verify.link import LinkError

    if _debugging():
        complain(traceback.format_exc())
    message = str(error).strip()
    if isinstance(error, ProjectError | IdentifyError | DesignError | QuantizeError | CodegenError):
        status = WRONG_FILE
        message = message.replace("\n", "\\n")  # of a name in it: the complaint is one line
    elif isinstance(error, ToolError | LinkError):
        status = NO_TOOL
    else:
        status = OUR_FAULT
        words = " ".join(message.split())[:200]
        message = f"internal error: {type(error).__name__}: {words}; please report it (FIRMLOOP_DEBUG=1 shows where)"
    console.fail(message)
    return status


class _Stopped(BaseException):
    """Somebody asked this process to end."""


class _Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line."""

    def error(self, message: str) -> NoReturn:
        asked, _, offered = message.partition("(choose from ")
        near = difflib.get_close_matches(asked.split("'")[-2], re.findall(r"[\w-]+", offered), n=1) if offered else []
        hint = f"; did you mean '{near[0]}'?" if near else ""
        complain(f"{message}{hint}; see: {self.prog} --help")
        raise SystemExit(WRONG_FILE)


class _Version(argparse.Action):
    """Look the version up only when somebody asks."""

    def __call__(self, parser: argparse.ArgumentParser, *unused: object) -> NoReturn:
        from importlib import metadata

        try:
            version = metadata.version("firmloop")
        except metadata.PackageNotFoundError:
            version = "from source"
        TextConsole().lines([f"firmloop {version}"])
        raise SystemExit(0)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="firmloop",
        description="From a bench recording to controller C that is proven, bit for bit, on the microcontroller.",
        epilog="exit status: 0 agrees; 1 differs; 2 your file is wrong; 3 a tool, port or board is not there",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="COMMAND")

    _verb(verbs, "identify", "fit the plant to the train recordings; DIR/project.toml holds it")
    _verb(verbs, "datasheet", "parameters from a datasheet and the standard tests, checked; DIR/project.toml")
    _verb(verbs, "excite", "an excitation signal for the bench; DIR/excitation.csv and its C table")
    _verb(verbs, "model", "fit ARX, OE or a subspace model where no physics is known; DIR/project.toml")
    _verb(verbs, "step", "measure step responses over repeated trials, and read models off them; DIR/step.json")
    examine = _verb(verbs, "examine", "intervals by three ways, residual tests, sensitivities; DIR/examination.json")
    examine.add_argument(
        "--draws", type=_draws, default=10_000, metavar="N", help="draws of the Monte Carlo intervals (default 10000)"
    )
    examine.add_argument("--seed", type=_seed, default=SEED, metavar="N", help=f"seed of the draws (default {SEED})")
    simulate = _verb(verbs, "simulate", "predict every output of a recording from its input column alone", "FILE.csv")
    simulate.add_argument("recording", type=Path, metavar="RECORDING", help="the recording whose input is taken")
    simulate.add_argument(
        "--fit-initial", action="store_true", help="fit the initial state instead of starting at rest"
    )
    _verb(verbs, "diagnose", "say where simulation and recordings differ and why; DIR/diagnosis.json, DIR/report.html")
    _verb(verbs, "design", "tune the controller; margins and step metrics")
    _verb(verbs, "tune", "tune the controller by every rule and compare the loops; DIR/tuning.csv")
    _verb(verbs, "generate", "write the controller's C and DIR/manifest.json")
    for name, says in (
        ("verify", "generate, build and run the C against the bit-exact reference; DIR/verdict.json"),
        ("run", "the whole walk: identify, design, generate, verify, report"),
    ):
        verb = _verb(verbs, name, says)
        verb.add_argument(
            "--target", action="append", metavar="NAME", help="instead of the project's targets; may be repeated"
        )
        verb.add_argument("--port", metavar="URL", help="where the board is: /dev/ttyACM0, COM3, socket://host:port")
        verb.add_argument(
            "--steps", type=_steps, default=STEPS, metavar="N", help=f"steps per target (default {STEPS})"
        )
        verb.add_argument(
            "--seed", type=_seed, default=SEED, metavar="N", help=f"seed of the noise stimuli (default {SEED})"
        )
        if name == "verify":
            verb.add_argument(
                "--baseline",
                type=Path,
                metavar="FILE",
                help="an older cost.json; status 1 if a cost has grown",
            )
            verb.add_argument(
                "--growth", type=_percent, default=2.0, metavar="PERCENT", help="that a cost may grow by (default 2)"
            )

    flash = _verb(verbs, "flash", "build the image of a board and put it there; DIR/image.elf")
    flash.add_argument("--target", required=True, metavar="NAME", help="the board, as `firmloop targets` calls it")
    flash.add_argument("--live", type=Path, metavar="FILE.c", help="run by itself on the two functions of this file")
    watch = _verb(verbs, "monitor", "watch a controller that runs by itself; FILE.csv is a recording", "FILE.csv")
    watch.add_argument("--target", required=True, metavar="NAME", help="the board, as `firmloop targets` calls it")
    watch.add_argument(
        "--port", required=True, metavar="URL", help="where it is: /dev/ttyACM0, COM3, socket://host:port"
    )
    watch.add_argument(
        "--signals", default="", metavar="A,B", help="inputs, outputs, parameters, status (default inputs, outputs)"
    )
    watch.add_argument("--every", type=_steps, default=1, metavar="N", help="only every Nth step (default 1)")
    watch.add_argument("--seconds", type=_seconds, default=10.0, metavar="S", help="how long (default 10)")
    watch.add_argument(
        "--set",
        dest="settings",
        type=_setting,
        action="append",
        default=[],
        metavar="NAME=VALUE[@S]",
        help="set a tunable parameter, S seconds after the first sample (default before it); may be repeated",
    )

    says = "prove a delivered proof.json again, and that the C beside it states what it proves"
    proving = verbs.add_parser("prove", help=says, description=says, allow_abbrev=False)
    proving.add_argument("folder", type=_place, metavar="DIR", help="the folder that `firmloop generate` wrote")
    _json(proving)

    for name, says in (
        ("targets", "what can be built for"),
        ("doctor", "what this machine has and lacks, with the install command"),
    ):
        verb = verbs.add_parser(name, help=says, description=says, allow_abbrev=False)
        _json(verb)
        if name == "targets":
            verb.add_argument("--ports", action="store_true", help="the serial ports of this machine instead")
    return parser


def _verb(
    verbs: argparse._SubParsersAction[_Parser], name: str, says: str, out: str = "DIR"
) -> argparse.ArgumentParser:
    verb = verbs.add_parser(name, help=says, description=says, allow_abbrev=False)
    verb.add_argument("project", type=Path, metavar="PROJECT", help="the project's TOML file")
    verb.add_argument("--out", type=_place, required=True, metavar=out, help="where the results go")
    _json(verb)
    return verb


def _json(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("--json", action="store_true", help="one JSON document on stdout instead of text")


def _place(text: str) -> Path:
    if not text.strip() or "\0" in text:
        raise argparse.ArgumentTypeError("names no place")
    return Path(text)


def _steps(text: str) -> int:
    return _whole(text, 1, MOST_STEPS)


def _draws(text: str) -> int:
    return _whole(text, 100, 1_000_000)


def _seed(text: str) -> int:
    return _whole(text, 0, 2**63 - 1)


def _percent(text: str) -> float:
    return _number(text, 0.0, 1000.0)


def _seconds(text: str) -> float:
    return _number(text, 0.001, 1e6)


def _setting(text: str) -> tuple[str, float, float]:
    name, equals, rest = text.partition("=")
    value, at, seconds = rest.partition("@")
    if not name.strip() or not equals or (at and not seconds):
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not like kp=1.2 or kp=1.2@5.0")
    return name.strip(), _number(value, -MOST_VALUE, MOST_VALUE), _number(seconds, 0.0, 1e6) if at else 0.0


def _number(text: str, low: float, high: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = low - 1.0
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not a number from {low:g} to {high:g}")
    return value


def _whole(text: str, low: int, high: int) -> int:
    if not text.isascii() or not text.isdigit() or len(text) > 20 or not low <= int(text) <= high:
        raise argparse.ArgumentTypeError(f"{text[:30]!r} is not a whole number from {low} to {high}")
    return int(text)


def _debugging() -> bool:
    return bool(os.environ.get("FIRMLOOP_DEBUG"))


def _stopped(number: int, frame: FrameType | None) -> NoReturn:
    """End by way of every `finally`, so that nothing half-written stays."""
    raise _Stopped
