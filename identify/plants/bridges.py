"""A permanent-magnet machine as its current loop meets it: on three half bridges, with an encoder on its shaft."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from firmloop.identify.plants.attach import values_of, with_effects
from firmloop.identify.plants.effects import find_effect
from firmloop.identify.plants.kind import equations
from firmloop.identify.plants.kinds import find_kind
from firmloop.identify.plants.plant import Balance, EffectUse, Inside, Plant
from firmloop.identify.signal import Signal

_SHOWN = {
    "current_q_A": "A",
    "current_a_A": "A",
    "current_b_A": "A",
    "angle_rad": "rad",
    "speed_rad_s": "rad/s",
    "supply_V": "V",
}
_KEPT = ("torque", "bridge")  # places of effects that stay: the others act on the wires of a log


def on_bridges(plant: Plant, supply: float, shaft: Sequence[Signal] = (), first: str = "current_q_A") -> Plant:
    """Return a pmsm from three duties to two phase currents, electrical angle and speed.

    `supply` in V; `shaft` are further signals, in rad/s the speed of the shaft and in rad its angle; the output `first`
    stands before the others. The bridges turn with nothing: their voltage, averaged over a period of the pulses,
    stands in the stator, and the rotor turns on beneath it. Of the effects stay those of the shaft and of the bridges.
    """
    bare = with_effects(plant, ())
    kind = find_kind("pmsm")
    wires = [Signal(name, "", -math.inf, math.inf) for name in kind.inputs[-1]]
    seen = tuple(Signal(name, unit, -math.inf, math.inf) for name, unit in _SHOWN.items())
    phases = tuple(signal for signal in seen if signal.name in kind.outputs and signal.name != "speed_rad_s")
    whole = kind.build(tuple(wires), phases, bare.parameters)
    x, u, p = ca.SX.sym("x", len(whole.states)), ca.SX.sym("u", 3), ca.SX.sym("p", len(bare.parameters))
    z = ca.SX.sym("z", len(whole.inside.neutral) if whole.inside is not None else 0)
    pairs = p[[parameter.name for parameter in bare.parameters].index("pole_pairs")]
    speed, position = x[2], x[3]
    drive = ca.vertcat(u, supply, pairs * position)

    def read(phase_currents: ca.SX) -> dict[Signal, ca.SX]:
        angle = pairs * position
        readings = [
            *ca.vertsplit(phase_currents),
            *(ca.atan2(ca.sin(angle), ca.cos(angle)), pairs * speed, ca.SX(supply)),
            *(speed if signal.unit == "rad/s" else position for signal in shaft),
        ]
        told = dict(zip((*seen, *shaft), readings, strict=True))
        return dict(sorted(told.items(), key=lambda pair: pair[0].name != first))

    assert whole.inside is not None, "a phase current is among the outputs"
    inner, told = whole.inside, read(whole.reading(x, drive, p))
    made = replace(
        whole,
        inputs=tuple(wires[:3]),
        outputs=tuple(told),
        rate=equations("rate", x, u, p, whole.rate(x, drive, p)),
        reading=equations("reading", x, u, p, ca.vertcat(*told.values())),
        balances=tuple(_rewired(balance, x, u, p, drive) for balance in whole.balances if balance.kind in _KEPT),
        inside=Inside(
            rate=ca.Function("rate", [x, u, p, z], [ca.densify(inner.rate(x, drive, p, z))]),
            reading=ca.Function(
                "reading", [x, u, p, z], [ca.densify(ca.vertcat(*read(inner.reading(x, drive, p, z)).values()))]
            ),
            effort=ca.Function("effort", [x, u, p, z], [inner.effort(x, drive, p, z)]),
            neutral=inner.neutral,
        ),
    )
    return with_effects(made, _kept(plant)) if plant.effects else made


def _kept(plant: Plant) -> list[EffectUse]:
    """Return the effects that act on the shaft or in the bridges, with their values."""
    kept = [use for use in plant.effects if find_effect(use.name).place in _KEPT]
    return [replace(use, values=values_of(plant, use), free=()) for use in kept]


def _rewired(balance: Balance, x: ca.SX, u: ca.SX, p: ca.SX, drive: ca.SX) -> Balance:
    """Return a balance whose drive is the duties alone."""
    effort, current = (
        None if function is None else equations(name, x, u, p, function(x, drive, p))
        for name, function in (("effort", balance.effort), ("current", balance.current))
    )
    return replace(balance, effort=effort, current=current)
