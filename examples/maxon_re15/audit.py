"""Recompute every table and figure of the RE 15 study from its stated inputs, and say which cannot be right.

    python -m examples.maxon_re15.audit [--out DIR]

The study prints no parameter of the motor and no gain of the controller, so no response can be recomputed from its
inputs; but what it prints can be held against its own equations for any motor. The motor that shows what consistent
values look like is an assumption of ours, named in the report; no verdict rests on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
import scipy.stats

from examples import methods
from examples.audit_table import (
    Row,
    document,
    implied,
    judged,
    repeated,
    run,
    stated,
)
from examples.maxon_re15 import table_rows, text_rows
from examples.maxon_re15.motor import ASSUMED, TIME, controlled, motor, open_loop
from examples.maxon_re15.published import ABSTRACT, CONCLUSION, SAMPLING_KHZ, TABLE, Printed
from firmloop.identify.simulation.linearize import linearize


def rows() -> list[Row]:
    """Return every row."""
    figures = [*table_rows.rows(), *_between(), *_statistics(), *_consistent(), *text_rows.rows()]
    return [*figures, *methods.rows(methods.RE15)]


def _between() -> list[Row]:
    """Hold the study's sentences against its own table."""
    closed = TABLE["closed loop, order 2"]
    pairs = [(TABLE[f"open loop, order {k}"], TABLE[f"closed loop, order {k}"]) for k in (1, 2)]
    fall = [100 * (1 - float(after.overshoot) / float(before.overshoot)) for before, after in pairs]
    quick = [100 * (1 - float(after.settling) / float(before.settling)) for before, after in pairs]
    again = [
        repeated(place, name, f"{printed} {unit}", f"{row} {unit}", "table 1, closed loop, order 2")
        for place, says in (("abstract", ABSTRACT), ("conclusion", CONCLUSION))
        for name, printed, unit, row in (
            ("rise time", says.rise, "s", closed.rise),
            ("overshoot", says.overshoot, "%", closed.overshoot),
            ("settling time", says.settling, "s", closed.settling),
            ("steady-state error", says.error, "%", closed.error),
        )
        if printed
    ]
    return [
        *again,
        judged(
            "results",
            "overshoot reduced by more than 80 %",
            "> 80 %",
            lambda: (f"{fall[0]:.0f} % and {fall[1]:.0f} %", min(fall) > 80),
            "orders 1 and 2 of table 1; the first as legible, 7 %",
        ),
        judged(
            "results",
            "settling time nearly halved",
            "< 50 %",
            lambda: (f"{quick[0]:.0f} % and {quick[1]:.0f} %", max(quick) < 50),
            "table 1: more than halved",
        ),
        judged(
            "discussion",
            "steady-state error below 1 %",
            "< 1 %",
            lambda: (
                " and ".join(f"{after.error} %" for _, after in pairs),
                max(float(after.error) for _, after in pairs) < 1,
            ),
            "table 1",
        ),
        judged(
            "results",
            "open loop is oscillatory",
            "oscillatory",
            lambda: (f"(R J + L B)^2 is {_overdamped():.0f} times 4 L J (R B + K^2)", _overdamped() < 1),
            "without a parameter it cannot be seen; below 1 it would be, and the assumed motor has two real poles",
        ),
        stated(
            "fig. 1",
            "step responses over 2 s",
            "four curves",
            "no parameter and no gain to draw them from; figure_1.svg draws them for the assumed motor",
        ),
        stated("fig. 1 of the data set", "caption of a convolution layer", "deep learning", "belongs to another paper"),
        judged(
            "eq. 1",
            "w(s)/V(s) = K/((Js + B)(Ls + R) + K^2)",
            "transfer function",
            lambda: (f"within {_equation_misses():.0e}", _equation_misses() < 1e-9),
            "state space of dc_motor with ke = kt = K, at 5 frequencies",
        ),
        judged(
            "eq. 2",
            "G(s) = Kp + Ki/s + Kd s",
            "a PID",
            _improper,
            "improper: no circuit and no program can be it; controller.kind = 'pid' filters the derivative over Td/10",
        ),
        judged(
            "experiment",
            "sampling frequency",
            f"{SAMPLING_KHZ} kHz",
            lambda: _samples_of_rise(float(SAMPLING_KHZ)),
            "samples within the shortest rise of table 1: ten or more tell it",
        ),
    ]


