"""Find the links that an emulated target can be opened by: every module of this folder that has a LINK."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path

from firmloop.codegen.target import Target
from firmloop.verify import links
from firmloop.verify.links.framed import FramedLink


@dataclass(frozen=True, slots=True)
class Opener:
    """One way to run an image in the emulator and greet it."""

    name: str  # what --port and a verdict call it
    transport: str  # what the image must have been built with
    open: Callable[[Target, Path, str], FramedLink]  # takes the image and the id of the program it must run


@cache
def openers() -> Mapping[str, Opener]:
    """Return every link by its name."""
    names = sorted(module.name for module in pkgutil.iter_modules(links.__path__))
    modules = [import_module(f"firmloop.verify.links.{name}") for name in names]
    found = [module.LINK for module in modules if isinstance(getattr(module, "LINK", None), Opener)]
    return {opener.name: opener for opener in found}
