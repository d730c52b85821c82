"""Program and bundle in, the files out that run a controller inside the host's own process."""

from __future__ import annotations

import re
from collections.abc import Mapping

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.environment import render


def host_files(bundle: Bundle) -> Mapping[str, str]:
    """Return the controller's files with `host.c` (a library) and `host_main.c` (a program) beside them."""
    view: dict[str, object] = {"name": bundle.name, "setters": bundle.setters}
    return {**bundle.files, "host.c": render("host.c.j2", view), "host_main.c": render("host_main.c.j2", view)}


def trace_files(bundle: Bundle) -> tuple[Mapping[str, str], Mapping[str, int]]:
    """Return the controller instrumented: after each `const` line its value is kept, and where it is kept by name.

    The instrumented text is the text under test with additions, so that it shows what that text computes.
    """
    source = f"{bundle.name}.c"
    places: dict[str, int] = {}
    lines = []
    for line in bundle.files[source].splitlines():
        lines.append(line)
        found = re.match(r"\s+const (?:float|double|int\d+_t) (\w+) = .*;", line)
        if found:
            places[found[1]] = len(places)
            lines.append(f"    fl_trace[{places[found[1]]}] = (double){found[1]};")
    head = f"extern double fl_trace[{max(1, len(places))}];\n"
    view: dict[str, object] = {"name": bundle.name, "count": max(1, len(places)), "setters": bundle.setters}
    files = {**bundle.files, source: head + "\n".join(lines) + "\n", "trace.c": render("trace.c.j2", view)}
    return files, places
