"""The kinds that the motor studies compare, a second time: the formulas of their docstrings in plain numpy."""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg
from scipy.stats import t as student

from firmloop.design.design import Request

RULES = {
    "kp": [[1.5, 1.3, 1.0], [1.0, 0.8, 1.0], [1.0, 1.3, 1.5]],
    "ki": [[0.3, 0.5, 0.6], [0.9, 1.2, 0.9], [0.6, 0.5, 0.3]],
    "kd": [[0.4, 0.6, 1.4], [1.0, 1.0, 1.0], [1.4, 0.6, 0.4]],
}


def ends(request: Request) -> tuple[float, float]:
    output = request.outputs[0]
    return float(request.table.get("u_min", output.low)), float(request.table.get("u_max", output.high))


def memberships(x: float) -> np.ndarray:
    """Negative, zero, positive: triangles one wide."""
    return np.maximum(0.0, 1.0 - np.abs(np.clip(x, -1, 1) - np.array([-1.0, 0.0, 1.0])))


def fuzzy_pid(request: Request, rows: np.ndarray) -> np.ndarray:
    table, h = request.table, request.period
    low, high = ends(request)
    integral, last, found = 0.0, None, []
    for r, y in rows:
        e = r - y
        change = 0.0 if last is None else e - last
        last = e
        far, quick = memberships(e / table["error_width"]), memberships(change / table["change_width"])
        factor = {gain: float(far @ np.array(rules) @ quick) for gain, rules in RULES.items()}
        v = table["kp"] * factor["kp"] * e + integral + table["kd"] / h * factor["kd"] * change
        integral = min(max(integral + table["ki"] * h * factor["ki"] * e, low), high)
        found.append([min(max(v, low), high)])
    return np.array(found)


def sliding_mode(request: Request, rows: np.ndarray) -> np.ndarray:
    table, (low, high) = request.table, ends(request)
    phi, held, found = table["layer"], 0.0, []
    for r, y in rows:
        v = table["feedforward"] * r + table["gain"] * np.clip((r - y + held) / phi, -1, 1)
        held = float(np.clip(held + table["integral_rad_s"] * request.period * (r - y), -phi, phi))
        found.append([min(max(v, low), high)])
    return np.array(found)


