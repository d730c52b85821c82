"""A permanent-magnet machine as its current loop meets it: on three half bridges, with an encoder on its shaft."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kind import equations
from firmloop.identify.plants.kinds import find_kind
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal

_SHOWN = {
    "current_q_A": "A",
    "current_a_A": "A",
    "current_b_A": "A",
    "angle_rad": "rad",
    "speed_rad_s": "rad/s",
    "supply_V": "V",
}


def on_bridges(plant: Plant, supply: float, shaft: Sequence[Signal] = (), first: str = "current_q_A") -> Plant:
    """Return a pmsm without its effects, from three duties to two phase currents, electrical angle and speed.

    `supply` in V; `shaft` are further signals, in rad/s the speed of the shaft and in rad its angle; the output `first`
    stands before the others. The bridges turn with nothing: their voltage, averaged over a period of the pulses,
    stands in the stator, and the rotor turns on beneath it.
    """
    bare = with_effects(plant, ())
    kind = find_kind("pmsm")
    wires = [Signal(name, "", -math.inf, math.inf) for name in kind.inputs[-1]]
    seen = tuple(Signal(name, unit, -math.inf, math.inf) for name, unit in _SHOWN.items())
    phases = tuple(signal for signal in seen if signal.name in kind.outputs and signal.name != "speed_rad_s")
    whole = kind.build(tuple(wires), phases, bare.parameters)
    x, u, p = ca.SX.sym("x", len(whole.states)), ca.SX.sym("u", 3), ca.SX.sym("p", len(bare.parameters))
    pairs = p[[parameter.name for parameter in bare.parameters].index("pole_pairs")]
    speed, position = x[2], x[3]
    angle = pairs * position
    drive = ca.vertcat(u, supply, angle)
    readings: list[ca.SX | float] = [
        *ca.vertsplit(whole.reading(x, drive, p)),
        *(ca.atan2(ca.sin(angle), ca.cos(angle)), pairs * speed, supply),
        *(speed if signal.unit == "rad/s" else position for signal in shaft),
    ]
    told = dict(zip((*seen, *shaft), readings, strict=True))
    outputs = tuple(sorted(told, key=lambda signal: signal.name != first))
    return replace(
        whole,
        inputs=tuple(wires[:3]),
        outputs=outputs,
        rate=equations("rate", x, u, p, whole.rate(x, drive, p)),
        reading=equations("reading", x, u, p, ca.vertcat(*(told[signal] for signal in outputs))),
        balances=(),
        inside=None,
    )
