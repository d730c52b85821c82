"""Recompute every table and figure of the L3510 study from its stated inputs, and say which cannot be right.

python -m examples.baldor_l3510.audit [--out DIR]
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from examples import methods
from examples.audit_table import Row, document, run, second_order_step
from examples.baldor_l3510 import cost_rows, datasheet_rows, model_rows, stated, text_rows
from examples.baldor_l3510.motor import circuit, inertia_of_start, start_up

CIRCUIT = "main_L_H rotor_R_ohm magnetizing_L_H turns_ratio aux_L_H"


def rows() -> list[Row]:
    """Return every row."""
    figures = [*datasheet_rows.rows(), *model_rows.rows(), *text_rows.rows(), *cost_rows.rows()]
    return [*figures, *methods.rows(methods.L3510)]


def notes() -> list[str]:
    """Say what stands behind the simulated motor."""
    value, friction = circuit()
    name, share = datasheet_rows.worst_fitted()
    found = ", ".join(f"{name} {value[name]:.2g}" for name in CIRCUIT.split())
    return [
        f"Motor nearest to the datasheet (double revolving field, least squares): {found}, friction {friction:.0f} W. "
        f"It misses single figures of the datasheet by up to {share:.0%} ({name}).",
        f"Inertia with which its simulated start settles in 0.85 s: {inertia_of_start():.3f} kg m^2.",
    ]


def report() -> str:
    """Write the whole report."""
    return document("Audit: first- and second-order models of the Baldor L3510", notes(), rows())


def figures(folder: Path) -> Sequence[str]:
    """Draw figures 3 and 5 as the printed models give them, beside the simulated motor."""
    time, speed = start_up(inertia_of_start())
    _, aged = start_up(inertia_of_start(), 0.9 * stated.C_START)
    top = stated.K1 * stated.VOLTS
    numerator, pole = stated.RESULTS_G1
    top_printed = numerator / pole * stated.VOLTS
    curves = {
        "figure_3.svg": [
            ("G1 = 0.79/(0.20 s + 1)", top * (1 - np.exp(-time / stated.TAU))),
            ("G1 = 0.20/(s + 10.79)", top_printed * (1 - np.exp(-pole * time))),
            ("motor of this datasheet, simulated", speed),
        ],
        "figure_5.svg": [
            ("G2 = 28.4/(s^2 + 9.6 s + 36)", stated.NUMERATOR / 36 * stated.VOLTS * second_order_step(time, 6.0, 0.8)),
            ("motor of this datasheet, simulated", speed),
            ("the same, 306 uF", aged),
        ],
    }
    for name, drawn in curves.items():
        figure, axes = plt.subplots(figsize=(7, 4))
        for label, values in drawn:
            axes.plot(time, values, label=label)
        axes.axhline(stated.STEADY_SPEED, linestyle=":", color="gray", label="183.3 rad/s, measured")
        axes.set(xlabel="time, s", ylabel="speed, rad/s", title=f"L3510, 115 V step: {name[:-4].replace('_', ' ')}")
        axes.legend()
        figure.savefig(folder / name)
        plt.close(figure)
    return list(curves)


if __name__ == "__main__":
    run(__doc__ or "", report, figures)
