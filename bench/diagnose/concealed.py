"""Draw what a blind case conceals: physics of a given size, in the truth's own figures and in the contract's names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from bench.diagnose.truth import Sensor

SIZES = (0.03, 0.1, 0.3, 1.0)


@dataclass(frozen=True, slots=True)
class Machine:
    """A motor or a stage with what is large for it; `top` is its largest input."""

    name: str
    motor: bool
    values: Mapping[str, float]
    top: float  # V or N

    @property
    def effort(self) -> float:
        """Largest torque or force."""
        return self.values["kt"] * self.stall if self.motor else self.top

    @property
    def stall(self) -> float:
        """Largest current, A."""
        return self.top / self.values["R"] if self.motor else 0.0

    @property
    def speed(self) -> float:
        """Largest speed."""
        return self.top / self.values["ke"] if self.motor else self.top / self.values["b"] * 0.3

    @property
    def inertia(self) -> float:
        return self.values["J"]


MACHINES = (
    Machine("small_motor", True, {"R": 8.0, "L": 1.5e-3, "ke": 0.02, "kt": 0.02, "J": 3e-6, "b": 3e-6}, 12.0),
    Machine("flat_motor", True, {"R": 0.608, "L": 0.463e-3, "ke": 0.0369, "kt": 0.0369, "J": 5.8e-5, "b": 1e-5}, 12.0),
    Machine("gear_motor", True, {"R": 2.1, "L": 1.2e-3, "ke": 0.05, "kt": 0.05, "J": 1e-4, "b": 1e-4}, 24.0),
    Machine("linear_stage", False, {"J": 12.0, "b": 30.0}, 60.0),
)


@dataclass(frozen=True, slots=True)
class Concealed:
    """One effect: what the truth gets, and what a diagnosis should say."""

    name: str
    truth: Mapping[str, float]
    told: Mapping[str, float]  # the contract's parameters, units left off the name
    sensor: tuple[str, Sensor] | None = None  # which quantity
    skew: float = 0.0
    resolution: Mapping[str, float] = field(default_factory=dict)  # quantity -> step


Draw = Callable[[Machine, float, np.random.Generator, tuple[str, ...]], Concealed]


def _torque(name: str, share: float) -> Draw:
    key = {"coulomb_friction": "coulomb", "load_torque": "load"}[name]

    def draw(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
        level = share * size * machine.effort * rng.uniform(0.8, 1.25)
        return Concealed(name, {key: level}, {"torque": level})

    return draw


def _stribeck(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    low, high = 0.03 * size * machine.effort, 0.07 * size * machine.effort
    reach = machine.speed * rng.uniform(0.03, 0.1)
    return Concealed(
        "stribeck_friction",
        {"coulomb": low, "static": high, "stribeck": reach},
        {"coulomb": low, "static": high, "stribeck": reach},
    )


def _asymmetric(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    levels = {"positive": 0.06 * size * machine.effort, "negative": 0.03 * size * machine.effort}
    return Concealed("asymmetric_friction", levels, levels)


def _load_friction(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    ratio = 0.25 * size * rng.uniform(0.8, 1.2)
    return Concealed("load_dependent_friction", {"load_ratio": ratio}, {"ratio": ratio})


def _drag(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    figure = 0.3 * size * machine.effort / machine.speed**2
    return Concealed("quadratic_drag", {"drag": figure}, {"coefficient": figure})


def _load_step(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    told = {"torque": 0.08 * size * machine.effort, "time": rng.uniform(1.5, 3.5)}
    return Concealed("load_step", {"step": told["torque"], "step_time": told["time"]}, told)


def _gravity(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    level, phase = 0.06 * size * machine.effort, rng.uniform(-1.2, 1.2)
    told = {"amplitude": level, "phase": phase}
    return Concealed("gravity_torque", {"gravity": level, "gravity_phase": phase}, told)


def _cogging(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    level, count, phase = 0.08 * size * machine.effort, float(rng.integers(4, 15)), rng.uniform(-1.2, 1.2)
    told = {"amplitude": level, "periods_per_rev": count, "phase": phase}
    return Concealed("cogging_torque", {"cogging": level, "cogging_n": count, "cogging_phase": phase}, told)


def _ripple(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    ratio, count, phase = 0.3 * size, float(rng.integers(4, 15)), rng.uniform(-1.2, 1.2)
    told = {"ratio": ratio, "periods_per_rev": count, "phase": phase}
    return Concealed("torque_ripple", {"ripple": ratio, "ripple_n": count, "ripple_phase": phase}, told)


def _one(name: str, key: str, word: str, figure: Callable[[Machine, float], float]) -> Draw:
    def draw(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
        value = figure(machine, size) * rng.uniform(0.85, 1.15)
        return Concealed(name, {key: value}, {word: value})

    return draw


def _coupling(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    inertia = machine.inertia * rng.uniform(0.5, 1.0)
    reduced = inertia * machine.inertia / (inertia + machine.inertia)
    stiffness = reduced * (2.0 * np.pi * 18.0 * (1.0 / size) ** 0.35 * rng.uniform(0.8, 1.25)) ** 2
    damping = 0.1 * np.sqrt(stiffness * reduced)
    told = {"stiffness": stiffness, "load_inertia": inertia, "damping": damping}
    truth = {"coupling": stiffness, "coupled_inertia": inertia, "coupling_damping": damping}
    return Concealed("flexible_coupling", truth, told)


def _backlash(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    inertia = machine.inertia * rng.uniform(0.5, 1.0)
    reduced = inertia * machine.inertia / (inertia + machine.inertia)
    stiffness = reduced * (2.0 * np.pi * 120.0) ** 2
    gap = 0.15 * size * (1.0 if machine.motor else 0.05)
    truth = {
        "coupling": stiffness,
        "coupled_inertia": inertia,
        "coupling_damping": 0.5 * np.sqrt(stiffness * reduced),
        "gap": gap,
    }
    return Concealed("backlash", truth, {"gap": gap, "load_inertia": inertia})


def _heating(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    power = (0.3 * machine.stall) ** 2 * machine.values["R"]
    rise, time = 0.5 * size / 0.00393 / power, rng.uniform(0.8, 2.5)
    told = {"rise_K_per_W": rise, "time_constant": time}
    return Concealed("resistance_heating", {"heat_rise": rise, "heat_time": time}, told)


def _presliding(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    level = 0.08 * size * machine.effort
    stiffness = level / (machine.speed * 0.01 * rng.uniform(0.8, 1.2))
    truth = {"bristle": stiffness, "bristle_level": level}
    return Concealed("presliding_friction", truth, {"stiffness": stiffness, "coulomb": level})


def _sensor(fault: str, word: str, figure: Callable[[Machine, float, str], float]) -> Draw:
    def draw(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
        quantity = str(rng.choice(quantities))
        value = figure(machine, size, quantity) * rng.uniform(0.85, 1.15)
        told = {word: value} if word else {}
        return Concealed(fault, {}, told, (quantity, Sensor(fault, told)))

    return draw


def _reach(machine: Machine, quantity: str) -> float:
    return {"current": machine.stall * 0.4, "speed": machine.speed * 0.6, "position": 6.0 if machine.motor else 0.3}[
        quantity
    ]


def _quantization(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    quantity = str(rng.choice(quantities))
    step = 0.3 * size * _reach(machine, quantity)
    return Concealed("sensor_quantization", {}, {"resolution": step}, None, 0.0, {quantity: step})


def _eccentric(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    told = {"amplitude": 0.08 * size, "phase": rng.uniform(-1.2, 1.2)}
    return Concealed("eccentric_encoder", {}, told, ("position", Sensor("eccentric_encoder", told)))


def _skew(machine: Machine, size: float, rng: np.random.Generator, quantities: tuple[str, ...]) -> Concealed:
    ratio = 0.02 * size
    return Concealed("clock_skew", {}, {"ratio": ratio}, None, ratio)


def _limit(machine: Machine, size: float) -> float:
    return machine.top * (1.0 - 0.55 * size**0.5)


ANYWHERE: Mapping[str, Draw] = {
    "coulomb_friction": _torque("coulomb_friction", 0.06),
    "stribeck_friction": _stribeck,
    "asymmetric_friction": _asymmetric,
    "presliding_friction": _presliding,
    "quadratic_drag": _drag,
    "load_torque": _torque("load_torque", 0.06),
    "load_step": _load_step,
    "flexible_coupling": _coupling,
    "backlash": _backlash,
    "dead_zone": _one("dead_zone", "dead_zone", "half_width", lambda m, s: 0.15 * s * m.top),
    "input_saturation": _one("input_saturation", "limit", "limit", _limit),
    "slew_rate_limit": _one("slew_rate_limit", "slew", "rate", lambda m, s: m.top / (0.05 * s)),
    "input_delay": _one("input_delay", "delay", "delay", lambda m, s: 8e-3 * s),
    "sensor_offset": _sensor("sensor_offset", "offset", lambda m, s, q: 0.1 * s * _reach(m, q)),
    "sensor_lag": _sensor("sensor_lag", "time_constant", lambda m, s, q: 0.01 * s),
    "sensor_delay": _sensor("sensor_delay", "delay", lambda m, s, q: 0.01 * s),
    "sensor_saturation": _sensor("sensor_saturation", "limit", lambda m, s, q: (1.0 - 0.6 * s**0.5) * _reach(m, q)),
    "sensor_quantization": _quantization,
    "clock_skew": _skew,
}
MOTOR_ONLY: Mapping[str, Draw] = {
    "load_dependent_friction": _load_friction,
    "gravity_torque": _gravity,
    "cogging_torque": _cogging,
    "torque_ripple": _ripple,
    "torque_constant_saturation": _one(
        "torque_constant_saturation", "kt_saturation", "current", lambda m, s: 0.45 * m.stall / s**0.5
    ),
    "resistance_heating": _heating,
    "brush_drop": _one("brush_drop", "brush", "voltage", lambda m, s: 0.12 * s * m.top),
    "inductance_saturation": _one(
        "inductance_saturation", "l_saturation", "current", lambda m, s: 0.25 * m.stall / s**0.5
    ),
    "sensor_rectified": _sensor("sensor_rectified", "", lambda m, s, q: 1.0),
    "sensor_wrap": _sensor("sensor_wrap", "range", lambda m, s, q: 2.0 * (1.0 - 0.6 * s**0.5) * _reach(m, q)),
    "eccentric_encoder": _eccentric,
}
STAGE_ONLY: Mapping[str, Draw] = {
    "end_stop": lambda m, s, rng, q: Concealed(
        "end_stop",
        {"stop": 0.03 / s**0.3, "stop_stiffness": 400.0 * m.effort * rng.uniform(0.5, 1.5) * 0.3},
        {"position": 0.03 / s**0.3},
    ),
    "return_spring": _one("return_spring", "spring", "stiffness", lambda m, s: 5.0 * s * m.effort),
    "hardening_spring": _one("hardening_spring", "cubic", "cubic", lambda m, s: 100.0 * s * m.effort),
}


def _thinned(machine: Machine, size: float) -> Mapping[str, float]:
    """Return grease that is thinner by up to `size` logarithms where it is warm: a third of the largest effort."""
    viscous = machine.values["b"] + 0.3 * machine.effort / machine.speed
    return {"b": viscous, "thinning": 3.0 * size / (0.3 * machine.effort * machine.speed), "thinning_time": 1.5}


OUTSIDE: Mapping[str, Callable[[Machine, float], Mapping[str, float]]] = {
    "angle_dependent_damping": lambda m, s: {"angle_damping": 0.9, "b": m.values["b"] * (1.0 + 4.0 * s)},
    "periodic_torque": lambda m, s: {"periodic": 0.06 * s * m.effort, "periodic_hz": 7.3},
    "one_sided_gain": lambda m, s: {"gain_asymmetry": 0.25 * s},
    "hysteretic_spring": lambda m, s: {"hysteresis": 0.12 * s * m.effort, "hysteresis_reach": 0.02 * m.speed},
    "position_dependent_inertia": lambda m, s: {"inertia_wave": 0.5 * s},
    "viscosity_by_heat": _thinned,
    "intermittent_drive": lambda m, s: {"outage": 0.03 * s},
}
# Those of the mixture of strata, whose seeds are known.
MIXED = ("angle_dependent_damping", "hysteretic_spring", "one_sided_gain", "periodic_torque")


def effects_for(machine: Machine, quantities: tuple[str, ...], closed: bool) -> Mapping[str, Draw]:
    """Every effect that this machine can have and these sensors can carry."""
    found = {**ANYWHERE, **(MOTOR_ONLY if machine.motor else STAGE_ONLY)}
    if "position" not in quantities:
        found.pop("eccentric_encoder", None)
    if "speed" not in quantities and "current" not in quantities:
        found.pop("sensor_rectified", None)
    if "current" not in quantities:  # a lone speed carries no trace of the winding's inductance
        found.pop("inductance_saturation", None)
    return found
