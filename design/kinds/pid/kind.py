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

With constant gains D is computed as g (x - f) from f, the filtered x: f[k+1] = f[k] + (1-q) (x[k] - f[k]), f[0] = x[0],
where q and g are the factors of D[k-1] and of x[k] - x[k-1] above: one state variable, and D[0] = 0 by itself.

The tracking term (h/tt) (u - v) is `anti_windup = "back_calculation"` (Astrom and Murray, Feedback Systems, 2nd ed.,
ch. 11). "clamping" has no such term and leaves I alone while v is beyond a limit and ki e points further out.
"none" only adds.

Defaults: kd = 0, ki = 0, b = 1, c = 0 (derivative of the measurement alone), tf = Td/10, u_min and u_max the range of
the output signal, tt = sqrt(Ti Td) with a derivative and Ti without, never below h, where Ti = kp/ki and Td = kd/kp.
With ki = 0 and no tt given there is nothing to wind up, hence no integral.

Further forms and keys:

- `form = "parallel"` is another name of the default. "ideal", kp (1 + 1/(ti s) + td s), and "series",
  kp (1 + 1/(ti s)) (1 + td s), take `kp`, `ti_s` and `td_s`; they compute as the default form with ki = kp/ti,
  kd = kp td and, in series, a proportional gain of kp (1 + td/ti).
- `rate_limit_per_s`, R: u[k] also stays within u[k-1] - R h and u[k-1] + R h; u[-1] is 0, or the limit next to it.
- `manual` and `automatic` name inputs. While automatic is below 0.5, u is `manual` within all limits and
  I[k+1] = I[k] + u[k] - v[k]: v follows u, and the change back to automatic is bumpless.
- `[controller.feedforward] from = "effects"`: what meets the plant's friction, load, gravity, cogging and dead zone is
  added to v, see `models/feedforward.py`.
- `tunable` lists those of kp, ki, kd, b, c, u_min and u_max that can be set on the running target, see `tunable.py`.
- `tracking` names an input that stands for u in the tracking term, such as the output an outer selector has chosen, or
  what the inner loop of a cascade really does.

The range of each state variable is proven in `ranges.py`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import casadi as ca

from firmloop.design.design import Design, Kind, Request
from firmloop.design.kinds.pid.equations import Wires, factors, write
from firmloop.design.kinds.pid.ranges import Pid, state_ranges
from firmloop.design.kinds.pid.tunable import pid_parameters, tunable_law
from firmloop.design.law import DesignError
from firmloop.design.models.anti_windup import anti_windup_of, tracking_modes
from firmloop.design.models.feedforward import feedforward, position_of
from firmloop.design.models.pid_form import Discretization, form_of
from firmloop.design.roles import check_meeting, reference_and_measurement
from firmloop.design.table import check_keys, choice, limits, positive, real
from firmloop.design.tunable import KEYS as TUNABLE_KEYS
from firmloop.design.tuning import Gains, rules
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.linearize import linearize

GAIN_KEYS = ("kp", "ki", "kd")
WIRE_KEYS = ("manual", "automatic", "tracking")
KEYS = (
    *(*GAIN_KEYS, "ti_s", "td_s", "tf_s", "b", "c", "u_min", "u_max", "tt_s", "anti_windup", "form", "tune"),
    *("rate_limit_per_s", "feedforward", *WIRE_KEYS, *TUNABLE_KEYS),
)


def design(request: Request) -> Design:
    """Read the table, tune where it says so, and write the law."""
    wires = find_wires(request)
    tuned_by, gains = find_gains(request, wires)
    ahead = feedforward(request.table, request.plant, request.period, (wires.reference, wires.output), request.inputs)
    pid = read_pid(request.table, request.period, wires, gains)
    if ahead is not None:
        pid = replace(pid, added=ahead.size())
    figures = {
        **{"kp": pid.kp, "ki": pid.ki, "kd": pid.kd},
        **({"tf_s": pid.tf, "c": pid.c} if pid.differentiates else {}),
        **{"b": pid.b, "u_min": pid.u_min, "u_max": pid.u_max},
        **({"tt_s": pid.period / pid.tracking} if pid.tracking else {}),
    }
    ranges = state_ranges(pid, wires.reference, wires.measurement, wires.output)
    if ahead is not None:
        ranges = (*ranges, *ahead.states(pid.differentiates))
    z = {signal.name: ca.SX.sym(signal.name) for signal in request.inputs}
    says = _says(pid, wires.measurement, wires.output) + (ahead.says() if ahead else "")
    plain_gains = not form_of(request.table).times
    parameters = pid_parameters(request.table, pid, _units(wires.measurement, wires.output), wires.output, plain_gains)
    if parameters:
        law = tunable_law(request, says, pid, parameters, wires, ahead)
    else:
        law = write(request, says, pid, factors(pid), z, wires, ranges, {}, ahead)
    settings: dict[str, object] | None = {} if form_of(request.table).times else None
    asked = ("tune", *rules()[tuned_by].keys) if tuned_by else ()
    return Design(law, figures, tuned_by, settings, ahead.missed if ahead else {}, asked=asked)


