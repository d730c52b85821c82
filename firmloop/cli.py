"""The command line: argv in, exit status out, and never a traceback.

Exit status: 0 agrees; 1 differs; 2 the user's file or command is wrong; 3 a tool, port or board is not there.
Besides: 70 a fault of firmloop itself (FIRMLOOP_DEBUG=1 shows where), 130 stopped, 141 nobody reads any more.

A command is a file of `firmloop/commands`, found by listing that folder; only the one asked for is imported.
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
from types import FrameType
from typing import NoReturn

from firmloop.arithmetic import settle
from firmloop.commands import command_names, load_command
from firmloop.console import (
    Console,
    JsonConsole,
    NoRoomError,
    TextConsole,
    complain,
    forget_output,
    open_streams,
)

USERS_ERRORS = (
    "firmloop.project.table.ProjectError",
    "firmloop.identify.error.IdentifyError",
    "firmloop.design.law.DesignError",
    "firmloop.quantize.program.QuantizeError",
    "firmloop.codegen.bundle.CodegenError",
)
TOOLS_ERRORS = ("firmloop.identify.extras.ToolError", "firmloop.verify.link.LinkError")
PACKAGES = {"z3": "z3-solver", "serial": "pyserial"}  # that are not called as what is imported
WRONG_FILE, NO_TOOL, OUR_FAULT, STOPPED, NO_READER = 2, 3, 70, 130, 141


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status."""
    open_streams()
    try:
        return _run(argv)
    except (KeyboardInterrupt, _Stopped):
        return _ended()
    except BrokenPipeError:
        forget_output()
        return NO_READER
    except NoRoomError as error:
        forget_output()
        complain(str(error))
        return WRONG_FILE


def _run(argv: Sequence[str] | None) -> int:
    """Run one command; return the exit status, or raise that nobody takes what it says."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows ASCII only must not end a walk
    settle()
    if path := os.environ.get("PATH"):  # an empty part means the folder one stands in, which may be a stranger's
        os.environ["PATH"] = os.pathsep.join(part for part in path.split(os.pathsep) if os.path.isabs(part))
    given = sys.argv[1:] if argv is None else argv
    arguments = _parser(given).parse_args(given)
    console: Console = JsonConsole() if arguments.json else TextConsole()
    if threading.current_thread() is threading.main_thread():
        for ending in (signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):  # Windows has no SIGHUP
            if signal.getsignal(ending) != signal.SIG_IGN:  # as under nohup
                signal.signal(ending, _stopped)
    try:
        with warnings.catch_warnings():
            if not _debugging():
                warnings.simplefilter("ignore")
            status: int = arguments.run(arguments, console)
        console.close()
        return status
    except (BrokenPipeError, NoRoomError):
        raise
    except Exception as error:
        return _ended() if _stop_within(error) else _failed(error, console)


def _ended() -> int:
    complain("stopped; nothing was left half-written")
    return STOPPED


def _stop_within(error: BaseException | None) -> bool:
    """Tell whether a library has made an error of its own of a Ctrl-C: an import that is stopped does."""
    while error is not None and not isinstance(error, KeyboardInterrupt | _Stopped):
        error = error.__cause__ or error.__context__
    return error is not None


def _failed(error: Exception, console: Console) -> int:
    """Say what went wrong in one message; return the exit status."""
    if _debugging():
        complain(traceback.format_exc())
    message = str(error).strip()
    if _is_one_of(error, USERS_ERRORS):
        status = WRONG_FILE
        paste = str(getattr(error, "paste", ""))
        message = message.removesuffix(f"\n{paste}") if paste else message
        message = message.replace("\n", "\\n")  # of a name in it: the complaint is one line, and what to paste
        message = "\n  ".join((message, *(paste.rstrip("\n").split("\n") if paste else ())))
    elif _is_one_of(error, TOOLS_ERRORS):
        status = NO_TOOL
    elif isinstance(error, ModuleNotFoundError) and error.name and not error.name.startswith("firmloop"):
        status = NO_TOOL
        library = error.name.partition(".")[0]
        message = f"{library} is not installed; install it with: pip install {PACKAGES.get(library, library)}"
    elif isinstance(error, OSError) and error.strerror:
        status = WRONG_FILE
        where = f"{error.filename}: " if error.filename else ""
        message = f"{where}cannot be used: {error.strerror}; check the place, its rights, and the room on its disk"
    elif isinstance(error, MemoryError):
        status = NO_TOOL
        message = "memory ran out; ask for fewer steps, rows or signals, or close other programs"
    else:
        status = OUR_FAULT
        words = " ".join(message.split())[:200]
        message = f"internal error: {type(error).__name__}: {words}; please report it (FIRMLOOP_DEBUG=1 shows where)"
    console.fail(message)
    return status


def _is_one_of(error: Exception, classes: Sequence[str]) -> bool:
    """Tell whether an error is of one of these classes; of a module that is not loaded, it cannot be."""
    places = (name.rsplit(".", 1) for name in classes)
    return any(
        isinstance(error, getattr(sys.modules[module], name)) for module, name in places if module in sys.modules
    )


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
        from firmloop.version import version

        TextConsole().lines([f"firmloop {version()}"])
        raise SystemExit(0)


def _parser(asked: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser; it knows the command that is asked for, or all of them where none of that name is."""
    parser = _Parser(
        prog="firmloop",
        description="From a bench recording to controller C that is proven, bit for bit, on the microcontroller.",
        epilog="exit status: 0 agrees; 1 differs; 2 your file is wrong; 3 a tool, port or board is not there",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    names = command_names()
    for name in asked[:1] if asked and asked[0] in names else names:
        command = load_command(name)
        own = commands.add_parser(command.NAME, help=command.HELP, description=command.HELP, allow_abbrev=False)
        command.arguments(own)
        own.add_argument("--json", action="store_true", help="one JSON document on stdout instead of text")
        own.set_defaults(run=command.run)
    return parser


def _debugging() -> bool:
    return bool(os.environ.get("FIRMLOOP_DEBUG"))


def _stopped(number: int, frame: FrameType | None) -> NoReturn:
    """End by way of every `finally`, so that nothing half-written stays."""
    raise _Stopped
