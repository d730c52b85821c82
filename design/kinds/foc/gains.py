"""The constants of a current loop: of the machine, gains that cancel its poles, and what the sampled loop allows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from firmloop.design.design import Request
from firmloop.design.law import DesignError
from firmloop.design.table import positive, real

MACHINE = ("R_ohm", "Ld_H", "Lq_H", "flux_Wb")
GAINS = ("kp_d", "ki_d", "kp_q", "ki_q")
LAG = 1.5  # periods, from reading to the middle of what is held
LEAST_MARGIN = math.radians(30.0)  # rad; below it a step of the current rings


def machine_of(request: Request, keys: Sequence[str]) -> Mapping[str, float]:
    """Return the constants of the machine, from the table or from the plant."""
    plant = request.plant
    held = {p.name: p.value for p in plant.parameters} if plant is not None and plant.kind == "pmsm" else {}
    for key in keys:
        if key not in request.table and key not in held:
            raise DesignError(
                f"controller.{key} is missing; give it, or a [plant] of kind pmsm"
                + ("" if key in ("R_ohm",) or "tune" in request.table else ", or decoupling = false")
            )
    return {key: positive(request.table, key, held.get(key)) for key in keys}


def resistance_of(request: Request) -> float | None:
    """Return R in ohm where table or plant tell it."""
    told = "R_ohm" in request.table or (request.plant is not None and request.plant.kind == "pmsm")
    return machine_of(request, MACHINE[:1])["R_ohm"] if told else None


def check_drive(request: Request) -> None:
    """Refuse a period that the winding is quicker than, and a supply that cannot even hold the currents at rest."""
    resistance, wires = resistance_of(request), {wire.name: wire for wire in request.inputs}
    if resistance is None:
        return
    told = all(key in request.table for key in MACHINE[1:3]) or "pmsm" == getattr(request.plant, "kind", "")
    quickest = min(machine_of(request, MACHINE[1:3]).values()) / resistance if told else math.inf
    if request.period > quickest:
        raise DesignError(
            f"period_s = {request.period:g} is longer than the time constant of the winding, {quickest:.3g} s: the "
            "current would be there before the next sample; give a shorter period"
        )
    asked = max(abs(wires["reference_q_A"].low), abs(wires["reference_q_A"].high))
    given = real(request.table, "modulation", 1.0) * wires["supply_V"].low / math.sqrt(3.0)
    if resistance * asked > given:
        raise DesignError(
            f"signals.supply_V goes down to {wires['supply_V'].low:g} V, which gives {given:.3g} V; the {asked:g} A of "
            f"signals.reference_q_A take {resistance * asked:.3g} V at rest already: raise the one or lower the other"
        )


def tuned(request: Request, machine: Mapping[str, float]) -> Mapping[str, float]:
    """Cancel the pole of each axis, and leave an integrator that crosses at the bandwidth."""
    table, h = request.table, request.period
    given = [key for key in GAINS if key in table]
    if given:
        raise DesignError(
            f"controller.{given[0]} = {table[given[0]]!r} is given beside tune = 'pole_zero'; remove one of the two"
        )
    bandwidth = positive(table, "bandwidth_rad_s", None)
    if margin(bandwidth, h) < LEAST_MARGIN:
        most = (math.pi / 2 - LEAST_MARGIN) / (LAG * h)
        raise DesignError(
            f"controller.bandwidth_rad_s = {bandwidth:g} leaves a phase margin of "
            f"{math.degrees(margin(bandwidth, h)):.0f} degrees at period_s = {h:g}; give at most {most:.4g}"
        )
    return {
        "kp_d": machine["Ld_H"] * bandwidth,
        "ki_d": machine["R_ohm"] * bandwidth,
        "kp_q": machine["Lq_H"] * bandwidth,
        "ki_q": machine["R_ohm"] * bandwidth,
    }


def margin(bandwidth: float, period: float) -> float:
    """Return the phase margin in rad of an integrator that crosses at `bandwidth`."""
    return math.pi / 2 - LAG * period * bandwidth


def tracking(request: Request, gains: Mapping[str, float]) -> float:
    """Return h/tt, above 0 and at most 1."""
    slowest = max(gains[f"kp_{axis}"] / gains[f"ki_{axis}"] for axis in "dq")
    tt = positive(request.table, "tt_s", max(slowest, request.period))
    if tt < request.period:
        raise DesignError(
            f"controller.tt_s = {tt:g} is below period_s = {request.period:g}; tracking would overshoot: "
            "give at least the period"
        )
    return request.period / tt
