"""Every controller kind a second time: the formulas of the contract and of the kinds' docstrings in plain numpy.

Nothing here comes from `design`: each function takes the request's table and rows of inputs (n, m), and returns the
outputs (n, r). A kind without a function here fails the tests of every kind.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import scipy.linalg
import scipy.signal

from firmloop.design.design import Request
from firmloop.design.kinds import cascade as cascade_kind
from firmloop.design.kinds.foc.wires import INPUTS
from firmloop.identify.signal import Signal
from tests import motor_formulas
from tests.pid_formula import pid_steps


def clip(v: Any, request: Request) -> np.ndarray:
    low = np.broadcast_to(request.table.get("u_min", [wire.low for wire in request.outputs]), len(request.outputs))
    high = np.broadcast_to(request.table.get("u_max", [wire.high for wire in request.outputs]), len(request.outputs))
    return np.minimum(np.maximum(v, low), high)


def filtered(b: Any, a: Any, request: Request, rows: np.ndarray) -> np.ndarray:
    """Run b/a in powers of z, highest first, on r - y or on the one input."""
    b, a = np.atleast_1d(b), np.atleast_1d(a)
    e = rows[:, 0] - rows[:, 1] if rows.shape[1] > 1 else rows[:, 0]
    b = np.concatenate([np.zeros(len(a) - len(b)), b])
    return clip(scipy.signal.lfilter(b, a, e)[:, None], request)


def sampled(b: Any, a: Any, request: Request, usual: str, prewarp: float) -> tuple[Any, Any]:
    h, method = request.period, request.table.get("discretize", usual)
    if method == "prewarp":
        w = float(request.table.get("prewarp_rad_s", prewarp))
        return scipy.signal.bilinear(b, a, fs=w / (2 * math.tan(w * h / 2)))
    if method == "tustin":
        return scipy.signal.bilinear(b, a, fs=1 / h)
    found = scipy.signal.cont2discrete((b, a), h, {"zoh": "zoh", "backward": "backward_diff"}[method])
    return found[0].ravel(), found[1]


def transfer_function(request: Request, rows: np.ndarray) -> np.ndarray:
    b, a = request.table["numerator"], request.table["denominator"]
    if request.table.get("domain", "z") == "s":
        b, a = sampled(b, a, request, "tustin", 0.0)
    return filtered(b, a, request, rows)


def lead_lag(request: Request, rows: np.ndarray) -> np.ndarray:
    table = request.table
    if "phase_deg" in table:
        phi = math.radians(table["phase_deg"])
        ratio = math.tan(math.pi / 4 + phi / 2)
        zero, pole = table["frequency_rad_s"] / ratio, table["frequency_rad_s"] * ratio
    else:
        zero, pole = table["zero_rad_s"], table["pole_rad_s"]
    gain = table.get("gain", 1.0)
    return filtered(*sampled([gain / zero, gain], [1 / pole, 1], request, "tustin", 0.0), request, rows)


def notch(request: Request, rows: np.ndarray) -> np.ndarray:
    table = request.table
    w = table["frequency_rad_s"] if "frequency_rad_s" in table else 2 * math.pi * table["frequency_hz"]
    g, d, k = table.get("damping", 0.5), table.get("depth", 0.0), table.get("gain", 1.0)
    b, a = np.array([1, 2 * d * g * w, w * w]) * k, [1, 2 * g * w, w * w]
    return filtered(*sampled(b, a, request, "prewarp", w), request, rows)


def state_space(request: Request, rows: np.ndarray) -> np.ndarray:
    a, b, c = (np.array(request.table[key], float) for key in "ABC")
    d = np.array(request.table.get("D", np.zeros((len(c), rows.shape[1]))), float)
    x, found = np.zeros(len(a)), []
    for z in rows:
        found.append(clip(c @ x + d @ z, request))
        x = a @ x + b @ z
        x = np.minimum(np.maximum(x, request.table.get("x_min", -np.inf)), request.table.get("x_max", np.inf))
    return np.array(found)


def lqg(table: Any, h: float) -> tuple[Any, ...]:
    """A, B, C, K, N, ki and L of the form of the example: SISO, weights, integral action, Kalman predictor."""
    a, b, c = (np.array(table[key], float) for key in "ABC")
    n = len(a)
    ring = np.block([[a, np.zeros((n, 1))], [-h * c, np.ones((1, 1))]])
    drive, r = np.vstack([b, [[0.0]]]), np.array([[table["R"]]])
    s = scipy.linalg.solve_discrete_are(ring, drive, np.diag([*table["Q"], table["integral_weight"]]), r)
    whole = np.linalg.solve(r + drive.T @ s @ drive, drive.T @ s @ ring)[0]
    gain, ki = whole[:n], -whole[n]
    p = scipy.linalg.solve_discrete_are(a.T, c.T, np.diag(table["process_noise"]), [[table["measurement_noise"]]])
    correction = (a @ p @ c.T / (c @ p @ c.T + table["measurement_noise"]))[:, 0]
    rest = np.linalg.solve(np.block([[a - np.eye(n), b], [c, np.zeros((1, 1))]]), [*np.zeros(n), 1.0])
    return a, b, c, gain, rest[n] + gain @ rest[:n], ki, correction


def state_feedback(request: Request, rows: np.ndarray) -> np.ndarray:
    """That with the reference first."""
    h = request.period
    a, b, c, gain, forward, ki, correction = lqg(request.table, h)
    low, high = request.outputs[0].low, request.outputs[0].high
    x, integral, found = np.zeros(len(a)), 0.0, []
    for reference, y in rows:
        v = -gain @ x + forward * reference + integral
        u = min(max(v, low), high)
        e = reference - y
        if not ((v > high and ki * e > 0) or (v < low and ki * e < 0)):
            integral += ki * h * e
        x = a @ x + b[:, 0] * u + correction * (y - c[0] @ x)
        found.append([u])
    return np.array(found)


def pid(request: Request, rows: np.ndarray) -> np.ndarray:
    return np.array([[u] for _, u in pid_steps(dict(request.table), request.period, rows, request.outputs[0])])


def gain_schedule(request: Request, rows: np.ndarray) -> np.ndarray:
    """The form of the first example: full PIDs with one tf and tt, the signal third; else what is linear, blended."""
    at, tables = request.table["points"], request.table["controllers"]
    if "kind" in tables[0]:
        return blended(request, rows)
    output = request.outputs[0]
    h, tf, tt = request.period, tables[0]["tf_s"], tables[0]["tt_s"]
    integral = derivative = 0.0
    before, found = None, []
    for r, y, s in rows:
        kp, ki, kd = (np.interp(s, at, [table[key] for table in tables]) for key in ("kp", "ki", "kd"))
        change = 0.0 if before is None else -y - before
        before = -y
        derivative = tf / (tf + h) * derivative + kd / (tf + h) * change
        v = kp * (r - y) + integral + derivative
        u = min(max(v, output.low), output.high)
        integral += ki * h * (r - y) + h / tt * (u - v)
        found.append([u])
    return np.array(found)


def blended(request: Request, rows: np.ndarray) -> np.ndarray:
    """Each point's controller without a limit, weighted by where the signal is, limited; one integral for all."""
    names = [wire.name for wire in request.inputs]
    column = names.index(request.table["schedule_on"])
    at, tables = request.table["points"], request.table["controllers"]
    own = rows if names[column] == "measurement" else np.delete(rows, column, axis=1)
    if tables[0]["kind"] == "state_feedback":
        return blended_feedback(request, own, rows[:, column])
    free = (Signal("free", "", -1e9, 1e9),) * len(request.outputs)
    points = (replace(request, table=table, outputs=free) for table in tables)
    v = np.array([FORMULAS[point.table["kind"]](point, own) for point in points])
    weights = np.array([np.interp(rows[:, column], at, line) for line in np.eye(len(at))])
    return clip(np.einsum("ks,ksj->sj", weights, v), request)


