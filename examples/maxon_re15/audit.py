"""Recompute every table and figure of the RE 15 study from its stated inputs, and say which cannot be right.

    python -m examples.maxon_re15.audit [--out DIR]

The study prints no parameter of the motor and no gain of the controller, so no response can be recomputed from its
inputs; but what it prints can be held against its own equations for any motor. The motor that shows what consistent
values look like is an assumption of ours, named in the report; no verdict rests on it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
import scipy.stats

from examples import methods
from examples.audit_table import Row, compared, damping_of, document, missing, run, second_order_step, step_figures
from examples.maxon_re15 import text_rows
from firmloop.design.analysis.loop import Trajectory, closed_loop, margins
from firmloop.design.kinds import design
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize
from firmloop.identify.simulation.simulate import simulate

# Table 1: rise time s, overshoot %, settling time s, steady-state error %.
TABLE = {
    "open loop, order 1": (0.35, 22.8, 1.42, 8.5),
    "closed loop, order 1": (0.16, 7.0, 0.62, 0.7),
    "open loop, order 2": (0.39, 24.6, 1.5, 8.7),
    "closed loop, order 2": (0.18, 2.9, 0.6, 0.3),
}
ASSUMED = {  # a coreless motor of 15 mm and 6 V; the study gives none of these
    "R_ohm": 3.0,
    "L_H": 1e-4,
    "ke_V_s_rad": 6e-3,
    "kt_N_m_A": 6e-3,
    "J_kg_m2": 6e-8,
    "b_N_m_s_rad": 2e-8,
}
PERIOD, VOLTS, SECONDS = 1e-4, 6.0, 2.0  # s (the study samples at 10 kHz), V, s (of its figure 1)
TIME = np.arange(round(SECONDS / PERIOD)) * PERIOD


def motor(inductance: float, resistance: float = ASSUMED["R_ohm"]) -> Plant:
    """Return the assumed motor; without inductance it is of first order."""
    values = {**ASSUMED, "R_ohm": resistance, "L_H": {"value": inductance, "free": False}}
    return make_plant("dc_motor", "voltage_V", ["speed_rad_s"], values)


def open_loop(inductance: float, resistance: float = ASSUMED["R_ohm"]) -> tuple[np.ndarray, Mapping[str, float]]:
    """Return speed and step figures of a step of the rated voltage."""
    rows = make_recording(TIME, {"voltage_V": np.full(len(TIME), VOLTS)}, "simulated", "")
    speed = simulate(motor(inductance, resistance), rows, None)[:, 0]
    return speed, step_figures(TIME, speed, float(speed[-1]))


def controlled(inductance: float) -> tuple[Trajectory, Mapping[str, float], float]:
    """Tune a PI(D) by SIMC on the assumed motor: trajectory of a step to half speed, its figures and Ms."""
    plant = motor(inductance)
    wires = (Signal("reference", "rad/s", -1200.0, 1200.0), Signal("measurement", "rad/s", -1200.0, 1200.0))
    made = design(
        "pid", "re15", {"tune": "simc", "tau_c_s": 1e-3}, PERIOD, wires, (Signal("output", "V", -12.0, 12.0),), plant
    )
    linear = linearize(plant)
    path = closed_loop(made.law, linear, np.full(2000, 450.0))
    found = step_figures(path.time, path.measurement, 450.0)
    found["error"] = 100 * abs(1 - float(path.measurement[-1]) / 450.0)
    return path, found, margins(made.law, linear).sensitivity_peak


def rows() -> list[Row]:
    """Return every row."""
    figures = [*_open_loop(), *_closed_loop(), *_between(), *_statistics(), *_consistent(), *text_rows.rows()]
    return [*figures, *methods.rows(methods.RE15)]


def _open_loop() -> list[Row]:
    """Order 1 has no overshoot at all; order 2 has this one only with an armature no motor has."""
    rise, over, settling, error = TABLE["open loop, order 1"]
    lag = rise / math.log(9)
    made = [
        missing(
            "table 1",
            "open loop, order 1: rise time",
            f"{rise} s",
            "no parameter is given; as a first-order lag it means tau = rise/ln 9",
            f"tau = {lag:.3f} s",
        ),
        missing(
            "table 1", "open loop, order 1: overshoot", f"{over} %", "K/(tau s + 1) never passes its final value", "0 %"
        ),
        missing(
            "table 1",
            "open loop, order 1: settling time",
            f"{settling} s",
            "a first-order lag of that rise time is within 2 % after ln 50 tau, within 5 % after "
            f"{lag * math.log(20):.2f} s",
            f"{lag * math.log(50):.2f} s",
        ),
        missing(
            "table 1",
            "open loop, order 1: steady-state error",
            f"{error} %",
            "the normalized response of eq. 1 ends at 1 whatever its constants; without a set point there is no error",
            "0 %",
        ),
    ]
    rise, over, settling, error = TABLE["open loop, order 2"]
    damping = damping_of(over)
    natural, standard = _standard(rise, damping)
    made += [
        missing(
            "table 1",
            "open loop, order 2: overshoot",
            f"{over} %",
            f"eq. 1 overshoots by that with zeta = {damping:.3f}; with the rise time omega_n = {natural:.2f} rad/s. As "
            f"R/L + B/J = 2 zeta omega_n = {2 * damping * natural:.2f} 1/s, L/R would be at least "
            f"{1 / (2 * damping * natural):.2f} s; the assumed motor's is "
            f"{1e3 * ASSUMED['L_H'] / ASSUMED['R_ohm']:.2f} ms, and its response has no overshoot",
            "0 %",
        ),
        missing("table 1", "open loop, order 2: rise time", f"{rise} s", "no parameter is given", "-"),
        Row(
            "table 1",
            "open loop, order 2: settling time",
            f"{settling} s",
            f"{standard['settling_5']:.2f} to {standard['settling_2']:.2f} s",
            standard["settling_5"] * 0.95 <= settling <= standard["settling_2"] * 1.05,
            "of the standard form with that overshoot and rise time, 5 % to 2 % band (the band is not named)",
        ),
        missing("table 1", "open loop, order 2: steady-state error", f"{error} %", "as for order 1", "0 %"),
    ]
    return made


def _closed_loop() -> list[Row]:
    """With integral action the error ends at zero; rise, overshoot and settling must fit one another."""
    made = []
    for name in ("closed loop, order 1", "closed loop, order 2"):
        rise, over, settling, error = TABLE[name]
        damping = damping_of(over)
        natural, standard = _standard(rise, damping)
        tail = (SECONDS - settling) / math.log(2 / error)
        made += [
            missing(
                "table 1",
                f"{name}: rise time",
                f"{rise} s",
                "neither gains nor motor are given",
                f"omega_n = {natural:.1f} rad/s with that overshoot",
            ),
            missing(
                "table 1",
                f"{name}: overshoot",
                f"{over:g} %",
                "neither gains nor motor are given",
                f"zeta = {damping:.2f}",
            ),
            missing(
                "table 1",
                f"{name}: settling time",
                f"{settling} s",
                "of the standard form with that overshoot and rise time, 5 % and 2 % band; a PID may add a slow tail",
                f"{standard['settling_5']:.2f} and {standard['settling_2']:.2f} s",
            ),
            missing(
                "table 1",
                f"{name}: steady-state error",
                f"{error} %",
                f"a PID's integral leaves none; {error} % at the end of 2 s is a tail of time constant {tail:.1f} "
                "s, longer "
                "than the whole settling time",
                "0 %",
            ),
        ]
    return made


def _between() -> list[Row]:
    """Hold the study's sentences against its own table."""
    one, two = TABLE["open loop, order 1"], TABLE["open loop, order 2"]
    held, closed = TABLE["closed loop, order 1"], TABLE["closed loop, order 2"]
    fall = [100 * (1 - after[1] / before[1]) for before, after in ((one, held), (two, closed))]
    quick = [100 * (1 - after[2] / before[2]) for before, after in ((one, held), (two, closed))]
    return [
        compared("abstract", "rise time", 0.18, closed[0], "s", 2, "table 1, closed loop, order 2"),
        compared("abstract", "overshoot", 3.1, closed[1], "%", 2, "table 1 and the conclusion say 2.9 %"),
        compared("conclusion", "rise time", 0.18, closed[0], "s", 2, "table 1"),
        compared("conclusion", "overshoot", 2.9, closed[1], "%", 2, "table 1"),
        compared("conclusion", "settling time", 0.6, closed[2], "s", 1, "table 1"),
        compared("conclusion", "steady-state error", 0.3, closed[3], "%", 1, "table 1"),
        Row(
            "results",
            "overshoot reduced by more than 80 %",
            "> 80 %",
            f"{fall[0]:.0f} % and {fall[1]:.0f} %",
            min(fall) > 80,
            "orders 1 and 2 of table 1; the first as legible, 7 %",
        ),
        Row(
            "results",
            "settling time nearly halved",
            "< 50 %",
            f"{quick[0]:.0f} % and {quick[1]:.0f} %",
            max(quick) < 50,
            "table 1: more than halved",
        ),
        Row("discussion", "steady-state error below 1 %", "< 1 %", f"{held[3]} % and {closed[3]} %", True, "table 1"),
        missing(
            "results",
            "open loop is oscillatory",
            "oscillatory",
            "without a parameter it cannot be seen; the assumed motor has two real poles: (R J + L B)^2 is "
            f"{_overdamped():.0f} times 4 L J (R B + K^2)",
            "no oscillation",
        ),
        missing(
            "fig. 1",
            "step responses over 2 s",
            "four curves",
            "no parameter and no gain to draw them from; drawn here for the assumed motor",
            "figure_1.svg",
        ),
        missing(
            "fig. 1 of the data set", "caption of a convolution layer", "deep learning", "belongs to another paper"
        ),
        Row(
            "eq. 1",
            "w(s)/V(s) = K/((Js + B)(Ls + R) + K^2)",
            "transfer function",
            "the same",
            _equation_holds(),
            "state space of dc_motor with ke = kt = K, at 5 frequencies",
        ),
        missing(
            "eq. 2",
            "G(s) = Kp + Ki/s + Kd s",
            "a PID",
            "improper: no circuit and no program can be it; controller.kind = 'pid' filters the derivative over Td/10",
            "Kp + Ki/s + Kd s/(Td/10 s + 1)",
        ),
        Row(
            "experiment",
            "sampling frequency",
            "10 kHz",
            f"{PERIOD * 1e3:g} ms",
            True,
            "the period of the loops below",
        ),
    ]


