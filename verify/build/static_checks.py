"""Read the generated C with tools that run nothing: gcc's analyzer under all warnings, and cppcheck's MISRA rules.

cppcheck's MISRA addon is not a certified checker: it gives rule numbers, and firmloop the reasons.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.codegen.bundle import Bundle, write_files
from firmloop.codegen.misra import deviations
from firmloop.identify.simulation.compiler import compiler_version, run_compiler
from firmloop.verify.build.host import WARNINGS

ANALYZER, CPPCHECK = "gcc -fanalyzer", "cppcheck"
LONGEST = 120.0  # s that a tool may take; the C of a controller takes a few
_SAID = re.compile(
    r"([^\s:]+):(\d+):(\d+): (?:warning|error): (.*?)(?: \[(?:-Werror=|-W)?([\w+=-]+)\])?$", re.MULTILINE
)
_LINE = "{file}\t{line}\t{column}\t{severity}\t{id}\t{message}"
_RULE = re.compile(r"misra-c20\d\d-([0-9.]+)")
_TOLD = ("error", "warning", "portability")  # of what is no rule of MISRA: not matters of style
_FALSE_ALARMS = {
    ("incorrectLogicOperator", "fl_float.h"): "neither comparison holds of a NaN: this is how one is recognized",
}


@dataclass(frozen=True, slots=True)
class StaticFinding:
    """What a tool says of one line of the C; `reason` is why it is right so, empty where nothing explains it."""

    rule: str
    says: str
    file: str
    line: int
    column: int
    reason: str = ""

    @property
    def of_misra(self) -> bool:
        """Whether it is about a rule of MISRA C."""
        return _RULE.fullmatch(self.rule) is not None


@dataclass(frozen=True, slots=True)
class StaticReading:
    """What one tool found; `not_run` says why there is nothing to find, empty where it has read the C."""

    tool: str
    version: str
    findings: tuple[StaticFinding, ...]
    not_run: str = ""


def read_statically(bundle: Bundle) -> tuple[StaticReading, ...]:
    """Let every tool read the C; one that is not there says so."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(bundle.files, folder)
        return _analyzed(folder, bundle.sources), _checked(folder, bundle.sources)


def _analyzed(folder: Path, sources: Sequence[str]) -> StaticReading:
    if shutil.which("gcc") is None:
        return StaticReading(ANALYZER, "", (), "gcc is not installed; install it with: apt-get install gcc")
    version = compiler_version("gcc")
    if "clang" in run_compiler(["gcc", "--version"], folder):
        return StaticReading(ANALYZER, version, (), "the gcc of this machine is clang, which has another analyzer")
    command = ["gcc", *WARNINGS, "-Wno-error", "-O2", "-fanalyzer", "-c", *sources]
    status, said = _run(command, folder)
    found = tuple(
        StaticFinding(rule or "warning", says, file, int(line), int(column))
        for file, line, column, says, rule in _SAID.findall(said)
    )
    failed = f"it ended with status {status}: {said[:200]}" if status and not found else ""
    return StaticReading(ANALYZER, version, found, failed)


def _checked(folder: Path, sources: Sequence[str]) -> StaticReading:
    if shutil.which(CPPCHECK) is None:
        return StaticReading(CPPCHECK, "", (), "cppcheck is not installed; install it with: apt-get install cppcheck")
    version = _run([CPPCHECK, "--version"], folder)[1].strip()
    # MISRA's rules are of the severity "style"; without it, new versions say nothing.
    command = [CPPCHECK, "--addon=misra", "--enable=style", "--std=c99", "--quiet", f"--template={_LINE}", *sources]
    status, said = _run(command, folder)
    rows = [row for line in said.splitlines() if len(row := line.split("\t", 5)) == 6]
    found = [_finding(row) for row in rows if row[3] in _TOLD or _RULE.fullmatch(row[4])]
    failed = f"it ended with status {status}: {said[:200]}" if status and not found else ""
    return StaticReading(CPPCHECK, version, tuple(found), failed)


def _finding(row: Sequence[str]) -> StaticFinding:
    file, line, column, _, rule, says = row
    misra = _RULE.fullmatch(rule)
    if misra is None:
        return StaticFinding(rule, says, file, int(line), int(column), _FALSE_ALARMS.get((rule, file), ""))
    known = deviations().get(misra[1])
    category = known.category if known else "category unknown"
    reason = known.why if known else ""
    return StaticFinding(rule, f"MISRA C rule {misra[1]} ({category})", file, int(line), int(column), reason)


def _run(command: Sequence[str], folder: Path) -> tuple[int, str]:
    """Return status and words of a tool; one that does not end is stopped, and has a status, too."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=LONGEST,
            check=False,
            env={**os.environ, "LC_ALL": "C"},  # the words are parsed
        )
    except subprocess.TimeoutExpired:
        return 1, f"it did not end within {LONGEST:.0f} s"
    except OSError as error:
        return 1, f"it could not be started ({error.strerror})"
    return done.returncode, (done.stdout + done.stderr).decode(errors="replace")
