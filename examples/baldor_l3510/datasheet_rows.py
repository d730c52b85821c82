"""Audit of figure 1 (the datasheet) and table 1 (parameters) of the L3510 study."""

from __future__ import annotations

import math

import numpy as np

from examples.audit_table import Row, compared, missing
from examples.baldor_l3510 import stated
from examples.baldor_l3510.motor import circuit, loaded
from firmloop.identify.bench_tests.revolving_field import breakdown, running


def rows() -> list[Row]:
    """Return the rows of the datasheet, of table 1, and of the circuit that fits the datasheet."""
    return [*_figure_1(), *_service(), *_taken_over(), *_table_1(), *_circuit()]


def _figure_1() -> list[Row]:
    made = []
    for share, factor, efficiency, rpm, amps in stated.LOAD:
        given = stated.VOLTS * amps * factor / 100 * efficiency / 100
        asked = share * stated.POWER
        made.append(
            Row(
                "fig. 1",
                f"load point {share:.0%}",
                f"{asked:.0f} W at {rpm:.0f} rpm",
                f"{given:.0f} W",
                abs(given / asked - 1) < 0.03,
                "V I PF efficiency against the share of 1 hp: within the rounding of PF and efficiency",
            )
        )
    torque = stated.POWER / (stated.RATED_RPM * math.pi / 30) / 1.3558179483
    code = stated.VOLTS * stated.START_AMPS / 1000
    made.append(
        Row(
            "fig. 1",
            "full-load torque",
            "3.01 lb-ft",
            f"{torque:.3f} lb-ft",
            abs(torque - 3.01) < 0.02,
            "1 hp at 1750 rpm",
        )
    )
    made.append(
        Row(
            "fig. 1",
            "kVA code",
            "L",
            f"{code:.2f} kVA/hp",
            9.0 <= code < 10.0,
            "code L is 9.0 to 9.99 kVA/hp (NEMA's table of locked-rotor code letters)",
        )
    )
    return made


def _service() -> list[Row]:
    """Place the service-factor column by its current: everything else must lie between the same neighbours."""
    amps = stated.LOAD[:, 4]
    share = float(np.interp(stated.SERVICE["line amperes"], amps, stated.LOAD[:, 0]))
    made = []
    for name, column, unit in (("power factor", 1, "%"), ("efficiency", 2, "%"), ("speed", 3, "rpm")):
        between = float(np.interp(share, stated.LOAD[:, 0], stated.LOAD[:, column]))
        made.append(
            missing(
                "fig. 1",
                f"service-factor column, {name}",
                f"{stated.SERVICE[name]:g} {unit}",
                f"its own 13.9 A is that of {share:.0%} load, between the 100 % and 125 % columns; the printed "
                "value is "
                "beyond even the 150 % column or equal to it",
                f"{between:.4g} {unit}",
            )
        )
    return made


def _taken_over() -> list[Row]:
    """Hold what table 1 takes from figure 1 against it, and figure 1 against itself."""
    made = [
        Row("table 1", figure, printed, there, printed == there, "taken from figure 1")
        for figure, (printed, there) in stated.TAKEN.items()
    ]
    made += [
        missing("table 1", figure, printed, "not in figure 1; of a page of the datasheet that the study does not show")
        for figure, printed in stated.UNSEEN.items()
    ]
    made.append(compared("fig. 1", "service-factor amperes at 230 V", 6.95, 13.9 / 2, "A", 3, "half of those at 115 V"))
    made.append(compared("fig. 1", "full-load amperes at 230 V", 6.3, 12.5 / 2, "A", 2, "half of those at 115 V"))
    return made


