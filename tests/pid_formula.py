"""The PID of the contract, section 7, with every key, in plain numbers."""

from __future__ import annotations

import math

from firmloop.identify.signal import Signal


def pid_steps(table, h, rows, output: Signal, manual=None, automatic=None, tracking=None):
    """(v, u) a sample; `rows` (n, 2) hold r and y, the named signals a list of numbers each."""
    form, mode = table.get("form", "default"), table.get("anti_windup", "back_calculation")
    kp, ki, kd = table["kp"], table.get("ki", 0.0), table.get("kd", 0.0)
    if form in ("ideal", "series"):
        ti, td = table.get("ti_s", math.inf), table.get("td_s", 0.0)
        kp, ki, kd = (kp * (1 + td / ti) if form == "series" else kp), kp / ti, kp * td
    b, c = table.get("b", 1.0), table.get("c", 0.0)
    u_min, u_max = table.get("u_min", output.low), table.get("u_max", output.high)
    tf = table.get("tf_s", abs(kd / kp) / 10 if kp else 0.0)
    ti, td = (kp / ki if ki else math.inf), (kd / kp if kp else 0.0)
    tt = table.get("tt_s", max(h, math.sqrt(abs(ti * td)) if kd and ki else abs(ti)))
    rate = table.get("rate_limit_per_s", math.inf)
    integral = derivative = 0.0
    last = min(max(0.0, u_min), u_max)
    before, found = None, []
    for k, (r, y) in enumerate(rows):
        e, x = r - y, c * r - y
        change = 0.0 if before is None else x - before
        before = x
        now = 0.0
        if form == "tustin":
            derivative = (2 * tf - h) / (2 * tf + h) * derivative + 2 * kd / (2 * tf + h) * change
            now = ki * h / 2 * e
        else:
            derivative = tf / (tf + h) * derivative + kd / (tf + h) * change
        v = kp * (b * r - y) + (integral + now) + derivative
        in_manual = automatic is not None and automatic[k] <= 0.5
        wanted = manual[k] if in_manual else v
        u = min(max(wanted, max(u_min, last - rate * h)), min(u_max, last + rate * h))
        last = u
        if in_manual:
            integral += u - v
        elif mode == "back_calculation":
            target = tracking[k] if tracking is not None else u
            integral += ki * h * e + (h / tt) * (target - v)
        elif mode == "none" or not ((v > u and ki * e > 0) or (v < u and ki * e < 0)):
            integral += ki * h * e
        found.append((v, u))
    return found
