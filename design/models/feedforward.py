"""What the plant's known effects cost in control, computed beforehand: `[controller.feedforward] from = "effects"`.

A disturbance T in one balance of the plant (a torque, a force, a voltage) is met by the input U that leaves speed and
position where they are: with dx/dt = A x + B u - E T, the other states X and U follow from A X + B U = E T. For a
motor's friction U = T R/kt. How much T is, every effect says itself (`holding` in identify/effects); w is the speed of
the reference, and sign(w) is made continuous: s(w) = min(max(w/smooth, -1), 1). The reference of a plant whose first
output is a position is a position; its speed is then the difference of two samples. Terms::

    dry friction, brushes     Tp max(s(w), 0) + Tn min(s(w), 0)
    Stribeck                  Tc s(w) + (Ts - Tc) (1 - min(|w|/(4 ws), 1)^2)^16 s(w)    within 2 % of exp(-(w/ws)^2)
    load, drag                T + c w abs(w)
    gravity, cogging          T sin(n th + phi)      as in sine.py
    springs                   k th + k3 th^3
    load-dependent friction   mu abs(load, gravity, cogging, springs) s(w)
    dead zone                 v + h min(max(v/soft, -1), 1)    of the whole unlimited output v

Keys: `smooth`, where s(w) reaches 1, in the reference's unit (per s, of a position), by default a hundredth of its
largest magnitude; `soft` likewise of the output; `position` names an input that carries th, in rad or m. Without it th
is the reference, where that is a position; a speed tells no position. Terms over a measured position are feedback:
they take the plant's own stiffness away and are bounded, but no part of the margins.

What is not met is told in the law's first line and by `design`, with the reason: effects that scale the input, hide in
a second body or in the sensor, or act before anything could be done against them (a delay). Viscous friction is part
of the nominal plant, and the gains are tuned with it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from firmloop.design.law import DesignError
from firmloop.design.models.model import nominal
from firmloop.design.models.sine import sine
from firmloop.design.table import check_keys, choice, positive
from firmloop.identify.plants.attach import placed
from firmloop.identify.plants.effect import Effect, Holding
from firmloop.identify.plants.plant import Balance, Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize

MOVES = ("torque", "force")
NOT_MET: Mapping[str, str] = {
    "sensor": "it falsifies what is measured; correct the reading before the controller takes it",
    "capacitor": "it changes a part of the machine; replace that",
}
LAST = "reference_last"


@dataclass(frozen=True, slots=True)
class Part:
    """One effect, and how much of the controller's output meets one unit of it."""

    name: str
    holding: Holding
    factor: float


