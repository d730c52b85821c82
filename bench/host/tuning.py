"""Hold the loop of every tuning rule, on several plants, against python-control's.

    python -m bench.host.tuning [--quick]

Of each loop Ms, gain margin and phase margin are compared, within 1 %, with those of a loop that python-control makes
from the formulas of the controller and its own sampled plant. The rules that optimize are asked for several Ms, which
has to be kept on python-control's loop too. `--quick` takes one Ms. Exit status 1 where a margin is
further off, a verdict on stability differs, or an Ms is not met.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import control
import numpy as np

from firmloop.design.analysis.contest import Entry, contest
from firmloop.design.design import Request
from firmloop.design.tuning import rules
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize

SEARCHING, PEAKS, USUAL = ("ise", "iae", "itae"), (1.3, 1.6, 2.0), 1.6
MOTOR = {"R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}


@dataclass(frozen=True, slots=True)
class Case:
    """A plant, how often it is sampled (s), and keys of rules without which they cannot tune it."""

    plant: Plant
    period: float
    keys: dict[str, object]


def lag(gain: float, time_constant: float, delay: float) -> Plant:
    """Return a lag with delay."""
    values = {"gain": gain, "time_constant_s": time_constant, "delay_s": delay}
    return make_plant("first_order", "voltage_V", ["tank_C"], values)


def swing(gain: float, natural: float, damping: float) -> Plant:
    """Return a plant of second order."""
    values = {"gain": gain, "natural_frequency_rad_s": natural, "damping_ratio": damping, "delay_s": 0.0}
    return make_plant("second_order", "voltage_V", ["tank_C"], values)


CASES = {
    "first order": Case(lag(2.0, 3.0, 0.0), 0.1, {}),
    "second order": Case(swing(3.0, 2.0, 0.9), 0.05, {}),
    "delay": Case(lag(-0.5, 1.0, 3.0), 0.1, {}),
    "integrating": Case(make_plant("dc_motor", "voltage_V", ["position_rad"], MOTOR), 0.001, {"terms": "pid"}),
    "dc motor": Case(make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR), 0.001, {}),
}


def tuned(case: Case, names: tuple[str, ...], own: dict[str, dict[str, object]]) -> tuple[Entry, ...]:
    """Tune by each rule; `own` are keys of single ones."""
    unit = case.plant.outputs[0].unit
    wires = tuple(Signal(name, unit, -40.0, 40.0) for name in ("reference", "measurement"))
    drive = (Signal("output", "V", -10.0, 10.0),)
    whole = {name: {**(case.keys if name != "lambda" else {}), **own.get(name, {})} for name in names}
    return contest(Request("x", {}, case.period, wires, drive, case.plant), names, whole)


def by_control(case: Case, gains: dict[str, float]) -> tuple[bool, float, float, float]:
    """Return whether python-control's loop is stable, its Ms, gain margin (a factor) and phase margin (degrees)."""
    linear, h = linearize(case.plant), case.period
    z, tf = control.tf([1, 0], [1], h), gains.get("tf_s", 0.0)
    pid = gains["kp"] + gains["ki"] * h / (z - 1) + gains["kd"] * (z - 1) / ((tf + h) * z - tf)
    sampled = control.tf(control.c2d(control.ss(linear.a, linear.b, linear.c, linear.d), h, "zoh"))
    loop = control.minreal(pid * sampled / z ** round(linear.delay / h), verbose=False)
    grid = np.geomspace(1e-4 * math.pi / h, math.pi / h, 4_000)
    answer = loop(np.exp(1j * grid * h))
    factors, phases, *_ = control.stability_margins(control.frd(answer, grid, smooth=True), returnall=True)
    rises = [factor for factor in (*factors, -1 / answer[-1].real) if factor > 1]  # the curve ends at half the rate
    stable = bool(np.all(np.abs(control.feedback(loop, 1).poles()) < 1))
    peak = int(np.argmin(np.abs(1 + answer)))
    near = np.geomspace(grid[max(peak - 1, 0)], grid[min(peak + 1, len(grid) - 1)], 1_000)
    ms = float(np.max(np.abs(1 / (1 + loop(np.exp(1j * near * h))))))
    return stable, ms, min(rises, default=math.inf), float(min(phases, key=abs))


def compared(name: str, case: Case) -> int:
    """Print how far the margins of every rule are from python-control's; return how many are further than 1 %."""
    apart, refused, swinging, beyond = {}, [], [], 0
    for entry in tuned(case, tuple(rules()), {}):
        if entry.design is None or entry.margins is None:
            refused.append(entry.rule)
            continue
        stable, *theirs = by_control(case, dict(entry.design.gains))
        if not (stable and entry.margins.stable):
            swinging.append(entry.rule)
            beyond += stable != entry.margins.stable
            continue
        ours = (
            entry.margins.sensitivity_peak,
            10 ** (entry.margins.gain_margin_db / 20),
            entry.margins.phase_margin_deg,
        )
        apart[entry.rule] = max(abs(a / b - 1) for a, b in zip(ours, theirs, strict=True) if a != b)
    worst = max(apart, key=lambda rule: apart[rule])
    says = f"{len(apart)} rules within {100 * apart[worst]:.2g} % ({worst})"
    says += f", unstable by both: {', '.join(swinging)}" if swinging else ""
    print(f"{name:13} margins  {says}" + (f", not for it: {', '.join(refused)}" if refused else ""), flush=True)
    return beyond + sum(share > 0.01 for share in apart.values())


def met(name: str, case: Case, peaks: tuple[float, ...]) -> int:
    """Print the Ms that optimized loops have of what was asked; return how many have more."""
    missed = 0
    for peak in peaks:
        words = []
        for entry in tuned(case, SEARCHING, {rule: {"ms_max": peak} for rule in SEARCHING}):
            if entry.design is None or entry.margins is None:
                words.append(f"{entry.rule} refused")
                missed += 1
                continue
            _, ms, *_ = by_control(case, dict(entry.design.gains))
            words.append(f"{entry.rule} {ms:.4f}")
            missed += max(ms, entry.margins.sensitivity_peak) > peak
        print(f"{name:13} Ms <= {peak:g}  {', '.join(words)}", flush=True)
    return missed


def main() -> int:
    """Print one line a plant, and one an Ms."""
    peaks = (USUAL,) if "--quick" in sys.argv else PEAKS
    missed = sum(compared(name, case) + met(name, case, peaks) for name, case in CASES.items())
    print("all margins within 1 %, every Ms met" if not missed else f"{missed} figures are off")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
