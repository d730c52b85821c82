"""The wires of a current loop: what it reads, what it gives, and the machine on bridges that closes it."""

from __future__ import annotations

from firmloop.design.design import Bench, Request
from firmloop.design.law import DesignError
from firmloop.identify.plants.bridges import on_bridges
from firmloop.identify.signal import Signal

INPUTS = {
    "reference_d_A": "A",
    "reference_q_A": "A",
    "current_a_A": "A",
    "current_b_A": "A",
    "angle_rad": "rad",
    "speed_rad_s": "rad/s",
    "supply_V": "V",
}
DUTIES = ("duty_a", "duty_b", "duty_c")
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
    for wire in request.outputs:
        if wire.name in DUTIES and not wire.low <= 0.0 < 1.0 <= wire.high:
            raise DesignError(f"signals.{wire.name} ranges from {wire.low:g} to {wire.high:g}; a duty is from 0 to 1")