def blended_feedback(request: Request, rows: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """LQG with an integral at each point; every observer sees the output that is applied."""
    h, output = request.period, request.outputs[0]
    parts = [lqg(table, h) for table in request.table["controllers"]]
    at = request.table["points"]
    x, integral, found = [np.zeros(len(part[0])) for part in parts], 0.0, []
    for (reference, y), s in zip(rows, signal, strict=True):
        share = [np.interp(s, at, line) for line in np.eye(len(at))]
        sums = (-gain @ z + forward * reference for z, (_, _, _, gain, forward, _, _) in zip(x, parts, strict=True))
        v = np.dot(share, list(sums)) + integral
        u = min(max(v, output.low), output.high)
        step = np.dot(share, [ki for *_, ki, _ in parts]) * h * (reference - y)
        if not ((v > output.high and step > 0) or (v < output.low and step < 0)):
            integral += step
        x = [a @ z + b[:, 0] * u + k * (y - c[0] @ z) for z, (a, b, c, *_, k) in zip(x, parts, strict=True)]
        found.append([u])
    return np.array(found)


def nmpc(request: Request, rows: np.ndarray) -> np.ndarray:
    """The form of the example: one step from no move, slopes by differences, solved with the states kept."""
    table, h = request.table, request.period
    n, steps = 2, int(table["horizon"])
    q, r, p = np.diag(table["Q"]), table["R"], np.diag(table["P"])
    target, rest, high = np.array(table["target"]), table["u_target"][0], np.array(table["x_max"])
    output = request.outputs[0]

    def after(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        def rate(x: np.ndarray) -> np.ndarray:
            return np.stack([x[:, 1], 10 * u - 20 * np.sin(x[:, 0]) - 0.5 * x[:, 1]], axis=1)

        k1 = rate(x)
        k2 = rate(x + h / 2 * k1)
        k3 = rate(x + h / 2 * k2)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + h * k3))

    points, a, b = [rows], [], []
    zero = np.zeros(len(rows))
    for _ in range(steps):
        x, e = points[-1], 1e-5
        a.append(np.stack([(after(x + e * d, zero) - after(x - e * d, zero)) / (2 * e) for d in np.eye(n)], axis=2))
        b.append((after(x, zero + e) - after(x, zero - e)) / (2 * e))
        points.append(after(x, zero))
    weights = scipy.linalg.block_diag(*[part for k in range(steps) for part in ([[r]], q if k < steps - 1 else p)])
    size, rows_of_chain = (n + 1) * steps, n * steps
    shape = {"h": ca.Sparsity.dense(size, size), "a": ca.Sparsity.dense(rows_of_chain, size)}
    solver = ca.conic("formula", "qpoases", shape, {"printLevel": "none"})
    found = []
    for lane in range(len(rows)):
        chain, slope, low, top = np.zeros((rows_of_chain, size)), [], [], []
        for k in range(steps):
            at, own = slice(k * n, k * n + n), k * (n + 1)
            chain[at, own] = -b[k][lane]
            chain[at, own + 1 : own + 1 + n] = np.eye(n)
            if k:
                chain[at, own - n : own] = -a[k][lane]
            away = points[k + 1][lane]
            slope += [-r * rest, *((q if k < steps - 1 else p) @ (away - target))]
            low += [output.low, -np.inf, -np.inf]
            top += [output.high, *(high - away)]
        best = solver(h=weights, g=slope, a=chain, lba=0, uba=0, lbx=low, ubx=top)
        assert solver.stats()["success"]
        found.append([float(best["x"][0])])
    return np.array(found)


