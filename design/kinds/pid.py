r"""PID: two weighted set points, filtered derivative, a saturated output, and an integral that does not wind up.

With h the period, r the reference, y the measurement, e = r - y and x = c r - y, one sample of `form = "default"` is::

    D[k]   = tf/(tf+h) D[k-1] + kd/(tf+h) (x[k] - x[k-1])            D[0] = 0
    v[k]   = kp (b r - y) + I[k] + D[k]
    u[k]   = min(max(v[k], u_min), u_max)
    I[k+1] = I[k] + ki h e[k] + (h/tt) (u[k] - v[k])                 I[0] = 0

and of `form = "tustin"` (trapezoidal integral; kd s/(tf s + 1) with s = 2/h (z-1)/(z+1))::

    D[k]   = (2 tf-h)/(2 tf+h) D[k-1] + 2 kd/(2 tf+h) (x[k] - x[k-1])
    v[k]   = kp (b r - y) + (I[k] + ki h/2 e[k]) + D[k]
    u[k], I[k+1] as above

The tracking term (h/tt) (u - v) is `anti_windup = "back_calculation"` (Astrom and Murray, Feedback Systems, 2nd ed.,
ch. 11). "clamping" has no such term and leaves I alone while v is beyond a limit and ki e points further out.
"none" only adds.

Defaults: kd = 0, ki = 0, b = 1, c = 0 (derivative of the measurement alone), tf = Td/10, u_min and u_max the range of
the output signal, tt = sqrt(Ti Td) with a derivative and Ti without, never below h, where Ti = kp/ki and Td = kd/kp.
With ki = 0 and no tt given there is nothing to wind up, hence no integral.

The range of each state variable is proven in `pid_range.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import casadi as ca

from design.kinds import Design, Kind, Request
from design.kinds.pid_range import Pid, state_ranges
from design.law import DesignError, Flag, Law, Scalar
from design.roles import reference_and_measurement
from design.table import check_keys, choice, positive, real
from design.tuning import Gains, rules
from identify.linear import linearize
from identify.signal import Signal

GAIN_KEYS = ("kp", "ki", "kd")
KEYS = (*GAIN_KEYS, "tf_s", "b", "c", "u_min", "u_max", "tt_s", "anti_windup", "form", "tune")
ANTI_WINDUP = ("back_calculation", "clamping", "none")
FORMS = ("default", "tustin")


def design(request: Request) -> Design:
    """Read the table, tune where it says so, and write the law."""
    reference, measurement, output = _wires(request)
    tuned_by, gains = _gains(request)
    pid = _pid(request, output, gains)
    figures = {
        **{"kp": pid.kp, "ki": pid.ki, "kd": pid.kd},
        **({"tf_s": pid.tf, "c": pid.c} if pid.differentiates else {}),
        **{"b": pid.b, "u_min": pid.u_min, "u_max": pid.u_max},
        **({"tt_s": pid.period / pid.tracking} if pid.tracking else {}),
    }
    return Design(_law(request, pid, reference, measurement, output), figures, tuned_by)


def _wires(request: Request) -> tuple[Signal, Signal, Signal]:
    """Pick reference, measurement and output, and check their units."""
    if len(request.inputs) != 2 or len(request.outputs) != 1:
        inputs, outputs = (", ".join(wire.name for wire in wires) for wires in (request.inputs, request.outputs))
        raise DesignError(
            f"controller.kind = 'pid' has the inputs ({inputs}) and the outputs ({outputs}); it needs exactly a "
            "reference, a measurement and one output: correct [signals] or controller.outputs"
        )
    at_reference, at_measurement = reference_and_measurement(request.inputs)
    reference, measurement, output = request.inputs[at_reference], request.inputs[at_measurement], request.outputs[0]
    if reference.unit != measurement.unit:
        raise DesignError(
            f"signals.{reference.name} is in '{reference.unit}', signals.{measurement.name} in '{measurement.unit}'; "
            "a PID subtracts one from the other: give both the same unit"
        )
    return reference, measurement, output


def _gains(request: Request) -> tuple[str | None, Gains]:
    """Take the gains from the table, or from the tuning rule that it names."""
    table = request.table
    if "tune" not in table:
        check_keys(table, KEYS, "a pid without 'tune'")
        gains = Gains(real(table, "kp", None), real(table, "ki", 0.0), real(table, "kd", 0.0), "given")
        if gains.kp == gains.ki == gains.kd == 0:
            raise DesignError('controller.kp, ki and kd are all 0; give at least one gain, or tune = "simc"')
        return None, gains
    rule = rules()[choice(table, "tune", None, rules())]
    check_keys(table, (*KEYS, *rule.keys), f"a pid tuned by '{rule.name}'")
    given = [key for key in GAIN_KEYS if key in table]
    if given:
        raise DesignError(
            f"controller.{given[0]} = {table[given[0]]!r} is given beside tune = '{rule.name}'; remove one of the two"
        )
    if request.plant is None:
        raise DesignError(f"controller.tune = '{rule.name}' needs a plant; add [plant] or give kp, ki, kd")
    return rule.name, rule.tune(linearize(request.plant), request.period, table)


def _pid(request: Request, output: Signal, gains: Gains) -> Pid:
    """Fill every constant in, with the defaults of the module docstring."""
    table, period = request.table, request.period
    form = choice(table, "form", "default", FORMS)
    anti_windup = choice(table, "anti_windup", "back_calculation", ANTI_WINDUP)
    u_min = real(table, "u_min", output.low, output.low, output.high)
    u_max = real(table, "u_max", output.high, output.low, output.high)
    if u_min >= u_max:
        raise DesignError(f"controller.u_min = {u_min:g} is not below u_max = {u_max:g}; exchange or correct them")
    pid = Pid(
        period=period,
        kp=gains.kp,
        ki=gains.ki,
        kd=gains.kd,
        tf=_filter(table, gains, form),
        b=real(table, "b", 1.0),
        c=real(table, "c", 0.0),
        u_min=u_min,
        u_max=u_max,
        tracking=_tracking(table, gains, period) if anti_windup == "back_calculation" else 0.0,
        anti_windup=anti_windup,
        form=form,
    )
    for what, factor in {"ki h": pid.ki * period, "kd/(tf+h)": pid.slope, "kp b": pid.kp * pid.b}.items():
        if not math.isfinite(factor):
            raise DesignError(f"the factor {what} of the pid is {factor}: the gains are too large; give smaller ones")
    return pid


def _filter(table: Mapping[str, object], gains: Gains, form: str) -> float:
    """Choose the time constant of the derivative's filter, s."""
    if gains.kd == 0:
        return real(table, "tf_s", 0.0, 0.0)
    if "tf_s" not in table and gains.kp == 0:
        raise DesignError(
            "controller.tf_s is missing; with kp = 0 there is no Td to choose it from: give it in seconds"
        )
    tf = real(table, "tf_s", gains.filter_time, 0.0)
    if form == "tustin" and tf == 0:
        raise DesignError("controller.tf_s = 0 with form = 'tustin' rings for ever; give a filter time above 0")
    return tf


