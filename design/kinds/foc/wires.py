"""The wires of a current loop: what it reads, what it gives, and the machine on bridges that closes it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from firmloop.design.design import Bench, Request
from firmloop.design.law import DesignError
from firmloop.identify.plants.bridges import on_bridges
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.bridge_columns import DUTIES

INPUTS = {
    "reference_d_A": "A",
    "reference_q_A": "A",
    "current_a_A": "A",
    "current_b_A": "A",
    "angle_rad": "rad",
    "speed_rad_s": "rad/s",
    "supply_V": "V",
}
LEAST_TURN = 0.98 * 2.0 * math.pi  # rad: whoever writes -3.1 to 3.1 means a turn
NEARLY = 0.01
COUNTS = tuple(2**n for n in range(7, 24))  # half a turn of an encoder or converter
SEEN = ("angle_rad", "speed_rad_s")  # with an observer no inputs; outputs where they are named


def bench(request: Request, told: str, measured: Signal | None = None) -> Bench | None:
    """Return the plant on bridges, at the middle of the supply; None where there is no such plant.

    `measured` is what follows the input `told`, the speed or the angle of the shaft; None is the current of q.
    """
    if request.plant is None or request.plant.kind != "pmsm" or tuple(w.name for w in request.outputs[:3]) != DUTIES:
        return None
    supply = next(wire for wire in request.inputs if wire.name == "supply_V")
    others = [wire for wire in request.inputs if wire.name not in (*INPUTS, told) and wire.unit in ("rad", "rad/s")]
    middle = (supply.low + supply.high) / 2.0
    return Bench(on_bridges(request.plant, middle, others, measured.name if measured else "current_q_A"), told)


def check_wires(request: Request) -> None:
    """Refuse wires of other names or units, and a supply that can be 0."""
    observed = "observer" in request.table
    told = [wire.name for wire in request.outputs if observed and wire.name in SEEN]
    for what, wires, wanted in (
        ("inputs", request.inputs, [name for name in INPUTS if not (observed and name in SEEN)]),
        ("outputs", request.outputs, [*DUTIES, *told]),
    ):
        names = tuple(wire.name for wire in wires)
        if sorted(names) != sorted(wanted) or (what == "outputs" and told != list(names[3:])):
            raise DesignError(
                f"controller.kind = 'foc' has the {what} ({', '.join(names)}); they must be {', '.join(wanted)}: "
                "correct [signals] or controller.outputs"
            )
    for wire in request.inputs:
        if wire.unit != INPUTS[wire.name]:
            raise DesignError(
                f"signals.{wire.name} is in '{wire.unit}'; a foc takes it in '{INPUTS[wire.name]}': convert it, "
                "angle and speed are electrical ones"
            )
        if wire.name == "supply_V" and wire.low <= 0:
            raise DesignError(
                f"signals.supply_V ranges from {wire.low:g} V; without a supply there is no duty: give the least that "
                "the drive runs on as low"
            )
        if wire.name == "angle_rad":
            _check_angle(wire)
    for wire in request.outputs:
        if wire.name in DUTIES and wire.unit not in ("", "1"):
            raise DesignError(
                f"signals.{wire.name} is in '{wire.unit}'; a foc gives shares of the period, from 0 to 1: write "
                'unit = "1" and convert them where they are used'
            )
        if wire.name in DUTIES and not wire.low <= 0.0 < 1.0 <= wire.high:
            raise DesignError(f"signals.{wire.name} ranges from {wire.low:g} to {wire.high:g}; a duty is from 0 to 1")
    _check_sensors({wire.name: wire for wire in request.inputs})


def _check_angle(wire: Signal) -> None:
    """Refuse a range that is one of degrees, of counts or of turns: the unit was written, the numbers were not."""
    span, looks = wire.high - wire.low, ""
    if span < LEAST_TURN:
        looks = f"{span:.4g} of the {2.0 * math.pi:.4g} rad of a turn" + (", as turns have it" if span <= 1.0 else "")
    elif abs(span / 360.0 - 1.0) < NEARLY and -wire.low in (0.0, wire.high):
        looks = "a turn of degrees"
    elif wire.low in (0.0, -(wire.high + 1.0)) and math.ceil(span / 2.0) in COUNTS:
        looks = "a turn of counts"
    if looks:
        raise DesignError(
            f"signals.angle_rad ranges from {wire.low:g} to {wire.high:g}, {looks}; a foc takes the electrical angle "
            "in rad: convert it, and give the range that it has then, such as -3.1416 to 3.1416"
        )


def _check_sensors(wires: Mapping[str, Signal]) -> None:
    """Refuse a current that is asked for and that no sensor can read."""
    for axis in ("reference_d_A", "reference_q_A"):
        asked = max(abs(wires[axis].low), abs(wires[axis].high))
        for name in ("current_a_A", "current_b_A"):
            read = min(abs(wires[name].low), abs(wires[name].high))
            if wires[name].low >= 0.0 or wires[name].high <= 0.0 or asked > read:
                span = f"{wires[name].low:g} to {wires[name].high:g} A"
                raise DesignError(
                    f"signals.{name} ranges from {span} and signals.{axis} asks for up to {asked:g} A, which a phase "
                    "carries both ways: the loop could not see it and would give all its voltage; lower the one or "
                    "widen the other"
                )
