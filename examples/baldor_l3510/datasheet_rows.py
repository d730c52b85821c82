"""Audit of figure 1 (the datasheet) and table 1 (parameters) of the L3510 study."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from examples.audit_table import Row, compared, judged, stated
from examples.baldor_l3510 import stated as study
from examples.baldor_l3510.motor import circuit, loaded
from firmloop.identify.bench_tests.induction_tests import POUND_FOOT
from firmloop.identify.bench_tests.revolving_field import breakdown, running


def rows() -> list[Row]:
    """Return the rows of the datasheet, of table 1, and of the circuit that fits the datasheet."""
    return [*_figure_1(), *_service(), *_taken_over(), *_table_1(), *_circuit()]


def _figure_1() -> list[Row]:
    made = [
        judged(
            "fig. 1",
            f"load point {share:.0%}",
            f"{share * study.POWER:.0f} W at {rpm:.0f} rpm",
            lambda point=(share, factor, efficiency, amps): _power(*point),
            "V I PF efficiency, each as far as its rounding goes, against the share of 1 hp",
        )
        for share, factor, efficiency, rpm, amps in study.LOAD
    ]
    speed = study.RATED_RPM * math.pi / 30
    made.append(
        compared(
            "fig. 1", "full-load torque", "3.01", "lb-ft", lambda: study.POWER / speed / POUND_FOOT, "1 hp at 1750 rpm"
        )
    )
    made.append(
        judged(
            "fig. 1",
            "kVA code",
            "L",
            _code,
            "code L is 9.0 to 9.99 kVA/hp (NEMA's table of locked-rotor code letters)",
        )
    )
    return made


def _power(share: float, factor: float, efficiency: float, amps: float) -> tuple[str, bool]:
    """Return the power that a load point's figures make, W, from the least to the most that their rounding allows."""
    low, high = (
        study.VOLTS * (amps + side * 0.005) * (factor + side * 0.5) * (efficiency + side * 0.05) / 1e4
        for side in (-1, 1)
    )
    return f"{low:.0f} to {high:.0f} W", low <= share * study.POWER <= high


def _code() -> tuple[str, bool]:
    code = study.VOLTS * study.START_AMPS / 1000
    return f"{code:.2f} kVA/hp", 9.0 <= code < 10.0


def _service() -> list[Row]:
    """Place the service-factor column by its current: everything else must lie between the same neighbours."""
    share = float(np.interp(study.SERVICE["line amperes"], study.LOAD[:, 4], study.LOAD[:, 0]))
    return [
        compared(
            "fig. 1",
            f"service-factor column, {name}",
            printed,
            unit,
            lambda column=column: float(np.interp(share, study.LOAD[:, 0], study.LOAD[:, column])),
            f"its own 13.9 A is that of {share:.0%} load, between the 100 % and 125 % columns; the printed value is "
            "beyond even the 150 % column or equal to it",
        )
        for name, printed, column, unit in (
            ("power factor", f"{study.SERVICE['power factor']:.0f}", 1, "%"),
            ("efficiency", f"{study.SERVICE['efficiency']:.1f}", 2, "%"),
            ("speed", f"{study.SERVICE['speed']:.0f}", 3, "rpm"),
        )
    ]


def _taken_over() -> list[Row]:
    """Hold what table 1 takes from figure 1 against figure 1's load points, where they tell it."""
    full = dict(zip(("share", "power factor", "efficiency", "speed", "amperes"), study.LOAD[3], strict=True))
    made = [
        stated("table 1", figure, printed, "taken from figure 1, which prints the same and nothing to compute it from")
        for figure, printed in study.TAKEN.items()
    ]
    made += [
        stated("table 1", figure, printed, "not in figure 1; of a page of the datasheet that the study does not show")
        for figure, printed in study.UNSEEN.items()
    ]
    whole, share = study.POWER / study.VOLTS, full["efficiency"] / 100
    why = "1 hp from 115 V with the other figures of figure 1's load point of 100 %"
    made += [
        compared("table 1", "rated current", "12.5", "A", lambda: 100 * whole / full["power factor"] / share, why),
        compared("table 1", "power factor", "69", "%", lambda: 100 * whole / full["amperes"] / share, why),
        compared(
            "table 1",
            "efficiency",
            "74",
            "%",
            lambda: 1e4 * whole / full["amperes"] / full["power factor"],
            f"{why}; 74 is its NEMA nominal",
        ),
        compared(
            "fig. 1",
            "service-factor amperes at 230 V",
            "6.95",
            "A",
            lambda: study.SERVICE["line amperes"] / 2,
            "half of those at 115 V",
        ),
        compared(
            "fig. 1", "full-load amperes at 230 V", "6.3", "A", lambda: full["amperes"] / 2, "half of those at 115 V"
        ),
    ]
    return made


