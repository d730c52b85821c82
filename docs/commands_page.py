"""Write docs/reference/commands.md: the commands as the program prints them, exit status, status bits."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Sequence

from firmloop.cli import main
from firmloop.design.kinds import kinds
from firmloop.quantize.not_a_number import NAME, SAYS

STATUS = """## Exit status

| status | meaning |
|---|---|
| 0 | the C agrees with its reference; no mismatch between simulation and recording |
| 1 | the C differs, or a sanitizer found undefined behavior; a mismatch was found; a machine of a fleet \
is different; a cost has grown too much; the evidence is not what was filed |
| 2 | the project file, a recording or the command line is wrong: the message names file, key, value and rule |
| 3 | a tool, sanitizer, port or board is not there, or memory ran out: the message names the way out |
| 70 | a fault of firmloop itself; `FIRMLOOP_DEBUG=1` shows where |
| 130 | stopped by Ctrl-C or SIGTERM |
| 141 | the reader of a pipe went away |

Results go to stdout, progress and errors to stderr. `--json` prints one JSON document on stdout instead of text."""
BITS = """## Status word of the C

`NAME_step` returns a `uint32_t`. Each bit has an enumerator `NAME_BIT` in the header; 0 means that none holds.
`manifest.json` lists the bits in `status`."""


def commands_page() -> str:
    """Return the page."""
    verbs = re.findall(r"^    (\w+)\b", _help([]), re.MULTILINE)
    rows = []
    for verb in verbs:
        usage, says = _help([verb]).split("\n\n")[:2]
        shown = " ".join(usage.split()).removeprefix("usage: ").replace("[-h] ", "").replace("|", "\\|")
        rows.append(f"| `{shown}` | {' '.join(says.split()).replace('|', chr(92) + '|')} |")
    table = "\n".join(rows)
    owners: dict[tuple[str, str], list[str]] = {}
    for name, kind in kinds().items():
        for flag in kind.design(kind.example).law.flags:
            owners.setdefault((flag.name, flag.says), []).append(f"`{name}`")
    owners[NAME, SAYS] = ["every kind, in floating point"]
    listed = "\n".join(f"| `{bit}` | {', '.join(names)} | {says} |" for (bit, says), names in sorted(owners.items()))
    return (
        "# Commands and status\n\n`firmloop COMMAND --help` explains every option. `PROJECT` is the "
        "[project file](project.md).\n\n"
        f"| command | does |\n|---|---|\n{table}\n\n{STATUS}\n\n{BITS}\n\n"
        f"| bit | controller kind | meaning |\n|---|---|---|\n{listed}\n"
    )


def _help(arguments: Sequence[str]) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        main([*arguments, "--help"])
    return said.getvalue()