def sensorless_speed(request: Request, rows: np.ndarray) -> np.ndarray:
    """The observer's poles are checked by what they are, not by how they were placed."""
    table, h = request.table, request.period
    r, inductance, ke, kt, j, b = (
        table[k] for k in ("R_ohm", "L_H", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")
    )
    rate = np.array([[-r / inductance, -ke / inductance, 0.0], [kt / j, -b / j, -1 / j], [0.0, 0.0, 0.0]])
    whole = scipy.linalg.expm(np.block([[rate, np.array([[1 / inductance], [0], [0]])], [np.zeros((1, 4))]]) * h)
    a, drive = whole[:3, :3], whole[:3, 3]
    pole = math.exp(-table["bandwidth_rad_s"] * h)
    # Coefficients of det(z I - A + K C) = (z - pole)^3 are linear in K: solve for it.
    wanted = np.poly([pole] * 3)[1:]
    still = np.poly(a)[1:]
    slopes = np.array([np.poly(a - np.outer(unit, [1.0, 0.0, 0.0]))[1:] - still for unit in np.eye(3)]).T
    gain = np.linalg.solve(slopes, wanted - still)
    x, found = np.zeros(3), []
    for u, i in rows:
        found.append([x[1]])
        x = a @ x + drive * u + gain * (i - x[0])
    return np.clip(found, *ends(request))


def self_tuning(request: Request, rows: np.ndarray) -> np.ndarray:
    table, h = request.table, request.period
    low, high = ends(request)
    wide, strong = 400.0, max(-low, high)
    forget, cap = 0.995, 1.0
    a, pole = math.exp(-h / table["lag_s"]), math.exp(-h / table["time_constant_s"])
    b = b0 = table["gain"] * (1 - a) * strong / wide
    c, p, f, integral, found = 1 / b, 0.5 * np.eye(2), np.zeros(2), 0.0, []
    for r, y in rows / wide:
        g = p @ f / (forget + f @ p @ f)
        t = np.array([a, b]) + g * (y - f @ [a, b])
        p = (p - np.outer(g, p @ f)) * (1 / forget if np.trace(p) < cap else 1.0)
        a, b = float(np.clip(t[0], 0, 1)), float(np.clip(t[1], b0 / 4, b0 * 4))
        c = float(np.clip(c * (2 - b * c), 0.25 / b0, 4 / b0))
        v = integral - (1 + a - 2 * pole) * c * y
        u = min(max(v, low / strong), high / strong)
        integral += (1 - pole) ** 2 * c * (r - y) + (1 - pole) * (u - v)
        f = np.array([y, u])
        found.append([strong * u])
    return np.array(found)


def start_monitor(request: Request, rows: np.ndarray) -> np.ndarray:
    table, h = request.table, request.period
    w, tau, inductance, r = 120 * math.pi, 0.012, table["inductance_H"], table["resistance_ohm"]
    n = n0 = 1 / math.sqrt(inductance * table["capacitance_F"])
    z = r / 2 * math.sqrt(table["capacitance_F"] / inductance)
    current = math.sqrt(2) * table["voltage_rms_V"] / abs(r + 1j * (w * inductance - 1 / (w * table["capacitance_F"])))
    last, twin, spread, x, found = 0.0, 0.0, 0.0, 648_053, []
    for v, i, speed in rows:
        j = (i * math.cos(w * h) - last) / math.sin(w * h)
        e = v - w * inductance * j + n * (inductance / w * n * j - 2 * inductance * z * i)
        x, positive = 1_048_573 - 2 * abs(x), x > 0
        twin, before = (1 - h / tau) * twin, twin
        if speed < table["speed_limit_rad_s"]:
            step = h / (tau * inductance / w * n0 * current**2) * e * j
            z = z + h / (tau * inductance * n0 * current**2) * e * i
            n = n - step
            twin += step if positive else -step
            spread += h / (4 * tau) * (float(student.ppf(0.975, 9)) * math.sqrt(math.pi / 2) * abs(before) - spread)
        n, z, spread = min(max(n, 400.0), 800.0), min(max(z, 0.05), 1.0), min(spread, 100.0)
        last = i
        found.append([n, spread, z])
    return np.array(found)


def foc(request: Request, rows: np.ndarray) -> np.ndarray:
    """In complex numbers: d along the real axis."""
    table, h = request.table, request.period
    wires = {wire.name: k for k, wire in enumerate(request.inputs)}
    tuned, wc, i = "tune" in table, table.get("bandwidth_rad_s", 0.0), 0j
    kp = [table[f"L{a}_H"] * wc if tuned else table[f"kp_{a}"] for a in "dq"]
    ki = [table["R_ohm"] * wc if tuned else table[f"ki_{a}"] for a in "dq"]
    tt = table.get("tt_s", max([h, *(p / k for p, k in zip(kp, ki, strict=True))]))
    supply_range = request.inputs[wires["supply_V"]]
    found = []
    for row in rows:
        rd, rq, ia, ib, th, w, supply = (row[wires[name]] for name in (
            "reference_d_A", "reference_q_A", "current_a_A", "current_b_A", "angle_rad", "speed_rad_s", "supply_V"
        ))  # fmt: skip
        turn, supply = np.exp(1j * th), min(max(supply, supply_range.low), supply_range.high)
        seen = (ia + 1j * (ia + 2 * ib) / math.sqrt(3)) / turn
        e = rd + 1j * rq - seen
        free = kp[0] * e.real + 1j * kp[1] * e.imag + i
        if table.get("decoupling", True):
            free += 1j * w * (table["Ld_H"] * seen.real + table["flux_Wb"]) - w * table["Lq_H"] * seen.imag
        most = table.get("modulation", 1.0) * supply / math.sqrt(3)
        most_d = table.get("d_share", 1.0) * most
        vd = float(np.clip(free.real, -most_d, most_d))
        left = math.sqrt(max(most**2 - vd**2, 0.0))
        v = vd + 1j * float(np.clip(free.imag, -left, left))
        i += h * (ki[0] * e.real + 1j * ki[1] * e.imag) + (h / tt) * (v - free)
        phases = [(v * turn * np.exp(-2j * math.pi * k / 3)).real for k in range(3)]
        middle = (max(phases) + min(phases)) / 2
        duties = {f"duty_{a}": 0.5 + (x - middle) / supply for a, x in zip("abc", phases, strict=True)}
        found.append([min(max(duties[wire.name], 0.0), 1.0) for wire in request.outputs])
    return np.array(found)