def find_wires(request: Request) -> Wires:
    """Pick reference, measurement and output, and the inputs that the table names; check their units."""
    table, by_name = request.table, {wire.name: wire for wire in request.inputs}
    extra: dict[str, Signal] = {}
    for key in WIRE_KEYS:
        if key in table:
            extra[key] = by_name[choice(table, key, None, by_name)]
    if ("manual" in extra) != ("automatic" in extra):
        one, other = ("manual", "automatic") if "manual" in extra else ("automatic", "manual")
        raise DesignError(f"controller.{one} is given without {other}; name a signal for both, or for neither")
    names = [wire.name for wire in extra.values()]
    if len(set(names)) != len(names):
        raise DesignError(
            f"controller.manual, automatic and tracking name the same signal ({names}); give each its own"
        )
    loop = tuple(wire for wire in request.inputs if wire.name not in (*names, position_of(table)))
    if len(loop) != 2 or len(request.outputs) != 1:
        inputs, outputs = (", ".join(wire.name for wire in wires) for wires in (loop, request.outputs))
        raise DesignError(
            f"controller.kind = 'pid' has the inputs ({inputs}) and the outputs ({outputs}); it needs exactly a "
            "reference, a measurement and one output: correct [signals] or controller.outputs"
        )
    at_reference, at_measurement = reference_and_measurement(loop)
    reference, measurement, output = loop[at_reference], loop[at_measurement], request.outputs[0]
    if reference.unit != measurement.unit:
        raise DesignError(
            f"signals.{reference.name} is in '{reference.unit}', signals.{measurement.name} in '{measurement.unit}'; "
            "a PID subtracts one from the other: give both the same unit"
        )
    check_meeting(reference, measurement)
    for key in ("manual", "tracking"):
        if key in extra and extra[key].unit != output.unit:
            raise DesignError(
                f"controller.{key} names signals.{extra[key].name} in '{extra[key].unit}', but signals.{output.name} "
                f"is in '{output.unit}'; give both the same unit"
            )
    switch = extra.get("automatic")
    if switch is not None and not switch.low <= 0.5 < switch.high:
        raise DesignError(
            f"controller.automatic names signals.{switch.name}, which ranges from {switch.low:g} to {switch.high:g}; "
            "it is a switch, 0 for manual and 1 for automatic"
        )
    return Wires(reference, measurement, output, extra.get("manual"), switch, extra.get("tracking"))


def find_gains(request: Request, wires: Wires) -> tuple[str | None, Gains]:
    """Take the gains from the table, or from the tuning rule that it names."""
    table = request.table
    if "tune" not in table:
        check_keys(table, KEYS, "a pid without 'tune'")
        gains = given_gains(table)
        if gains.kp == gains.ki == gains.kd == 0:
            raise DesignError('controller.kp, ki and kd are all 0; give at least one gain, or tune = "simc"')
        return None, gains
    rule = rules()[choice(table, "tune", None, rules())]
    check_keys(table, (*KEYS, *rule.keys), f"a pid tuned by '{rule.name}'")
    given = [key for key in (*GAIN_KEYS, "ti_s", "td_s") if key in table]
    if given:
        raise DesignError(
            f"controller.{given[0]} = {table[given[0]]!r} is given beside tune = '{rule.name}'; remove one of the two"
        )
    if request.plant is None:
        raise DesignError(f"controller.tune = '{rule.name}' needs a plant; add [plant] or give kp, ki, kd")
    tuned = rule.tune(linearize(request.plant), request.period, {**room(wires), **table})
    if tuned.kp == tuned.ki == tuned.kd == 0:
        raise DesignError(f"{rule.name} gives no gain but 0 for this plant; check the plant's parameters")
    return rule.name, tuned


def room(wires: Wires) -> dict[str, float]:
    """Tell a tuning rule the output's limits, and a usual step: a quarter of the reference's range."""
    top = max(wires.reference.high, -wires.reference.low)
    return {"u_min": wires.output.low, "u_max": wires.output.high, "usual_step": top / 4}


