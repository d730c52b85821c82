"""Tuning rules: every module of this folder that has a `RULE` is one."""

from __future__ import annotations

import functools
import importlib
import math
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from firmloop.design.law import DesignError
from firmloop.identify.simulation.linearize import Linear


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains of the parallel PID; `says` tells the model they rest on.

    With u the unit of the output and y that of the measurement: kp in u/y, ki in u/(y s), kd in u s/y.
    """

    kp: float
    ki: float
    kd: float
    says: str

    @property
    def filter_time(self) -> float:
        """Time constant of the derivative's filter where none is given, s: a tenth of Td = kd/kp."""
        return abs(self.kd / self.kp) / 10 if self.kp else 0.0


def ideal(kc: float, ti: float, td: float, says: str) -> Gains:
    """Return the gains of kc (1 + 1/(ti s) + td s), times in s; ti = 0 is no integral.

    Raises DesignError where a gain is not finite.
    """
    gains = (kc, kc / ti if ti > 0 else 0.0, kc * td)
    if not all(math.isfinite(gain) for gain in gains):
        raise DesignError(f"{says}: gives no finite gains; check the plant's parameters")
    return Gains(float(gains[0]), float(gains[1]), float(gains[2]), says)


@dataclass(frozen=True, slots=True)
class Rule:
    """One tuning rule: `tune(plant, period in s, controller table)`; `keys` are its own keys in that table."""

    name: str
    says: str
    keys: tuple[str, ...]
    tune: Callable[[Linear, float, Mapping[str, object]], Gains]


@functools.cache
def rules() -> Mapping[str, Rule]:
    """Every rule of this folder, by name."""
    modules = (importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__))
    found = (module.RULE for module in modules if hasattr(module, "RULE"))
    return {rule.name: rule for rule in sorted(found, key=lambda rule: rule.name)}
