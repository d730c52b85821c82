"""Forms of a PID: how its gains are given and its integral and derivative discretized, `form` in [controller].

This file alone knows their names; the controller (`kinds/pid`) and the tuning rules that simulate it ask it. `tf`, `h`,
`kd` and `ki` below may be numbers or CasADi symbols.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from firmloop.design.table import choice


@dataclass(frozen=True, slots=True)
class Discretization:
    """One way to discretize: backward Euler, or the trapezoidal rule (Tustin)."""

    name: str
    says: str  # in the head of the generated C
    trapezoidal: bool

    def __str__(self) -> str:
        """Return the name, as messages write it."""
        return self.name

    def forget(self, tf: Any, h: Any) -> Any:
        """Return the factor of the previous D."""
        return (2 * tf - h) / (2 * tf + h) if self.trapezoidal else tf / (tf + h)

    def follow(self, tf: Any, h: Any) -> Any:
        """Return 1 less `forget`."""
        return 2 * h / (2 * tf + h) if self.trapezoidal else h / (tf + h)

    def slope(self, kd: Any, tf: Any, h: Any) -> Any:
        """Return the factor of x[k] - x[k-1]."""
        return 2 * kd / (2 * tf + h) if self.trapezoidal else kd / (tf + h)

    def half_step(self, ki: Any, h: Any) -> Any:
        """Return the factor of e[k] in the integral that acts at once."""
        return ki * h / 2 if self.trapezoidal else 0.0


EULER = Discretization("default", "", False)
TUSTIN = Discretization("tustin", ", Tustin", True)


@dataclass(frozen=True, slots=True)
class Form:
    """One form; `times`: it takes `ti_s` and `td_s` in place of ki and kd; `series`: its terms follow each other."""

    name: str
    rule: Discretization
    times: bool = False
    series: bool = False


FORMS: Mapping[str, Form] = {
    form.name: form
    for form in (
        Form("default", EULER),
        Form("parallel", EULER),
        Form("tustin", TUSTIN),
        Form("ideal", EULER, times=True),
        Form("series", EULER, times=True, series=True),
    )
}


def form_of(table: Mapping[str, object]) -> Form:
    """Read `form` of a controller's table."""
    return FORMS[choice(table, "form", "default", tuple(FORMS))]