@dataclass(frozen=True, slots=True)
class Feedforward:
    """What is added to the unlimited output; `missed` are the effects that are not met, with the reason."""

    parts: tuple[Part, ...]
    reference: Signal
    step: float  # of the reference's speed: the period in s, where the reference is a position; else 0
    smooth: float  # unit of the reference, per s where it is a position
    position: Signal | None  # what carries th
    dead: float  # unit of the output
    dead_zones: tuple[str, ...]  # the effects that it is of
    soft: float
    most: float  # largest magnitude of the output
    missed: Mapping[str, str]

    @property
    def differentiates(self) -> bool:
        """Whether the reference of the sample before is needed."""
        return self.step > 0.0 and any(_moves(part.holding) for part in self.parts)

    def states(self, started: bool) -> tuple[tuple[Signal, str], ...]:
        """Return the state variables that it adds, and why they stay in their range; `started` may be there already."""
        if not self.differentiates:
            return ()
        held = Signal(LAST, self.reference.unit, self.reference.low, self.reference.high)
        own = ((held, "the reference of the sample before"),)
        return own if started else (*own, (Signal("started", "1", 0.0, 1.0), "0 before the first sample, 1 after it"))

    def term(self, w: ca.SX, th: ca.SX | None) -> ca.SX:
        """Return the sum of all parts but the dead zone; `w` is the speed, times `step` where that is not 0."""
        per = self.step or 1.0  # s
        sign = _share(w, self.smooth * per)
        load, friction, share = ca.SX(0), ca.SX(0), 0.0
        for part in self.parts:
            held, k = part.holding, part.factor
            load = load + self._load(held, k, w, th)
            if held.up == held.down != 0:
                friction = friction + k * held.up * sign
            elif held.up or held.down:
                friction = friction + k * held.up * ca.fmax(sign, 0) + k * held.down * ca.fmin(sign, 0)
            if held.extra:
                far = ca.fmin(ca.fabs(w), 4 * held.slow * per) * (1 / (4 * held.slow * per))
                bell = ca.fmin(ca.fabs(1 - far * far), 1)  # changes nothing, but says what the range is
                for _ in range(4):
                    bell = bell * bell
                friction = friction + (k * held.extra) * (bell * sign)
            share += held.share
        return load + friction + (share * (ca.fabs(load) * sign) if share else 0)

    def _load(self, held: Holding, k: float, w: ca.SX, th: ca.SX | None) -> ca.SX:
        total = ca.SX(k * held.constant)
        if held.drag:
            total = total + self._drag(held, k) * (self._capped(w, held, k) * ca.fabs(self._capped(w, held, k)))
        if th is not None:
            if held.spring:
                total = total + k * held.spring * th
            if held.cubic:
                total = total + k * held.cubic * (th * th * th)
            if held.wave:
                ends = [held.turns * end + held.phase for end in self._travel()]
                total = total + k * held.wave * sine(held.turns * th + held.phase, *ends)
        return total

    def _drag(self, held: Holding, k: float) -> float:
        return k * held.drag / (self.step or 1.0) ** 2

    def _capped(self, w: ca.SX, held: Holding, k: float) -> ca.SX:
        """Keep the speed of a position's reference where its drag is within the output's range: a jump is none."""
        if not self.step:
            return w
        most = self._fastest(held, k) * self.step
        return ca.fmin(ca.fmax(w, -most), most)

    def _fastest(self, held: Holding, k: float) -> float:
        """Return the largest speed that counts."""
        if self.step:
            return math.sqrt(self.most / abs(k * held.drag))
        return max(abs(self.reference.low), abs(self.reference.high))

    def _travel(self) -> tuple[float, float]:
        assert self.position is not None
        return self.position.low, self.position.high

    def with_dead_zone(self, v: ca.SX) -> ca.SX:
        """Return the output that passes a dead zone as `v` would pass none."""
        return v + self.dead * _share(v, self.soft) if self.dead else v

    def says(self) -> str:
        """Write what the law's first line adds."""
        left = f" (not for {', '.join(self.missed)})" if self.missed else ""
        met = [part.name for part in self.parts] + list(self.dead_zones)
        return f"; feedforward for {', '.join(met)}{left}"

    def size(self) -> float:
        """Return the largest magnitude that it can add."""
        load, friction, share = 0.0, 0.0, 0.0
        for part in self.parts:
            held, k = part.holding, abs(part.factor)
            far = max(abs(end) for end in self._travel()) if self.position is not None else 0.0
            fast = self._fastest(held, k) if held.drag else 0.0
            load += k * (abs(held.constant) + abs(held.drag) * fast**2 + abs(held.spring) * far)
            load += k * (abs(held.cubic) * far**3 + 1.001 * abs(held.wave))
            friction += k * (max(abs(held.up), abs(held.down)) + abs(held.extra))
            share += held.share
        return load * (1 + share) + friction + self.dead


def _share(value: ca.SX, full: float) -> ca.SX:
    """Return value/full within -1..1; limited before it is divided, so that fixed point keeps its digits."""
    return ca.fmin(ca.fmax(value, -full), full) * (1 / full)


def _moves(held: Holding) -> bool:
    return any((held.up, held.down, held.extra, held.drag, held.share))


def position_of(table: Mapping[str, object]) -> str | None:
    """Return the name that `[controller.feedforward]` gives as the position, if there is one."""
    own = table.get("feedforward")
    name = own.get("position") if isinstance(own, Mapping) else None
    return name if isinstance(name, str) else None


