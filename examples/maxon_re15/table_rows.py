"""Audit of table 1 of the RE 15 study: open and closed loop, first and second order."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from examples.audit_table import Row, compared, damping_of, implied, judged, second_order_step, stated, step_figures
from examples.maxon_re15.motor import ASSUMED, SECONDS, controlled, final, open_loop
from examples.maxon_re15.published import TABLE


def rows() -> list[Row]:
    """Return the rows of the table, one a figure."""
    return [*_open_loop(), *_closed_loop()]


def _open_loop() -> list[Row]:
    """Order 1 has no overshoot at all; order 2 has this one only with an armature no motor has."""
    first, second = TABLE["open loop, order 1"], TABLE["open loop, order 2"]
    lag = float(first.rise) / math.log(9)
    curve = 1 - np.exp(-np.arange(0.0, 20 * lag, lag / 1e3) / lag)
    damping = damping_of(float(second.overshoot))
    natural, standard = _standard(float(second.rise), damping)
    moved = open_loop(ASSUMED["L_H"])[0]
    return [
        implied(
            "table 1",
            "open loop, order 1: rise time",
            f"{first.rise} s",
            lambda: f"tau = {lag:.3f} s",
            "no parameter is given; as a first-order lag it means tau = rise/ln 9",
        ),
        compared(
            "table 1",
            "open loop, order 1: overshoot",
            first.overshoot,
            "%",
            lambda: 100 * max(0.0, float(curve.max()) - 1),
            "K/(tau s + 1) never passes its final value",
        ),
        compared(
            "table 1",
            "open loop, order 1: settling time",
            first.settling,
            "s",
            lambda: lag * math.log(50),
            "a first-order lag of that rise time is within 2 % after ln 50 tau, within 5 % after "
            f"{lag * math.log(20):.2f} s",
        ),
        compared(
            "table 1",
            "open loop, order 1: steady-state error",
            first.error,
            "%",
            lambda: 100 * (1 - float(curve[-1])),
            "the normalized response of eq. 1 ends at 1 whatever its constants; without a set point there is no error",
        ),
        compared(
            "table 1",
            "open loop, order 2: overshoot",
            second.overshoot,
            "%",
            lambda: 100 * max(0.0, float(moved.max() / moved[-1]) - 1),
            f"eq. 1 overshoots by that with zeta = {damping:.3f}; with the rise time omega_n = {natural:.2f} rad/s. As "
            f"R/L + B/J = 2 zeta omega_n = {2 * damping * natural:.2f} 1/s, L/R would be at least "
            f"{1 / (2 * damping * natural):.2f} s; the assumed motor's is "
            f"{1e3 * ASSUMED['L_H'] / ASSUMED['R_ohm']:.2f} ms, and its response has no overshoot",
        ),
        stated("table 1", "open loop, order 2: rise time", f"{second.rise} s", "no parameter is given"),
        judged(
            "table 1",
            "open loop, order 2: settling time",
            f"{second.settling} s",
            lambda: (
                f"{standard['settling_5']:.2f} to {standard['settling_2']:.2f} s",
                standard["settling_5"] <= float(second.settling) <= standard["settling_2"],
            ),
            "of the standard form with that overshoot and rise time, 5 % to 2 % band (the band is not named)",
        ),
        compared(
            "table 1",
            "open loop, order 2: steady-state error",
            second.error,
            "%",
            lambda: 100 * abs(1 - float(moved[-1]) / final()),
            "as for order 1: the assumed motor ends at what its own constants make of the voltage",
        ),
    ]


def _closed_loop() -> list[Row]:
    """With integral action the error ends at zero; rise, overshoot and settling must fit one another."""
    made = []
    for order, name in ((1, "closed loop, order 1"), (2, "closed loop, order 2")):
        printed = TABLE[name]
        damping = damping_of(float(printed.overshoot))
        natural, standard = _standard(float(printed.rise), damping)
        tail = (SECONDS - float(printed.settling)) / math.log(2 / float(printed.error))
        made += [
            implied(
                "table 1",
                f"{name}: rise time",
                f"{printed.rise} s",
                lambda natural=natural: f"omega_n = {natural:.1f} rad/s with that overshoot",
                "neither gains nor motor are given",
            ),
            implied(
                "table 1",
                f"{name}: overshoot",
                f"{printed.overshoot} %",
                lambda damping=damping: f"zeta = {damping:.2f}",
                "neither gains nor motor are given",
            ),
            implied(
                "table 1",
                f"{name}: settling time",
                f"{printed.settling} s",
                lambda found=standard: f"{found['settling_5']:.2f} and {found['settling_2']:.2f} s",
                "of the standard form with that overshoot and rise time, 5 % and 2 % band; a PID may add a slow tail",
            ),
            compared(
                "table 1",
                f"{name}: steady-state error",
                printed.error,
                "%",
                lambda order=order: round(controlled(ASSUMED["L_H"] * (order - 1))[1]["error"], 9),
                f"a PID's integral leaves none; {printed.error} % at the end of 2 s is a tail of time constant "
                f"{tail:.1f} s, longer than the whole settling time",
            ),
        ]
    return made


def _standard(rise: float, damping: float) -> tuple[float, Mapping[str, float]]:
    """Return omega_n of the standard form with that rise time, and its step figures."""
    unit = np.arange(0.0, 40.0, 1e-3)
    found = step_figures(unit, second_order_step(unit, 1.0, damping), 1.0)
    scale = rise / found["rise"]
    return 1 / scale, {name: value * (scale if name != "overshoot" else 1) for name, value in found.items()}