def mpc(request: Request, rows: np.ndarray) -> np.ndarray:
    """The form of the example: regulation of measured states, limits of u and x, solved with the states kept."""
    table = request.table
    a, b = np.array(table["A"]), np.array(table["B"])
    n, m = b.shape
    steps = int(table["horizon"])
    q, r = np.diag(table["Q"]), np.array([[table["R"]]])
    p = scipy.linalg.solve_discrete_are(a, b, q, r)
    weights = ca.diagcat(*[ca.DM(part) for k in range(steps) for part in (r, q if k < steps - 1 else p)])
    chain = ca.DM(np.kron(np.eye(steps), np.hstack([-b, np.eye(n)])))
    for k in range(1, steps):
        chain[k * n : (k + 1) * n, k * (n + m) - n : k * (n + m)] = -a
    low = np.tile([table["u_min"], *table["x_min"]], steps)
    high = np.tile([table["u_max"], *table["x_max"]], steps)
    shape = {"h": weights.sparsity(), "a": ca.sparsify(chain).sparsity()}
    solver = ca.conic("formula", "qpoases", shape, {"printLevel": "none"})
    found = []
    for state in rows:
        right = np.concatenate([a @ state, np.zeros((steps - 1) * n)])
        best = solver(h=weights, a=ca.sparsify(chain), lba=right, uba=right, lbx=low, ubx=high)
        found.append([float(best["x"][0])])
    return np.array(found)


def cascade(request: Request, rows: np.ndarray) -> np.ndarray:
    """Loop by loop, the outermost first, each in its own samples: none of them depends on one inside."""
    wires = {wire.name: row for wire, row in zip(request.inputs, rows.T, strict=True)}
    ranges = {wire.name: wire for wire in request.inputs}
    loops = request.table["loops"]
    for k in reversed(range(len(loops))):
        own = {key: value for key, value in loops[k].items() if key not in cascade_kind.OWN}
        every, taken = loops[k].get("every", 1), loops[k].get("inputs", {})
        names = ["reference", "measurement"] if loops[k]["kind"] == "pid" else list(INPUTS)
        read = [taken.get(name, name) for name in names]
        period = request.period * every
        inputs = tuple(replace(ranges[signal], name=name) for name, signal in zip(names, read, strict=True))
        output = Signal("command", "", own.get("u_min", 0.0), own.get("u_max", 0.0))
        outputs = (output,) if k else request.outputs
        part = Request(request.name, own, period, inputs, outputs, None)
        found = FORMULAS[loops[k]["kind"]](part, np.stack([wires[signal] for signal in read], axis=1)[::every])
        if k == 0:
            return found
        command = loops[k].get("commands", "reference")
        wires[command] = np.repeat(found[:, 0], every)[: len(rows)]
        ranges[command] = replace(output, name=command)
    raise AssertionError


FORMULAS: dict[str, Callable[[Request, np.ndarray], np.ndarray]] = {
    "mpc": mpc,
    "nmpc": nmpc,
    "pid": pid,
    "cascade": cascade,
    "foc": motor_formulas.foc,
    "fuzzy_pid": motor_formulas.fuzzy_pid,
    "self_tuning": motor_formulas.self_tuning,
    "sensorless_speed": motor_formulas.sensorless_speed,
    "sliding_mode": motor_formulas.sliding_mode,
    "start_monitor": motor_formulas.start_monitor,
    "gain_schedule": gain_schedule,
    "lead_lag": lead_lag,
    "notch": notch,
    "state_feedback": state_feedback,
    "state_space": state_space,
    "transfer_function": transfer_function,
}
