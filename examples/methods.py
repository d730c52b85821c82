"""The methods both studies name, and where firmloop does them."""

from __future__ import annotations

from examples.audit_table import OFFERED, Row

SHARED = (
    (
        "step response: first and second order",
        'firmloop identify, plant.kind = "first_order", "second_order", "process"',
    ),
    ("63 % point, two points, Sundaresan, overshoot", "firmloop step: models read off the curve, with their intervals"),
    ("simulated against measured", "firmloop identify, simulate: rmse, fit %, R2, MAE of train and unseen recordings"),
    (
        "rise, settling, overshoot, steady-state error",
        "firmloop step of a recording, firmloop design of the closed loop",
    ),
    ("MAE, RMSE, R2", "firmloop identify --json, firmloop examine"),
    ("residual analysis", "firmloop examine: whiteness, independence of the input, bias"),
    (
        "confidence intervals, Monte Carlo of 10,000 draws",
        "firmloop examine --draws 10000: covariance, both redrawings",
    ),
    ("repeated trials", "firmloop step with three recordings or more: Student's t"),
    ("parameter sensitivity", "firmloop examine: one at a time and Sobol shares"),
    ("parameters from the datasheet", "firmloop datasheet: units converted, contradictions named, with the tolerance"),
    ("PID", 'firmloop generate, controller.kind = "pid", to C in every format'),
    ("tuning of the PID", "firmloop tune: Ziegler-Nichols twice, SIMC, AMIGO, ISE and more in one table"),
    ("fuzzy PID", 'firmloop generate, controller.kind = "fuzzy_pid"'),
    ("self-tuning, adaptive control", 'firmloop generate, controller.kind = "self_tuning": recursive least squares'),
    ("resistance that drifts with heat", 'firmloop diagnose names "resistance_heating", in both motors'),
    ("Coulomb friction", 'firmloop diagnose names "coulomb_friction"'),
    (
        "magnetic saturation",
        'firmloop diagnose: "magnetizing_saturation", "inductance_saturation", "torque_constant_saturation"',
    ),
    ("load changes", 'firmloop diagnose: "load_step", its size and moment'),
)
RE15 = (
    ("transfer function and state space of both orders", "firmloop datasheet prints both of each order"),
    ("no-load, locked-rotor, step and coast-down tests", "firmloop datasheet, [standard_tests]"),
    (
        "Savitzky-Golay filter, time alignment, normalization",
        "[recordings.conditioning]: on the model too, so no bias; firmloop examine tells its effect",
    ),
    ("gain scheduling", 'firmloop generate, controller.kind = "gain_schedule"'),
    ("model predictive control", 'firmloop generate, controller.kind = "mpc"'),
    ("sensorless speed", 'firmloop generate, controller.kind = "sensorless_speed": observer from voltage and current'),
    ("all of these on one motor and load", "python -m examples.maxon_re15.compare: one table, instructions counted"),
    ("gear backlash", 'firmloop diagnose: "backlash"'),
)
L3510 = (
    ("double revolving field", "python -m examples.baldor_l3510.audit: steady state with both windings"),
    ("d-q model of the single-phase motor", 'firmloop simulate, plant.kind = "single_phase_induction_motor"'),
    ("three-phase d-q model for comparison", 'firmloop simulate, plant.kind = "three_phase_induction_motor"'),
    (
        "no-load, locked-rotor and direct-current tests",
        "identify/bench_tests/induction_tests.py, each formula with its source",
    ),
    ("spectral filtering of line harmonics", "[recordings.conditioning] line_Hz; firmloop examine tells its effect"),
    ("capacitor ageing", 'firmloop diagnose: "capacitor_ageing"'),
    ("sliding mode", 'firmloop generate, controller.kind = "sliding_mode" with boundary layer'),
    ("capacitor health, regime without a preset time", 'firmloop generate, controller.kind = "start_monitor"'),
)


def rows(own: tuple[tuple[str, str], ...]) -> list[Row]:
    """Return one row a method."""
    return [
        Row(OFFERED, name, "used or proposed", ours, "offered", "what firmloop offers for it")
        for name, ours in (*SHARED, *own)
    ]