def _overdamped() -> float:
    """Return the ratio above 1 of which the denominator of eq. 1 has two real roots, for the assumed motor."""
    r, inductance, k, _, j, b = ASSUMED.values()
    return (r * j + inductance * b) ** 2 / (4 * inductance * j * (r * b + k * k))


def _statistics() -> list[Row]:
    factor = float(scipy.stats.t.ppf(0.975, 2)) / math.sqrt(3)
    return [
        missing(
            "statistics",
            "confidence intervals from n = 3",
            "not printed",
            "with three repeats the 95 % interval is t(0.975, 2)/sqrt(3) deviations to each side",
            f"+- {factor:.2f} s",
        ),
        missing("abstract", "deviation from hardware", "< 5 %", "no measured figure is printed beside a simulated one"),
        missing("statistics", "R2", "> 0.95", "no measured data"),
        missing("statistics", "MAE, RMSE", "not printed", "named, but no number is given"),
        missing("discussion", "fuzzy PID and MPC better by", "< 3 %", "no number of either is given"),
        missing(
            "statistics",
            "sensitivity to L and R",
            "not printed",
            "of the assumed motor: L + 10 % and R + 10 % move the rise time by",
            _sensitivity(),
        ),
        missing(
            "tuning", "gains of the PID", "not printed", "Ziegler-Nichols, then trial and error: no value is given"
        ),
    ]


