"""Zephyr: a module that a Kconfig symbol switches on."""

from __future__ import annotations

import json
from collections.abc import Mapping

from firmloop.codegen.delivery import CONTRACT, Delivery
from firmloop.codegen.environment import render


def zephyr(delivery: Delivery) -> Mapping[str, str]:
    """Return `zephyr/module.yml` with the CMakeLists.txt and Kconfig that it names."""
    name = delivery.program.name
    view: dict[str, object] = {
        "name": name,
        "macro": name.upper(),
        "command": delivery.command,
        "sources": " ".join(f"../{source}" for source in delivery.sources),
        "contract": CONTRACT,
    }
    return {
        "zephyr/module.yml": f"name: {name}\nbuild:\n  cmake: zephyr\n  kconfig: zephyr/Kconfig\n",
        "zephyr/CMakeLists.txt": render("packages/zephyr_CMakeLists.txt.j2", view),
        "zephyr/Kconfig": f"config {name.upper()}\n\tbool {json.dumps(delivery.says)}\n",
    }


FILES = zephyr
