"""The methods both studies name, and where firmloop does them."""

from __future__ import annotations

from examples.audit_table import OFFERED, Row

SHARED = (
    ("step response: first and second order", 'plant.kind = "first_order", "second_order"; identify, 95 % intervals'),
    (
        "simulated against measured",
        "firmloop identify and simulate: rms, fit %, R2 of train and unseen test recordings",
    ),
    (
        "steady-state error, rise, settling, overshoot",
        "firmloop design: step metrics of the closed loop, 2 and 5 % bands",
    ),
    ("PID", 'controller.kind = "pid", to C in every format'),
    ("fuzzy PID", 'controller.kind = "fuzzy_pid"'),
    ("self-tuning, adaptive control", 'controller.kind = "self_tuning": recursive least squares'),
    ("resistance that drifts with heat", '[[plant.effects]] "resistance_heating"; rise_K_per_W of the induction motor'),
    (
        "Coulomb friction, saturation",
        '[[plant.effects]] "coulomb_friction", "inductance_saturation"; firmloop diagnose',
    ),
    ("load changes", '[[plant.effects]] "load_step"; firmloop diagnose finds size and moment'),
)
RE15 = (
    ("transfer function and state space of both orders", 'plant.kind = "dc_motor", L_H = 0 or not'),
    (
        "Savitzky-Golay filter, time alignment",
        "[recordings.conditioning] savgol_window, align: on the model too, so no bias",
    ),
    ("gain scheduling", 'controller.kind = "gain_schedule"'),
    ("sensorless speed", 'controller.kind = "sensorless_speed": observer from voltage and current'),
    ("gear backlash", '[[plant.effects]] "backlash"'),
)
L3510 = (
    ("double revolving field", "identify/revolving_field.py: steady state with both windings"),
    ("d-q model of the single-phase motor", 'plant.kind = "single_phase_induction_motor": capacitor, switch, heat'),
    ("three-phase d-q model for comparison", 'plant.kind = "three_phase_induction_motor"'),
    ("no-load, locked-rotor and direct-current tests", "identify/induction_tests.py, each formula with its source"),
    ("sliding mode", 'controller.kind = "sliding_mode" with boundary layer'),
    ("capacitor health, regime without a preset time", 'controller.kind = "start_monitor"; bench/start_monitor'),
)


def rows(own: tuple[tuple[str, str], ...]) -> list[Row]:
    """Return one row a method."""
    return [
        Row(OFFERED, name, "used or proposed", ours, True, "what firmloop offers for it")
        for name, ours in (*SHARED, *own)
    ]