def _tracking(table: Mapping[str, object], gains: Gains, period: float) -> float:
    """Return h/tt; zero where there is no integral and none was asked for."""
    if "tt_s" in table:
        tt = positive(table, "tt_s", None)
        if tt < period:
            raise DesignError(
                f"controller.tt_s = {tt:g} is below period_s = {period:g}; tracking would overshoot: "
                "give at least the period"
            )
        return period / tt
    if gains.ki == 0:
        return 0.0
    usual = math.sqrt(abs(gains.kd / gains.ki)) if gains.kd else abs(gains.kp / gains.ki)
    return period / max(usual, period)


def _law(request: Request, pid: Pid, reference: Signal, measurement: Signal, output: Signal) -> Law:
    """Write the difference equations of the module docstring as a CasADi function."""
    ranges = state_ranges(pid, reference, measurement, output)
    state, why = tuple(signal for signal, _ in ranges), tuple(why for _, why in ranges)
    names = [signal.name for signal in state]
    x = {name: ca.SX.sym(name) for name in names}
    z = {signal.name: ca.SX.sym(signal.name) for signal in request.inputs}
    r, y = z[reference.name], z[measurement.name]
    nexts: dict[str, ca.SX] = {}
    named: dict[str, tuple[str, ca.SX]] = {}

    error = r - y
    # r - y is written once, so that it is computed once
    weighted = {1.0: error} | {weight: weight * r - y for weight in {pid.b, pid.c} - {1.0}}
    terms: list[ca.SX] = []
    if pid.kp != 0:
        proportional = pid.kp * weighted[pid.b]
        named["proportional"] = (output.unit, proportional)
        terms.append(proportional)
    if pid.integrates:
        named["error"] = (measurement.unit, error)
        terms.append(x["integral"] + pid.half_step * error if pid.half_step else x["integral"])
    if pid.differentiates:
        difference = ca.if_else(x["started"] > 0.5, weighted[pid.c] - x["last"], 0)
        derivative = pid.slope * difference
        if "derivative" in x:
            derivative = pid.forget * x["derivative"] + derivative
            nexts["derivative"] = derivative
        nexts |= {"last": weighted[pid.c], "started": ca.SX(1)}
        named["derivative_term"] = (output.unit, derivative)
        terms.append(derivative)
    unlimited = sum(terms[1:], start=terms[0])
    limited = ca.fmin(ca.fmax(unlimited, pid.u_min), pid.u_max)
    named["unlimited"] = (output.unit, unlimited)
    if pid.integrates:
        nexts["integral"] = _integral(pid, x["integral"], error, unlimited, limited)

    _check_names(request, [*names, *named])
    stage = ca.Function(
        "law",
        [ca.vertcat(*x.values()), ca.vertcat(*z.values())],
        [
            ca.vertcat(*(nexts[name] for name in names)),
            limited,
            limited != unlimited,
            ca.vertcat(*(value for _, value in named.values())),
        ],
        ["x", "z"],
        ["x_next", "u", "flags", "named"],
    )
    signals = tuple(Signal(name, unit, -math.inf, math.inf) for name, (unit, _) in named.items())
    return Law(
        name=request.name,
        says=_says(pid, measurement, output),
        period=request.period,
        inputs=request.inputs,
        outputs=request.outputs,
        state=state,
        start=(0.0,) * len(state),
        why=why,
        flags=(Flag("saturated", "the output stands at its limit"),),
        stages=(Scalar(stage, signals),),
    )