def feedforward(
    table: Mapping[str, object],
    plant: Plant | None,
    period: float,
    wires: tuple[Signal, Signal],
    inputs: tuple[Signal, ...],
) -> Feedforward | None:
    """Read `feedforward` of a controller's table; None where there is none. `wires`: reference and output."""
    if "feedforward" not in table:
        return None
    own = table["feedforward"]
    if not isinstance(own, Mapping):
        raise DesignError('controller.feedforward is not a table; write [controller.feedforward] with from = "effects"')
    reference, output = wires
    most = max(abs(output.low), abs(output.high))
    try:
        check_keys(own, ("from", "smooth", "soft", "position"), "it")
        choice(own, "from", None, ("effects",))
        smooth = positive(own, "smooth", max(abs(reference.low), abs(reference.high)) / 100)
        soft = positive(own, "soft", most / 100)
        if "position" in own:
            choice(own, "position", None, [signal.name for signal in inputs])
    except DesignError as error:  # these speak of the controller's own keys
        raise DesignError(str(error).replace("controller.", "controller.feedforward.", 1)) from None
    if plant is None or not plant.effects:
        raise DesignError(
            "controller.feedforward has nothing to work from; add [[plant.effects]], or let diagnose find them"
        )
    carried = _carried(own, plant, reference, inputs)
    parts, dead, dead_zones, missed = [], 0.0, [], {}
    for effect, site, at in placed(plant):
        values = tuple(plant.parameters[k].value for k in at)
        if effect.holding is None:
            missed[effect.name] = effect.unmet or NOT_MET.get(effect.place, "nothing that a drive gives holds it")
            continue
        if not np.all(np.isfinite(values)):
            raise DesignError(f"plant.effects {effect.name} has no finite size; give its parameters")
        held = effect.holding(site, values)
        if held.dead and plant.resting_input:
            missed[effect.name] = "it lies about input_at_rest, and the controller's output about 0"
        elif held.dead:
            dead += held.dead
            dead_zones.append(effect.name)
        elif carried[1] is None and any((held.wave, held.spring, held.cubic)):
            missed[effect.name] = 'a speed tells no position; name an input that carries it: position = "..."'
        else:
            parts.append(Part(effect.name, held, _factor(plant, effect)))
    if not parts and not dead:
        told = "; ".join(f"{name}: {why}" for name, why in missed.items())
        raise DesignError(f"controller.feedforward can meet none of the plant's effects ({told}); remove it")
    return Feedforward(
        parts=tuple(parts),
        reference=reference,
        step=period if carried[0] else 0.0,
        smooth=smooth,
        position=carried[1],
        dead=dead,
        dead_zones=tuple(dead_zones),
        soft=soft,
        most=most,
        missed=missed,
    )


def _carried(
    own: Mapping[str, object], plant: Plant, reference: Signal, inputs: tuple[Signal, ...]
) -> tuple[bool, Signal | None]:
    """Tell whether the reference is a position, and what carries the position."""
    follows = _followed(plant)
    if "position" in own:
        named = {signal.name: signal for signal in inputs}
        found = named[str(own["position"])]
        unit = "rad" if any(balance.kind == "torque" for balance in plant.balances) else "m"
        if found.unit != unit:
            raise DesignError(
                f"controller.feedforward.position names signals.{found.name} in '{found.unit}'; it must be in '{unit}'"
            )
        return follows == "position", found
    return follows == "position", reference if follows == "position" else None


def _followed(plant: Plant) -> str:
    """Return whether the plant's first output is the speed or the position that its effects act on."""
    moved = next((balance for balance in plant.balances if balance.kind in MOVES), None)
    row = linearize(nominal(plant)).c[0]
    for what, state in (("speed", moved.state), ("position", moved.position)) if moved is not None else ():
        if state >= 0 and np.array_equal(row, np.eye(len(row))[state]):
            return what
    return ""


def _factor(plant: Plant, effect: Effect) -> float:
    """Return the input that meets one unit of an effect while speed and position stay as they are."""
    place = next(
        (
            balance
            for balance in plant.balances
            if balance.kind in (MOVES if effect.place == "torque" else (effect.place,))
        ),
        None,
    )
    moved = next((balance for balance in plant.balances if balance.kind in MOVES), None)
    if place is None or moved is None or not _followed(plant):
        raise DesignError(
            f"controller.feedforward cannot meet {effect.name}: the plant's first output must be the speed or position "
            "that it acts on; correct plant.outputs, or remove the feedforward"
        )
    return 1.0 if place.state < 0 else _met(plant, place, moved, effect.name)


def _met(plant: Plant, place: Balance, moved: Balance, name: str) -> float:
    bare = nominal(plant)
    linear = linearize(bare)
    push = np.zeros(len(linear.a))
    push[place.state] = float(place.per([parameter.value for parameter in bare.parameters]))
    others = [k for k in range(len(linear.a)) if k not in (moved.state, moved.position)]
    ring = np.hstack([linear.a[:, others], linear.b[:, :1]])
    found, *_ = np.linalg.lstsq(ring, push, rcond=None)
    if not np.allclose(ring @ found, push, rtol=1e-6, atol=1e-9 * float(np.abs(push).max())):
        raise DesignError(
            f"controller.feedforward cannot meet {name}: the input does not reach where it acts; remove it"
        )
    return float(found[-1])
