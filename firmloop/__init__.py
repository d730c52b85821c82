"""firmloop: from a bench recording to controller C that is proven, bit for bit, on the microcontroller.

>>> import firmloop as fl                              # doctest: +SKIP
>>> project = fl.load("wheel_speed.toml")              # doctest: +SKIP
>>> fl.identify(project).plant                         # doctest: +SKIP
>>> fl.run(project, steps=10_000).agrees               # doctest: +SKIP

Each function is loaded when it is first named, so that the import costs nothing. Four of them are called as the
sub-packages that do their work: `firmloop.identify` is the function, and carries the sub-package's names besides, so
that `firmloop.identify.units` and `import firmloop.identify.units as units` mean what they say.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from firmloop.door.design import design as design
    from firmloop.door.diagnose import diagnose as diagnose
    from firmloop.door.diagnose_fleet import diagnose_fleet as diagnose_fleet
    from firmloop.door.generate import generate as generate
    from firmloop.door.identify import identify as identify
    from firmloop.door.load import load as load
    from firmloop.door.run import run as run
    from firmloop.door.simulate import as_recorded as as_recorded
    from firmloop.door.simulate import at_rest as at_rest
    from firmloop.door.simulate import simulate as simulate
    from firmloop.door.verify import verify as verify

__all__ = [
    "as_recorded",
    "at_rest",
    "design",
    "diagnose",
    "diagnose_fleet",
    "generate",
    "identify",
    "load",
    "run",
    "simulate",
    "verify",
]

_FILES = {name: name for name in __all__} | {"as_recorded": "simulate", "at_rest": "simulate"}


class _Door(ModuleType):
    """A module of which a function's name never becomes the sub-package of that name."""

    def __getattr__(self, name: str) -> Any:
        if name not in _FILES:
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
        function = getattr(import_module(f"{self.__name__}.door.{_FILES[name]}"), name)
        package = sys.modules.get(f"{self.__name__}.{name}")
        if package is not None:
            function.__dict__ = package.__dict__  # the same names, now and later
        super().__setattr__(name, function)
        return function

    def __setattr__(self, name: str, value: object) -> None:
        """Leave a name of the door to its function: the import system binds each sub-package that it has loaded."""
        if name not in _FILES or not isinstance(value, ModuleType):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})


sys.modules[__name__].__class__ = _Door
