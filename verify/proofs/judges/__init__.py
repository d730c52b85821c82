"""The judges of a delivered controller, one file each: every file of this folder that has a JUDGE is one."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from firmloop.verify.proofs.judge import Judge


@cache
def every_judge() -> dict[str, Judge]:
    """Return all of them by name, in the order of their names."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = sorted((module.JUDGE for module in modules), key=lambda judge: judge.name)
    assert len({judge.name for judge in found}) == len(found), "two judges have one name"
    return {judge.name: judge for judge in found}
