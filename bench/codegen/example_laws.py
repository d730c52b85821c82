"""Give the laws that are measured: a PID with every part in use, one that is tuned in mid-run, every kind's example."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType

import numpy as np

from firmloop.design.kinds import design, kinds
from firmloop.design.law import Law
from firmloop.identify.signal import Signal

CHANGED: dict[str, dict[str, object]] = {  # in kinds' examples
    "mpc": {"budget": 40},
    "nmpc": {"warm_start": True, "iterations": 3},
}


def example_law() -> Law:
    """Return a PID with every part in use: weights, filtered derivative, limits, back-calculation."""
    table = {"kp": 0.05, "ki": 1.4, "kd": 0.0004, "tf_s": 0.01, "tt_s": 0.05, "b": 0.7, "c": 0.2}
    inputs = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
    return design("pid", "motor_pid", table, 0.001, inputs, (Signal("output", "V", -12.0, 12.0),), None).law


def dense_law(order: int) -> Law:
    """Return a stable state space in which every state reads every state."""
    random = np.random.default_rng(order)
    a = random.standard_normal((order, order))
    a *= 0.9 / np.max(np.abs(np.linalg.eigvals(a)))
    table = {"A": a.tolist(), "B": [[1.0]] * order, "C": [[1.0 / order] * order]}
    inputs, outputs = (Signal("y", "1", -1.0, 1.0),), (Signal("u", "1", -100.0, 100.0),)
    return design("state_space", "dense", table, 0.001, inputs, outputs, None).law


@cache
def laws() -> Mapping[str, Law]:
    """Return the PID with every part in use, one with parameters that are tuned, and every kind's example.

    The predictive one gets a budget that some searches exceed: the one that its ranges ask for is never exceeded, so
    nothing could tell a flag that never rises from one that says so. Nor could it one that never falls, as with a
    nonlinear one that takes one step from no plan: that one takes three, from the plan of the sample before.
    """
    table = {"kp": 0.05, "ki": 1.4, "tt_s": 0.05, "tunable": ["kp", "ki"], "ranges": {"kp": [0, 0.2], "ki": [0, 5]}}
    full = example_law()
    tuned = design("pid", "tuned_pid", table, 0.001, full.inputs, full.outputs, None).law
    own = {
        name: kind.design(replace(kind.example, table=kind.example.table | CHANGED.get(name, {}))).law
        for name, kind in kinds().items()
    }
    return MappingProxyType({"full pid": full, "tuned pid": tuned} | own)
