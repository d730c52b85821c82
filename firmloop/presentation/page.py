"""Put the sections of a report into one page: head, contents, and where it comes from; no script, nothing fetched."""

from __future__ import annotations

import html
import os
import re
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from firmloop.presentation.sections import page_table
from firmloop.version import version

if TYPE_CHECKING:
    from firmloop.stages.data import Data
    from firmloop.stages.verification import Outcome

DATE = "SOURCE_DATE_EPOCH"  # seconds since 1970, by which a page can be made again byte for byte
STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #8882; --good: #2a9d62; --bad: #d6452b; --idle: #b07d12; }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1.2rem;
       color: #1d2126; background: #fff; }
@media (prefers-color-scheme: dark) { body { color: #d8dce2; background: #14171b; } a { color: #7ab8ff; } }
h1 { font-size: 1.5rem; margin: 0; }
h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem; border-bottom: 1px solid var(--line); }
h3 { font-size: .95rem; margin: 1.4rem 0 .3rem; font-weight: 600; }
p.says { margin: .2rem 0 1rem; opacity: .8; }
nav ul { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; list-style: none; padding: 0; margin: .8rem 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .6rem 0; }
th, td { text-align: left; padding: .22rem 1.1rem .22rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td, th { white-space: nowrap; } td.long { white-space: normal; min-width: 24rem; }
thead th { font-weight: 600; } tbody th { font-weight: normal; }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1.2rem 0; }
.card { border: 1px solid var(--line); border-left: .35rem solid var(--idle); border-radius: .3rem;
        padding: .5rem .9rem; min-width: 14rem; }
.card.agrees { border-left-color: var(--good); } .card.differs { border-left-color: var(--bad); }
.card b { display: block; }
pre { background: var(--soft); padding: .8rem 1rem; overflow-x: auto; font-size: 12.5px; line-height: 1.4; }
code { font-size: .92em; overflow-wrap: anywhere; } svg { width: 100%; height: auto; }
@media (max-width: 40rem) { .scroll svg { min-width: 36rem; } }
@media print {
  body { max-width: none; margin: 0; padding: 0; font-size: 10pt; color: #000; background: #fff; }
  nav { display: none; } .scroll, pre { overflow: visible; } pre { white-space: pre-wrap; }
  .scroll svg { min-width: 0; } td, th { white-space: normal; padding-right: .6rem; } td.long { min-width: 0; }
  h2, h3 { break-after: avoid; } svg, tr, .card { break-inside: avoid; }
}
""".strip()


@dataclass(frozen=True, slots=True)
class Origin:
    """What a page was made from: `recordings` by name with the SHA-256 of their bytes, `compilers` by target."""

    command: str
    recordings: tuple[tuple[str, str], ...]
    compilers: tuple[tuple[str, str], ...] = ()


def origin(command: str, data: Data, outcomes: Sequence[Outcome]) -> Origin:
    """Return where a page comes from."""
    return Origin(
        command,
        tuple((Path(recording.source).name, recording.sha256) for recording in (*data.train, *data.test)),
        tuple((each.target, each.verdict.compiler) for each in outcomes if each.verdict is not None),
    )


def page(name: str, what: str, sections: Iterable[str], made_from: Origin) -> str:
    """Return a page about the project called `name`, by firmloop."""
    body, contents = _with_contents([*sections, *_origin_section(made_from)])
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{html.escape(name)}: firmloop {what}</title>",
        f"<style>\n{STYLE}\n</style></head><body><main>",
        body[0],
        contents,
        *body[1:],
        "</main></body></html>",
    ]
    return "\n".join(parts) + "\n"


def _with_contents(sections: Sequence[str]) -> tuple[list[str], str]:
    """Give every heading of a section a name; return the sections, and the list of the headings."""
    named: list[str] = []
    items: list[str] = []
    for section in sections:
        if found := re.match(r"<h2>(.*?)</h2>", section):
            name = f"section-{len(items) + 1}"
            items.append(f'<li><a href="#{name}">{found.group(1)}</a></li>')
            named.append(f'<h2 id="{name}">{section.removeprefix("<h2>")}')
        else:
            named.append(section)
    return named, f'<nav aria-label="Contents"><ul>{"".join(items)}</ul></nav>'


def _origin_section(made_from: Origin) -> list[str]:
    made_at = int(os.environ.get(DATE) or time.time())
    rows = [
        ("command", made_from.command),
        ("firmloop", version()),
        ("date", time.strftime("%Y-%m-%d", time.gmtime(made_at))),
        *((f"compiler of {target}", compiler) for target, compiler in made_from.compilers),
        *((f"SHA-256 of {name}", digest) for name, digest in made_from.recordings if digest),
    ]
    return ["<h2>This report</h2>", page_table(("was made by", ""), rows)]
