"""Make: the controller as an archive, and its golden vectors as `make check`."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import FLAGS, Delivery
from firmloop.codegen.environment import render


def makefile(delivery: Delivery) -> Mapping[str, str]:
    """Return `Makefile`."""
    view: dict[str, object] = {
        "name": delivery.program.name,
        "command": delivery.command,
        "flags": " ".join(FLAGS),
        "objects": " ".join(f"{source[:-2]}.o" for source in delivery.sources),
        "headers": " ".join(delivery.headers),
    }
    return {"Makefile": render("packages/library.mk.j2", view)}


FILES = makefile
