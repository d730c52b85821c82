"""CMSIS-Pack: the controller as a component for IDEs that read packs."""

from __future__ import annotations

from collections.abc import Mapping

from firmloop.codegen.delivery import VERSION, Delivery
from firmloop.codegen.environment import render


def cmsis_pack(delivery: Delivery) -> Mapping[str, str]:
    """Return `firmloop.<name>.pdsc`: a pack is called by its vendor and its name."""
    view: dict[str, object] = {
        "name": delivery.program.name,
        "says": delivery.says,
        "version": VERSION,
        "program_id": delivery.program.id,
        "headers": delivery.headers,
        "sources": delivery.sources,
    }
    return {f"firmloop.{delivery.program.name}.pdsc": render("packages/pack.pdsc.j2", view)}


FILES = cmsis_pack
