r"""Field-oriented control of the currents of a three-phase permanent-magnet machine, from two currents to three duties.

With h the period, th and w the electrical angle and speed, r the references (Krause, Wasynczuk and Sudhoff, Analysis of
Electric Machinery and Drive Systems, 2nd ed., chapter 3 for the frames; Harnefors and Nee, IEEE Trans. Ind. Appl.
34(1), 1998 for decoupling and tuning; Hava, Kerkman and Lipo, IEEE Trans. Power Electron. 14(1), 1999 for v_0)::

    i_al = i_a                              i_be = (i_a + 2 i_b)/sqrt(3)
    i_d  = cos(th) i_al + sin(th) i_be      i_q = -sin(th) i_al + cos(th) i_be
    v_d  = kp_d (r_d - i_d) + I_d - w Lq i_q
    v_q  = kp_q (r_q - i_q) + I_q + w (Ld i_d + psi)
    V    = modulation supply/sqrt(3)
    v_d' = min(max(v_d, -f V), f V)         v_q' = min(max(v_q, -R), R),   R = sqrt(V^2 - v_d'^2)
    I[k+1] = I[k] + ki h (r - i) + (h/tt) (v' - v)                         for d and q, I[0] = 0
    v_al = cos(th) v_d' - sin(th) v_q'      v_be = sin(th) v_d' + cos(th) v_q'
    v_a  = v_al      v_b, v_c = (-v_al +- sqrt(3) v_be)/2      v_0 = (max(v_a, v_b, v_c) + min(v_a, v_b, v_c))/2
    duty = min(max(0.5 + (v - v_0)/supply, 0), 1)              for a, b and c

A voltage at its limit goes to d first, up to its share f: the field is held. It is computed in shares of the supply,
v/supply, where V is a constant. At f = 1 the end of the circle is steep, and what v_d is off shows in R by its root:
with f = 0.9 the duties of `fixed` with 32 bits stay within 1e-6 of the law. The common part v_0 moves no current of a
machine with a free star point, and lets all of supply/sqrt(3) be used. The supply is taken within the range of its
signal, whose low end must be above 0.

Inputs, by name: `reference_d_A`, `reference_q_A`, `current_a_A`, `current_b_A`, `angle_rad`, `speed_rad_s`,
`supply_V`. Outputs: `duty_a`, `duty_b`, `duty_c`. For NaN, `safe_output = 0.5` puts no voltage on the machine.

Keys: `kp_d`, `ki_d`, `kp_q`, `ki_q` (V/A, V/(A s)), or `tune = "pole_zero"` with `bandwidth_rad_s`, w_c: kp = L w_c and
ki = R w_c cancel the pole of the winding. `R_ohm`, `Ld_H`, `Lq_H` and `flux_Wb` are the machine's, taken from a [plant]
of kind pmsm where they are left out. `decoupling` (default true) adds the terms with w, `modulation` (default 1) is the
share of the voltage that may be used, `d_share` (f, default 1) the part of that for d at most, `tt_s` the tracking
time (default kp/ki of the slower axis).

`[controller.feedforward] from = "effects"` gives back what the plant's effect dead_time takes, see `dead_time.py`.

`observer = "flux"` or `"sliding_mode"` takes the place of the inputs `angle_rad` and `speed_rad_s`, which may then
stand behind the duties among the outputs, see `observer.py`.

`mtpa = true` and `weakening_A` add a current along d: the least one for a torque, less field at speed, see `field.py`.

The sampled loop lags by 1.5 periods, one to compute and half a one to hold: its phase margin is 90 degrees less
1.5 w_c h, and must be 30 degrees or more.
"""

from __future__ import annotations

import math