def _integral(pid: Pid, integral: ca.SX, error: ca.SX, unlimited: ca.SX, limited: ca.SX) -> ca.SX:
    """Return I[k+1]."""
    step = (pid.ki * pid.period) * error
    if pid.anti_windup == "back_calculation":
        return integral + step + pid.tracking * (limited - unlimited)
    if pid.anti_windup == "none":
        return integral + step
    upward, downward = (error > 0, error < 0) if pid.ki > 0 else (error < 0, error > 0)
    outward = ca.logic_or(ca.logic_and(unlimited > pid.u_max, upward), ca.logic_and(unlimited < pid.u_min, downward))
    return integral + ca.if_else(ca.logic_not(outward), step, 0)


def _check_names(request: Request, own: list[str]) -> None:
    for wire in request.inputs + request.outputs:
        if wire.name in own:
            raise DesignError(f"signals.{wire.name} is also the name of a value inside the pid; rename the signal")


def _says(pid: Pid, measurement: Signal, output: Signal) -> str:
    """Write one line for the head of the generated C."""
    per = f"({measurement.unit})" if any(sign in measurement.unit for sign in "/*. ") else measurement.unit
    units = {"kp": f"{output.unit}/{per}", "ki": f"{output.unit}/{per}/s", "kd": f"{output.unit}*s/{per}"}
    gains = [(name, getattr(pid, name)) for name in GAIN_KEYS if getattr(pid, name) != 0]
    letters = "".join(name[1].upper() for name, _ in gains)
    form = ", Tustin" if pid.form == "tustin" else ""
    windup = {"back_calculation": ", back-calculation", "clamping": ", clamping", "none": ""}[pid.anti_windup]
    figures = ", ".join(f"{name} {value:.6g} {units[name]}" for name, value in gains)
    return f"{letters} controller{form}{windup if pid.integrates else ''}: {figures}"


KIND = Kind(
    name="pid",
    says="proportional, integral and derivative action with saturation and anti-windup",
    design=design,
    example=Request(
        name="wheel_speed",
        table={"kp": 0.05, "ki": 1.0, "kd": 2e-4, "tf_s": 2e-3, "b": 0.7},
        period=0.001,
        inputs=(Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0)),
        outputs=(Signal("output", "V", -12.0, 12.0),),
        plant=None,
    ),
)