def _table_1() -> list[Row]:
    impedance = study.VOLTS / study.START_AMPS
    l_aux = math.sqrt(impedance**2 - study.R_AUX**2) / study.OMEGA
    l_m = 1e3 * study.VOLTS / (study.OMEGA * study.NO_LOAD_AMPS)
    value, _ = circuit()
    formulas: tuple[tuple[str, str, str, Callable[[], float], str], ...] = (
        (
            "L_main",
            "0.568",
            "mH",
            lambda: 1e3 * impedance * math.sin(math.acos(study.START_PF)) / study.OMEGA,
            "X = (V/I) sin(acos 0.948) gives twice the printed value",
        ),
        (
            "L_aux",
            "1.25",
            "mH",
            lambda: 1e3 * l_aux,
            "sqrt((V/I)^2 - R_aux^2)/w; also, I is the current of both windings",
        ),
        (
            "L_m",
            "32.1",
            "mH",
            lambda: l_m / math.sqrt(1 - study.NO_LOAD_PF**2),
            f"with PF0 = 0.2 as the formula has it; without it {l_m:.2f}. Besides, only the forward half of the double "
            f"field magnetizes at no load: the datasheet's consistent value is {1e3 * value['magnetizing_L_H']:.1f} mH",
        ),
        ("X_c", "7.8", "ohm", lambda: 1 / (study.OMEGA * study.C_START), "1/(2 pi f C)"),
        ("rated speed", "183.26", "rad/s", lambda: study.RATED_RPM * math.pi / 30, "2 pi N/60"),
        ("synchronous speed", "1800", "rpm", lambda: 120 * study.HERTZ / study.POLES, "120 f/p"),
        ("synchronous angular speed", "188.50", "rad/s", lambda: study.SYNCHRONOUS, "2 pi Ns/60"),
        (
            "slip",
            "2.78",
            "%",
            lambda: 100 * (1 - study.RATED_RPM * math.pi / 30 / study.SYNCHRONOUS),
            "(Ns - N)/Ns",
        ),
        ("rated torque", "4.08", "N m", lambda: study.RATED_TORQUE, "3.01 lb-ft"),
        ("stall torque", "18.85", "N m", lambda: study.LOCKED_TORQUE, "13.9 lb-ft"),
        (
            "rotor inertia J",
            "0.0855",
            "kg m^2",
            lambda: study.ROTOR_INERTIA,
            "0.203 lb-ft^2 x 0.0421: a factor of ten too large",
        ),
        (
            "damping B",
            "0.0216",
            "N m s/rad",
            lambda: study.TORQUE / study.SYNCHRONOUS,
            "T_n/w_s; it is the load line, not the motor's damping",
        ),
        ("K_e", "0.61", "V s/rad", lambda: study.VOLTS / study.SYNCHRONOUS, "V/w_s; an induction motor has no K_e"),
        ("K_t", "0.326", "N m/A", lambda: study.RATED_TORQUE / study.RATED_AMPS, "T_n/I_n"),
        ("tau_e", "1.07", "ms", lambda: 1e3 * study.L_AUX / study.R_AUX, "printed L_aux over R_aux"),
        (
            "tau_e, by its own L_aux",
            "1.07",
            "ms",
            lambda: 1e3 * l_aux / study.R_AUX,
            "L_aux is not what its formula gives",
        ),
        (
            "tau_m",
            "0.396",
            "s",
            lambda: study.J_USED / study.B,
            "J/B with J = 0.00855; the printed J would give ten times that",
        ),
    )
    return [
        *(compared("table 1", name, printed, unit, computed, why) for name, printed, unit, computed, why in formulas),
        judged(
            "table 1",
            "K_e beside K_t",
            f"{study.K_E} and {study.K_T}",
            lambda: (f"{study.K_E / study.K_T:.2f} times", abs(study.K_E / study.K_T - 1) < 0.01),
            "in SI units one machine has one constant for both; that they differ says that neither is one",
        ),
        stated("table 1", "labels of 74 % and 69 %", "time constants", "they are efficiency and power factor, shifted"),
    ]


@functools.cache
def fitted() -> dict[str, tuple[str, str, float]]:
    """Return, of each figure of the datasheet, how it is printed, its unit, and what the fitted circuit makes of it."""
    value, _ = circuit()
    start, top, full = running(value, study.VOLTS, 1.0, True), breakdown(value, study.VOLTS), loaded(1.0)
    # On its way up: with the start circuit to 3/4 of synchronous speed, then without it to the breakdown torque.
    slips = np.linspace(1.0, 0.25, 76)
    way = [running(value, study.VOLTS, float(slip), True).torque for slip in slips]
    pulled = min(*way, running(value, study.VOLTS, 0.25, False).torque)
    return {
        "full-load current": ("12.51", "A", full.line),
        "full-load power factor": ("0.69", "", full.power_factor),
        "full-load speed": ("1750", "rpm", full.speed * 30 / math.pi),
        "breakdown torque": ("9.7", "lb-ft", top.torque / POUND_FOOT),
        "pull-up torque": ("7.8", "lb-ft", pulled / POUND_FOOT),
        "locked-rotor torque": ("13.9", "lb-ft", start.torque / POUND_FOOT),
        "locked-rotor power factor": ("0.948", "", start.power_factor),
        "locked-rotor current": ("85.3", "A", start.line),
        "no-load current": ("9.53", "A", running(value, study.VOLTS, 0.003, False).line),
    }


def worst_fitted() -> tuple[str, float]:
    """Return the figure of the datasheet that the fitted circuit misses most, and by which share."""
    off = {name: abs(ours / float(printed) - 1) for name, (printed, _, ours) in fitted().items()}
    name = max(off, key=lambda key: off[key])
    return name, off[name]


def _circuit() -> list[Row]:
    """Show what one circuit makes of the whole datasheet: six unknowns for all its figures meet few to the digit."""
    note = "double revolving field, leakages, rotor, turns and friction by least squares over the whole datasheet"
    return [
        compared(
            "fig. 1", name, printed, unit, lambda ours=ours: ours, f"{note}; off by {ours / float(printed) - 1:+.1%}"
        )
        for name, (printed, unit, ours) in fitted().items()
    ]