def given_gains(table: Mapping[str, object]) -> Gains:
    """Read the gains in the words of their form, and return those of the parallel one."""
    form = form_of(table)
    kp = real(table, "kp", None)
    times, rates = ("ti_s", "td_s"), ("ki", "kd")
    for key in rates if form.times else times:
        if key in table:
            words = ("ti_s and td_s" if form.times else "ki and kd", form.name)
            raise DesignError(
                f"controller.{key} has no place in form = '{words[1]}', which takes {words[0]}; convert it"
            )
    if not form.times:
        return Gains(kp, real(table, "ki", 0.0), real(table, "kd", 0.0), "given")
    inverse = 1 / positive(table, "ti_s", None) if "ti_s" in table else 0.0
    td = real(table, "td_s", 0.0, 0.0)
    return Gains(kp * (1 + td * inverse) if form.series else kp, kp * inverse, kp * td, "given")


def read_pid(table: Mapping[str, object], period: float, wires: Wires, gains: Gains) -> Pid:
    """Fill every constant in, with the defaults of the module docstring."""
    output = wires.output
    form, anti_windup = form_of(table).rule, anti_windup_of(table)
    (u_min,), (u_max,) = limits(table, (output,))
    rate = positive(table, "rate_limit_per_s", None) if "rate_limit_per_s" in table else math.inf
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
        tracking=_tracking(table, gains, period) if anti_windup.tracks else 0.0,
        anti_windup=anti_windup,
        form=form,
        rate=rate,
        target=_target(wires, rate, u_min, u_max),
    )
    if wires.tracking is not None and not anti_windup.tracks:
        raise DesignError(f"controller.tracking needs anti_windup = {tracking_modes()}, but it is '{anti_windup}'")
    if (wires.tracking is not None or wires.manual is not None) and not pid.integrates:
        raise DesignError("controller.tracking and manual act on the integral, but there is none; give ki or tt_s")
    for what, factor in {"ki h": pid.ki * period, "kd/(tf+h)": pid.slope, "kp b": pid.kp * pid.b}.items():
        if not math.isfinite(factor):
            raise DesignError(f"the factor {what} of the pid is {factor}: the gains are too large; give smaller ones")
    if pid.tf > 0 and abs(pid.forget) >= 1:
        way = "longer" if pid.forget < 0 else "shorter"
        raise DesignError(f"controller.tf_s = {pid.tf:g} is no filter at period_s = {period:g}; give a {way} time")
    return pid


def _target(wires: Wires, rate: float, u_min: float, u_max: float) -> tuple[float, float] | None:
    """Return the range of what the integral tracks; None where that is v between its limits."""
    if wires.tracking is None:
        return (u_min, u_max) if math.isfinite(rate) or wires.manual is not None else None
    low, high = wires.tracking.low, wires.tracking.high
    return (min(low, u_min), max(high, u_max)) if wires.manual is not None else (low, high)


def _filter(table: Mapping[str, object], gains: Gains, form: Discretization) -> float:
    """Choose the time constant of the derivative's filter, s."""
    if gains.kd == 0:
        return real(table, "tf_s", 0.0, 0.0)
    if "tf_s" not in table and gains.kp == 0:
        raise DesignError(
            "controller.tf_s is missing; with kp = 0 there is no Td to choose it from: give it in seconds"
        )
    tf = real(table, "tf_s", gains.filter_time, 0.0)
    if form.trapezoidal and tf == 0:
        raise DesignError(f"controller.tf_s = 0 with form = '{form}' rings for ever; give a filter time above 0")
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


def _units(measurement: Signal, output: Signal) -> dict[str, str]:
    """Return the units of the gains."""
    per = f"({measurement.unit})" if any(sign in measurement.unit for sign in "/*. ") else measurement.unit
    return {"kp": f"{output.unit}/{per}", "ki": f"{output.unit}/{per}/s", "kd": f"{output.unit}*s/{per}"}


def _says(pid: Pid, measurement: Signal, output: Signal) -> str:
    """Write one line for the head of the generated C."""
    units = _units(measurement, output)
    gains = [(name, getattr(pid, name)) for name in GAIN_KEYS if getattr(pid, name) != 0]
    letters = "".join(name[1].upper() for name, _ in gains)
    figures = ", ".join(f"{name} {value:.6g} {units[name]}" for name, value in gains)
    return f"{letters} controller{pid.form.says}{pid.anti_windup.says if pid.integrates else ''}: {figures}"


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