def _consistent() -> list[Row]:
    """Show what such a table looks like for a motor of this size."""
    made = []
    for order, inductance in ((1, 0.0), (2, ASSUMED["L_H"])):
        _, free = open_loop(inductance)
        _, loop, peak = controlled(inductance)
        open_text = f"{1e3 * free['rise']:.1f} ms, {free['overshoot']:.1f} %, {1e3 * free['settling_2']:.1f} ms"
        shown = f"{1e3 * loop['rise']:.1f} ms, {loop['overshoot']:.1f} %, {1e3 * loop['settling_2']:.1f} ms"
        loop_text = f"{shown}, {loop['error']:.2f} %"
        printed = " / ".join(str(x) for x in TABLE[f"open loop, order {order}"])
        made.append(
            missing(
                "table 1",
                f"whole row, open loop, order {order}",
                printed,
                "assumed motor: rise, overshoot, 2 %",
                open_text,
            )
        )
        printed = " / ".join(str(x) for x in TABLE[f"closed loop, order {order}"])
        made.append(
            missing(
                "table 1",
                f"whole row, closed loop, order {order}",
                printed,
                f"assumed motor, SIMC at 10 kHz, Ms {peak:.2f}: rise, overshoot, 2 %, error",
                loop_text,
            )
        )
    return made