def _improper() -> tuple[str, bool]:
    """Tell how the magnitude of eq. 2 grows with frequency, and whether it is bounded."""
    s = 1j * np.array([1e3, 1e6])
    low, high = np.abs(1 + 1 / s + s)
    return f"{high / low:.0f} times the magnitude at 1000 times the frequency", bool(high / low < 2)


def _samples_of_rise(kilohertz: float) -> tuple[str, bool]:
    count = min(float(row.rise) for row in TABLE.values()) * 1e3 * kilohertz
    return f"{count:.0f} samples", count >= 10


def _overdamped() -> float:
    """Return the ratio above 1 of which the denominator of eq. 1 has two real roots, for the assumed motor."""
    r, inductance, k, _, j, b = ASSUMED.values()
    return (r * j + inductance * b) ** 2 / (4 * inductance * j * (r * b + k * k))


def _statistics() -> list[Row]:
    factor = float(scipy.stats.t.ppf(0.975, 2)) / math.sqrt(3)
    return [
        implied(
            "statistics",
            "confidence intervals from n = 3",
            "not printed",
            lambda: f"+- {factor:.2f} s",
            "with three repeats the 95 % interval is t(0.975, 2)/sqrt(3) deviations to each side",
        ),
        stated("abstract", "deviation from hardware", "< 5 %", "no measured figure is printed beside a simulated one"),
        stated("statistics", "R2", "> 0.95", "no measured data"),
        stated("statistics", "MAE, RMSE", "not printed", "named, but no number is given"),
        stated(
            "discussion",
            "fuzzy PID and MPC better by",
            "< 3 %",
            "no number of either is given; python -m examples.maxon_re15.compare holds all of them against one motor",
        ),
        implied(
            "statistics",
            "sensitivity to L and R",
            "not printed",
            _sensitivity,
            "of the assumed motor: L + 10 % and R + 10 % move the rise time by",
        ),
        stated("tuning", "gains of the PID", "not printed", "Ziegler-Nichols, then trial and error: no value is given"),
    ]


def _consistent() -> list[Row]:
    """Show what such a table looks like for a motor of this size."""
    made = []
    for order, inductance in ((1, 0.0), (2, ASSUMED["L_H"])):
        made += [
            implied(
                "table 1",
                f"whole row, {name}, order {order}",
                " / ".join(getattr(TABLE[f"{name}, order {order}"], key) for key in Printed.__slots__),
                lambda shown=shown, inductance=inductance: shown(inductance),
                why,
            )
            for name, shown, why in (
                ("open loop", _open_text, "assumed motor: rise, overshoot, 2 %"),
                ("closed loop", _closed_text, "assumed motor, SIMC at 10 kHz: rise, overshoot, 2 %, error, Ms"),
            )
        ]
    return made


def _open_text(inductance: float) -> str:
    found = open_loop(inductance)[1]
    return f"{1e3 * found['rise']:.1f} ms, {found['overshoot']:.1f} %, {1e3 * found['settling_2']:.1f} ms"


def _closed_text(inductance: float) -> str:
    _, found, peak = controlled(inductance)
    shown = f"{1e3 * found['rise']:.1f} ms, {found['overshoot']:.1f} %, {1e3 * found['settling_2']:.1f} ms"
    return f"{shown}, {found['error']:.2f} %, {peak:.2f}"


def _equation_misses() -> float:
    """Return by how much, relatively, dc_motor's state space is off eq. 1 at most, at five frequencies."""
    linear = linearize(motor(ASSUMED["L_H"]))
    r, inductance, k, _, j, b = ASSUMED.values()
    off = []
    for w in (1.0, 30.0, 200.0, 3e3, 3e4):
        s = 1j * w
        ours = (linear.c @ np.linalg.solve(s * np.eye(2) - linear.a, linear.b))[0, 0]
        off.append(abs(ours / (k / ((j * s + b) * (inductance * s + r) + k * k)) - 1))
    return float(max(off))


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
