"""ESP-IDF: what its component manager reads; the build itself stands in CMakeLists.txt."""

from __future__ import annotations

import json
from collections.abc import Mapping

from firmloop.codegen.delivery import VERSION, Delivery


def esp_idf(delivery: Delivery) -> Mapping[str, str]:
    """Return `idf_component.yml`."""
    lines = (f"version: {json.dumps(VERSION)}", f"description: {json.dumps(delivery.says)}", "")
    return {"idf_component.yml": "\n".join(lines)}


FILES = esp_idf