def _standard(rise: float, damping: float) -> tuple[float, Mapping[str, float]]:
    """Return omega_n of the standard form with that rise time, and its step figures."""
    unit = np.arange(0.0, 40.0, 1e-3)
    found = step_figures(unit, second_order_step(unit, 1.0, damping), 1.0)
    scale = rise / found["rise"]
    return 1 / scale, {name: value * (scale if name != "overshoot" else 1) for name, value in found.items()}


def _equation_holds() -> bool:
    linear = linearize(motor(ASSUMED["L_H"]))
    r, inductance, k, _, j, b = ASSUMED.values()
    for w in (1.0, 30.0, 200.0, 3e3, 3e4):
        s = 1j * w
        ours = (linear.c @ np.linalg.solve(s * np.eye(2) - linear.a, linear.b))[0, 0]
        if abs(ours / (k / ((j * s + b) * (inductance * s + r) + k * k)) - 1) > 1e-9:
            return False
    return True


def _sensitivity() -> str:
    base = open_loop(ASSUMED["L_H"])[1]["rise"]
    more = open_loop(1.1 * ASSUMED["L_H"])[1]["rise"]
    hot = open_loop(ASSUMED["L_H"], 1.1 * ASSUMED["R_ohm"])[1]["rise"]
    return f"{100 * (more / base - 1):+.2f} %, {100 * (hot / base - 1):+.1f} %"


def report() -> str:
    """Write the whole report."""
    assumed = ", ".join(f"{name} {value:g}" for name, value in ASSUMED.items())
    notes = [f"Assumed motor, where one is needed to show a consistent value: {assumed}."]
    return document("Audit: modeling and simulation of the Maxon RE 15", notes, rows())


def figures(folder: Path) -> Sequence[str]:
    """Draw figure 1 for the assumed motor, normalized as the study's."""
    figure, axes = plt.subplots(figsize=(7, 4))
    for order, inductance in ((1, 0.0), (2, ASSUMED["L_H"])):
        speed, _ = open_loop(inductance)
        path, _, _ = controlled(inductance)
        axes.plot(1e3 * TIME[:400], speed[:400] / speed[-1], label=f"open loop, order {order}")
        axes.plot(1e3 * path.time[:400], path.measurement[:400] / 450.0, label=f"closed loop, order {order}")
    axes.set(xlabel="time, ms", ylabel="angular speed (normalized)", title="Step responses, assumed motor")
    axes.legend()
    figure.savefig(folder / "figure_1.svg")
    plt.close(figure)
    return ["figure_1.svg"]


if __name__ == "__main__":
    run(__doc__ or "", report, figures)