from firmloop.design.design import Design, Kind, Request
from firmloop.design.kinds.foc.dead_time import dead_time_of
from firmloop.design.kinds.foc.equations import Axis, CurrentLoop, write
from firmloop.design.kinds.foc.field import KEYS as FIELD_KEYS
from firmloop.design.kinds.foc.field import field_of
from firmloop.design.kinds.foc.gains import (
    GAINS,
    MACHINE,
    check_drive,
    machine_of,
    margin,
    resistance_of,
    tracking,
    tuned,
)
from firmloop.design.kinds.foc.observer import KEYS as OBSERVER_KEYS
from firmloop.design.kinds.foc.observer import observer_of
from firmloop.design.kinds.foc.wires import INPUTS, bench, check_wires
from firmloop.design.law import DesignError
from firmloop.design.table import check_keys, choice, positive, real, truth
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.bridge_columns import DUTIES

KEYS = (
    *GAINS,
    *MACHINE,
    "tune",
    "bandwidth_rad_s",
    "decoupling",
    "modulation",
    "d_share",
    "tt_s",
    "feedforward",
    *OBSERVER_KEYS,
    *FIELD_KEYS,
)


def design(request: Request) -> Design:
    """Read the table, tune where it says so, and write the law."""
    table = request.table
    check_keys(table, KEYS, "a foc")
    check_wires(request)
    check_drive(request)
    tuned_by = choice(table, "tune", None, ("pole_zero",)) if "tune" in table else None
    decoupled = truth(table, "decoupling", True)
    needs = decoupled or any(key in table for key in FIELD_KEYS)
    asked_of = MACHINE if tuned_by or "observer" in table else MACHINE[1:] if needs else ()
    wires = {wire.name: wire for wire in request.inputs}
    machine = machine_of(request, asked_of)
    gains = tuned(request, machine) if tuned_by else {key: positive(table, key, None) for key in GAINS}
    if not tuned_by and "bandwidth_rad_s" in table:
        raise DesignError('controller.bandwidth_rad_s has no effect on gains that are given; add tune = "pole_zero"')
    dead, missed = dead_time_of(request, resistance_of(request))
    loop = CurrentLoop(
        request.period,
        Axis(gains["kp_d"], gains["ki_d"], machine["Lq_H"] if decoupled else 0.0),
        Axis(gains["kp_q"], gains["ki_q"], machine["Ld_H"] if decoupled else 0.0),
        machine["flux_Wb"] if decoupled else 0.0,
        real(table, "modulation", 1.0, 0.01, 1.0),
        real(table, "d_share", 1.0, 0.01, 1.0),
        tracking(request, gains),
        dead,
        observer_of(table, machine, request.period, wires),
        field_of(table, machine, gains["kp_d"], wires),
    )
    figures = {**gains, "tt_s": request.period / loop.tracking}
    if tuned_by:
        bandwidth = positive(table, "bandwidth_rad_s", None)
        figures |= {"bandwidth_rad_s": bandwidth, "phase_margin_deg": math.degrees(margin(bandwidth, request.period))}
    asked = ("tune", "bandwidth_rad_s") if tuned_by else ()
    return Design(
        write(request, loop), figures, tuned_by, gains, missed, asked=asked, bench=bench(request, "reference_q_A")
    )


KIND = Kind(
    name="foc",
    says="field-oriented control of the currents of a permanent-magnet machine",
    design=design,
    wires=tuple(INPUTS),
    example=Request(
        name="spindle_current",
        table={
            "tune": "pole_zero",
            "bandwidth_rad_s": 1500.0,
            "R_ohm": 0.36,
            "Ld_H": 0.2e-3,
            "Lq_H": 0.33e-3,
            "flux_Wb": 6.4e-3,
            "d_share": 0.9,
        },
        period=50e-6,
        inputs=tuple(
            Signal(name, INPUTS[name], low, high)
            for name, low, high in (
                ("reference_d_A", -3.0, 3.0),
                ("reference_q_A", -3.0, 3.0),
                ("current_a_A", -4.5, 4.5),
                ("current_b_A", -4.5, 4.5),
                ("angle_rad", -math.pi, math.pi),
                ("speed_rad_s", -1000.0, 1000.0),
                ("supply_V", 20.0, 60.0),
            )
        ),
        outputs=tuple(Signal(name, "1", 0.0, 1.0) for name in DUTIES),
        plant=None,
    ),
)