def _table_1() -> list[Row]:
    impedance = stated.VOLTS / stated.START_AMPS
    x_main = impedance * math.sin(math.acos(stated.START_PF))
    x_aux = math.sqrt(impedance**2 - stated.R_AUX**2)
    l_main, l_aux = 1e3 * x_main / stated.OMEGA, 1e3 * x_aux / stated.OMEGA
    l_m = 1e3 * stated.VOLTS / (stated.OMEGA * stated.NO_LOAD_AMPS)
    l_m_full = l_m / math.sqrt(1 - stated.NO_LOAD_PF**2)
    speed = stated.RATED_RPM * math.pi / 30
    damping = 4.08 / stated.SYNCHRONOUS  # with the torque as printed
    value, _ = circuit()
    where = "table 1"
    return [
        compared(where, "L_main", 0.568, l_main, "mH", 3, "X = (V/I) sin(acos 0.948) gives twice the printed value"),
        compared(
            where, "L_aux", 1.25, l_aux, "mH", 3, "sqrt((V/I)^2 - R_aux^2)/w; also, I is the current of both windings"
        ),
        Row(
            where,
            "L_m",
            "32.1 mH",
            f"{l_m_full:.2f} mH",
            False,
            f"the formula with PF0 = 0.2 gives {l_m_full:.2f}, without it {l_m:.2f}. Besides, only the forward "
            "half of the "
            f"double field magnetizes at no load: the datasheet's consistent value is "
            f"{1e3 * value['magnetizing_L_H']:.1f} mH",
        ),
        compared(where, "X_c", 7.8, 1 / (stated.OMEGA * stated.C_START), "ohm", 2, "1/(2 pi f C)"),
        compared(where, "rated speed", 183.26, speed, "rad/s", 5, "2 pi N/60"),
        compared(where, "synchronous speed", 1800, 120 * stated.HERTZ / stated.POLES, "rpm", 4, "120 f/p"),
        compared(where, "synchronous angular speed", 188.50, stated.SYNCHRONOUS, "rad/s", 5, "2 pi Ns/60"),
        compared(where, "slip", 2.78, 100 * (1 - stated.RATED_RPM / 1800), "%", 3, "(Ns - N)/Ns"),
        compared(where, "rated torque", 4.08, stated.RATED_TORQUE, "N m", 3, "3.01 lb-ft"),
        compared(where, "stall torque", 18.85, stated.LOCKED_TORQUE, "N m", 4, "13.9 lb-ft"),
        compared(
            where,
            "rotor inertia J",
            0.0855,
            stated.ROTOR_INERTIA,
            "kg m^2",
            3,
            "0.203 lb-ft^2 x 0.0421: a factor of ten too large",
        ),
        compared(
            where, "damping B", 0.0216, damping, "N m s/rad", 3, "T_n/w_s; it is the load line, not the motor's damping"
        ),
        compared(
            where, "K_e", 0.61, stated.VOLTS / stated.SYNCHRONOUS, "V s/rad", 2, "V/w_s; an induction motor has no K_e"
        ),
        compared(where, "K_t", 0.326, stated.RATED_TORQUE / stated.RATED_AMPS, "N m/A", 3, "T_n/I_n"),
        missing(
            where,
            "K_e beside K_t",
            "0.61 and 0.326",
            "in SI units one machine has one constant for both; that they differ by 1.87 says that neither is one",
        ),
        compared(where, "tau_e", 1.07, 1.25 / stated.R_AUX, "ms", 3, "printed L_aux over R_aux"),
        missing(
            where,
            "tau_e, by its own L_aux",
            "1.07 ms",
            "L_aux is not what its formula gives",
            f"{l_aux / stated.R_AUX:.3g} ms",
        ),
        compared(
            where, "tau_m", 0.396, 0.00855 / 0.0216, "s", 3, "J/B with J = 0.00855; the printed J would give 3.96 s"
        ),
        missing(
            where,
            "labels of 74 % and 69 %",
            "time constants",
            "they are efficiency and power factor, rows shifted",
            "-",
        ),
    ]


def _circuit() -> list[Row]:
    """Show what one circuit makes of the whole datasheet, to show what a consistent value is."""
    value, friction = circuit()
    start, top, full = running(value, stated.VOLTS, 1.0, True), breakdown(value, stated.VOLTS), loaded(1.0)
    # On its way up: with the start circuit to 3/4 of synchronous speed, then without it to the breakdown torque.
    slips = np.linspace(1.0, 0.25, 76)
    way = [running(value, stated.VOLTS, float(slip), True).torque for slip in slips]
    pulled = min(*way, running(value, stated.VOLTS, 0.25, False).torque)
    note = "double revolving field, leakages, rotor, turns and friction by least squares over the whole datasheet"
    pairs = (
        ("full-load current", 12.51, full.line, "A", 0.02),
        ("full-load power factor", 0.69, full.power_factor, "", 0.02),
        ("full-load speed", 1750.0, full.speed * 30 / math.pi, "rpm", 0.002),
        ("breakdown torque", 9.7, top.torque / 1.3558179483, "lb-ft", 0.1),
        ("pull-up torque", 7.8, pulled / 1.3558179483, "lb-ft", 0.1),
        ("locked-rotor torque", 13.9, start.torque / 1.3558179483, "lb-ft", 0.05),
        ("locked-rotor power factor", 0.948, start.power_factor, "", 0.05),
        ("locked-rotor current", 85.3, start.line, "A", 0.05),
    )
    made = [
        Row(
            "fig. 1",
            name,
            f"{printed:g} {unit}".strip(),
            f"{ours:.4g} {unit}".strip(),
            abs(ours / printed - 1) <= share,
            f"{note}; within {share:.1%}",
        )
        for name, printed, ours, unit, share in pairs
    ]
    idle = running(value, stated.VOLTS, 0.003, False)
    made.append(
        Row(
            "fig. 1",
            "no-load current",
            "9.53 A",
            f"{idle.line:.3g} A",
            abs(idle.line / 9.53 - 1) < 0.06,
            f"the same circuit near synchronous speed, friction {friction:.0f} W; 25 % load draws 9.3 A, less than "
            "this",
        )
    )
    return made
