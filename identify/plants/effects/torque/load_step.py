"""A load that comes on at one moment: -T from then on."""

from __future__ import annotations

import math
from collections.abc import Sequence

from firmloop.identify.plants.assembly import STEADY, Assembly
from firmloop.identify.plants.effect import Effect, EffectParameter, Scales, Site, signed

_END = 0.02  # of the recordings: a moment nearer to one of their ends, or to where the input is switched, is none


def parameters(site: Site) -> tuple[EffectParameter, ...]:
    """Name the constants."""
    return (
        signed("torque_N_m" if site.rotary else "force_N", site.force),
        EffectParameter("time_s", "s", -math.inf, math.inf, 0.0, False, None),
    )


def starts(site: Site, scales: Scales) -> tuple[tuple[float, ...], ...]:
    """Propose where a fit begins."""
    return tuple(
        (sign * 0.1 * scales.effort, share * scales.span) for sign in (1.0, -1.0) for share in (0.25, 0.5, 0.75)
    )


def attach(assembly: Assembly, site: Site, values: tuple[float, ...]) -> None:
    """Add it to a simulation."""
    torque, time = values
    assembly.timing.breaks = (*assembly.timing.breaks, time)
    assembly.add_term(assembly.speed, "load_step", (torque, time), assembly.per[site.balance], STEADY)


def believable(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether the load comes on between the ends, which are rarely what they seem: before, it was always there."""
    moment = values[1]
    return min(moment - scales.begin, scales.end - moment) >= _END * (scales.end - scales.begin)


def distinct(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether it comes on where the input is not switched: else it is what the machine makes of its input."""
    return all(abs(values[1] - each) >= _END * (scales.end - scales.begin) for each in scales.switched)


EFFECT = Effect(
    name="load_step",
    equation="torque",
    place="torque",
    term="-T from time t",
    says="a load is put on during the recording",
    parameters=parameters,
    starts=starts,
    confusable_with=("load_torque", "resistance_heating"),
    experiment="the same test twice, with the load put on at another moment",
    rotary_only=False,
    needs_position=False,
    attach=attach,
    codes=(
        (
            "load_step",
            """    return v->begin >= q[1] - 1e-12 * fabs(q[1]) ? -q[0] : 0.0;""",
        ),
    ),
    switches=(0,),
    unmet="nobody knows beforehand when the load comes; the integral meets it",
    believable=believable,
    distinct=distinct,
    coordinate="time",
    contains=("load_torque",),
    slow=True,
    lasting=True,
    seen_by="moment",
    anywhere=True,
)
