"""The characters of stimuli, one file each: every file of this folder that has a STIMULUS is one."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from firmloop.verify.stimuli.stimulus import Stimulus


@cache
def every_stimulus() -> tuple[Stimulus, ...]:
    """Return all of them, in their order."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    found = sorted((module.STIMULUS for module in modules), key=lambda stimulus: stimulus.order)
    assert len({stimulus.order for stimulus in found}) == len(found), "two stimuli have one order"
    return tuple(found)
