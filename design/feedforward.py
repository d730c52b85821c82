"""What the plant's known effects cost in control, computed from the reference: `[controller.feedforward]`.

A disturbance T in one balance of the plant (a torque, a force, a voltage) is met by the input U that leaves the speed
where it is: with dx/dt = A x + B u - E T, the other states X and U follow from A X + B U = E T, X = 0 in the
speed. For a motor's friction U = T R/kt. The reference w is a speed, and sign(w) is made continuous:
s(w) = min(max(w/smooth, -1), 1), `smooth` in the reference's unit, by default a hundredth of its largest magnitude::

    coulomb_friction, brush_drop    T s(w)
    asymmetric_friction             Tp max(s(w), 0) + Tn min(s(w), 0)
    load_torque                     T
    quadratic_drag                  c w abs(w)

Left out, and told in the law's first line: effects of position (gravity, cogging), which need a sine; of the motion
itself (Stribeck, presliding), which the reference does not know; of actuator and sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from design.law import DesignError
from design.model import nominal
from design.table import check_keys, choice, positive
from identify.linear import linearize
from identify.plant import Balance, EffectUse, Plant
from identify.signal import Signal

KNOWN = ("asymmetric_friction", "brush_drop", "coulomb_friction", "load_torque", "quadratic_drag")


@dataclass(frozen=True, slots=True)
class Part:
    """One effect in units of the controller's output; `up` and `down` as the effect has them for w > 0 and w < 0."""

    name: str
    up: float
    down: float


@dataclass(frozen=True, slots=True)
class Feedforward:
    """What is added to the unlimited output; `missed` names the effects that are not met."""

    parts: tuple[Part, ...]
    smooth: float  # unit of the reference
    missed: tuple[str, ...]

    def term(self, w: ca.SX) -> ca.SX:
        """Return the sum of all parts at reference `w`."""
        sign = ca.fmin(ca.fmax(w * (1 / self.smooth), -1), 1)
        total = ca.SX(0)
        for part in self.parts:
            if part.name == "quadratic_drag":
                total = total + part.up * (w * ca.fabs(w))
            elif part.name == "load_torque":
                total = total + part.up
            elif part.up == part.down:
                total = total + part.up * sign
            else:
                total = total + part.up * ca.fmax(sign, 0) + part.down * ca.fmin(sign, 0)
        return total

    def says(self) -> str:
        """Write what the law's first line adds."""
        left = f" (not for {', '.join(self.missed)})" if self.missed else ""
        return f"; feedforward for {', '.join(part.name for part in self.parts)}{left}"

    def size(self, reference: Signal) -> float:
        """Return the largest magnitude that the term can have."""
        w = max(abs(reference.low), abs(reference.high))
        return sum(
            abs(part.up) * w * w if part.name == "quadratic_drag" else max(abs(part.up), abs(part.down))
            for part in self.parts
        )


def feedforward(table: Mapping[str, object], plant: Plant | None, reference: Signal) -> Feedforward | None:
    """Read `feedforward` of a controller's table; None where there is none."""
    if "feedforward" not in table:
        return None
    own = table["feedforward"]
    if not isinstance(own, Mapping):
        raise DesignError('controller.feedforward is not a table; write [controller.feedforward] with from = "effects"')
    check_keys(own, ("from", "smooth"), "controller.feedforward")
    choice(own, "from", None, ("effects",))
    if plant is None or not plant.effects:
        raise DesignError(
            "controller.feedforward has nothing to work from; add [[plant.effects]], or let diagnose find them"
        )
    smooth = positive(own, "smooth", max(abs(reference.low), abs(reference.high)) / 100)
    parts = tuple(_part(plant, use) for use in plant.effects if use.name in KNOWN)
    missed = tuple(use.name for use in plant.effects if use.name not in KNOWN)
    if not parts:
        raise DesignError(
            f"controller.feedforward can meet none of the plant's effects ({', '.join(missed)}); it knows: "
            f"{', '.join(KNOWN)}; remove it"
        )
    return Feedforward(parts, smooth, missed)


def _part(plant: Plant, use: EffectUse) -> Part:
    wanted = ("voltage",) if use.name == "brush_drop" else ("torque", "force")
    held = ("torque", "force")
    places = [balance for balance in plant.balances if balance.kind in wanted]
    speeds = [balance for balance in plant.balances if balance.kind in held]
    if not places or not speeds or plant.states[speeds[0].state].name != plant.outputs[0].name:
        raise DesignError(
            f"controller.feedforward cannot meet {use.name}: the plant's first output must be the speed that it acts "
            "on; correct plant.outputs, or remove the feedforward"
        )
    factor = 1.0 if places[0].state < 0 else _met(plant, places[0], speeds[0].state, use.name)
    fitted = {parameter.name: parameter.value for parameter in plant.parameters}
    sizes = {name: fitted.get(f"{use.name}.{name}", value) * factor for name, value in use.values.items()}
    if not sizes or not np.all(np.isfinite(list(sizes.values()))):
        raise DesignError(f"plant.effects {use.name} has no finite size; give its parameters")
    up = next((size for name, size in sizes.items() if name.startswith("positive_")), next(iter(sizes.values())))
    down = next((size for name, size in sizes.items() if name.startswith("negative_")), up)
    return Part(use.name, up, down)


def _met(plant: Plant, place: Balance, speed: int, name: str) -> float:
    """Return the input that meets one unit of a disturbance at `place` while the speed stays as it is."""
    bare = nominal(plant)
    linear = linearize(bare)
    push = np.zeros(len(linear.a))
    push[place.state] = float(place.per([parameter.value for parameter in bare.parameters]))
    others = [k for k in range(len(linear.a)) if k != speed]
    ring = np.hstack([linear.a[:, others], linear.b[:, :1]])
    found, *_ = np.linalg.lstsq(ring, push, rcond=None)
    if not np.allclose(ring @ found, push, rtol=1e-6, atol=1e-9 * float(np.abs(push).max())):
        raise DesignError(
            f"controller.feedforward cannot meet {name}: the input does not reach where it acts; remove it"
        )
    return float(found[-1])
