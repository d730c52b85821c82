"""Write a case of a truth that strangers wrote: a machine of MuJoCo, seen through noisy sensors.

MuJoCo's `dcmotor` has an inductance, cogging, a winding that heats and LuGre friction; its joints have friction loss,
drag, springs, limits, weights and second bodies over a spring or a gap; its actuators have limits and delays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.hidden import Hidden, Truth, same_function, write_truth
from bench.diagnose.linear_plants import (
    Linear,
    drawn_motor,
    drawn_stage,
    motor_matrices,
    moved,
    project_text,
    stage_matrices,
)
from bench.diagnose.nulls import drawn_drive, drawn_memory, of_sensors
from bench.diagnose.strangers_model import MASS, STEP, Stranger, document, run
from bench.diagnose.visible import least_left
from firmloop.identify.recordings.recording import make_recording, write_recording

Array = NDArray[np.float64]
ROWS = 3000
NULLS = 0.4  # share of the cases
_COPPER = 0.00393  # 1/K, copper
_QUICK = 2e-5  # s; MuJoCo limits what makes torque of a current that goes on: a driver's limit where it follows at once


@dataclass(frozen=True, slots=True)
class Range:
    """How far the machine goes where nothing is hidden."""

    motor: bool
    effort: float  # N m, largest
    speed: float  # rad/s, rms
    travel: float  # rad, largest
    stall: float  # A
    inertia: float  # kg m^2
    resistance: float  # ohm


Draw = Callable[[Range, float, np.random.Generator], tuple[Stranger, Mapping[str, float]]]


def _coulomb(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level = 0.06 * size * r.effort
    return Stranger(joint=f'frictionloss="{level!r}"'), {"torque_N_m": level}


def _drag(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    figure = 0.1 * size * r.effort / r.speed**2
    return Stranger(damping=f"{figure!r}"), {"coefficient_N_m_s2_rad2": figure}


def _spring(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    figure = 0.3 * size * r.effort / r.travel
    return Stranger(joint=f'stiffness="{figure!r}"'), {"stiffness_N_m_rad": figure}


def _cubic(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    figure = 0.5 * size * r.effort / r.travel**3
    return Stranger(joint=f'stiffness="0 0 {figure!r}"'), {"cubic_N_m_rad3": figure}


def _gravity(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level, phase = 0.08 * size * r.effort, rng.uniform(-1.2, 1.2)
    # A torque -T sin(angle + phase) is the weight of a mass that hangs where the angle is -phase.
    arm = 1e-4 * r.inertia**0.5
    place = (arm * np.sin(phase), -arm * np.cos(phase))
    return Stranger(gravity=level / (MASS * arm), arm=(float(place[0]), float(place[1]))), {
        "amplitude_N_m": level,
        "phase_rad": phase,
    }


def _stop(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    place = r.travel * (1.0 - 0.6 * size)
    return Stranger(joint=f'range="{-100.0 * r.travel!r} {place!r}" {_elastic(25.0, 40.0)}'), {"position_rad": place}


def _elastic(hertz: float, damping: float) -> str:
    """Return the attributes of a limit at which a body rings at so many Hz, damped by so many 1/s.

    MuJoCo's limits take off a share of whatever else moves the body as well: one per cent of it here, where a spring
    takes off nothing (its documentation, "Constraint model: impedance").
    """
    return f'solreflimit="{-((2.0 * np.pi * hertz) ** 2)!r} {-damping!r}" solimplimit="0.01 0.01 0.001"'


def _load(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level = 0.06 * size * r.effort
    return Stranger(constant=level), {"torque_N_m": level}


def _coupling(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    second = r.inertia * rng.uniform(0.4, 1.0)
    reduced = second * r.inertia / (second + r.inertia)
    spring = reduced * (2.0 * np.pi * 15.0 / size**0.35) ** 2
    link = 0.1 * float(np.sqrt(spring * reduced))
    told = {"stiffness_N_m_rad": spring, "load_inertia_kg_m2": second, "damping_N_m_s_rad": link}
    between = _between(f'stiffness="{spring!r}" damping="{link!r}" springlength="0"')
    return Stranger(armature=second, tendon=between), told


def _backlash(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    second, gap = r.inertia * rng.uniform(0.4, 1.0), 0.2 * size
    told = {"gap_rad": gap, "load_inertia_kg_m2": second}
    return Stranger(armature=second, tendon=_between(f'range="{-gap / 2!r} {gap / 2!r}" {_elastic(80.0, 600.0)}')), told


def _between(attributes: str) -> str:
    ends = '<joint joint="shaft" coef="1"/><joint joint="load" coef="-1"/>'
    return f"<tendon><fixed {attributes}>{ends}</fixed></tendon>"


def _limit(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    top = (12.0 if r.motor else r.effort) * (1.0 - 0.5 * size**0.5)
    return Stranger(actuator=f'ctrlrange="{-top!r} {top!r}"'), {"limit_V" if r.motor else "limit_N_m": top}


def _delay(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    steps = max(int(0.012 * size / STEP), 2)
    told = {"delay_s": steps * STEP}
    return Stranger(actuator=f'delay="{steps * STEP!r}" nsample="{steps + 2}" interp="zoh"'), told


def _cogging(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level, count, phase = 0.08 * size * r.effort, float(rng.integers(4, 15)), rng.uniform(-1.2, 1.2)
    told = {"amplitude_N_m": level, "periods_per_rev": count, "phase_rad": phase}
    return Stranger(actuator=f'cogging="{level!r} {count!r} {phase - np.pi!r}"'), told  # drives where ours brakes


def _heating(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    rise = 0.15 * size / _COPPER / ((0.15 * r.stall) ** 2 * r.resistance)
    lag = rng.uniform(0.5, 2.0)
    told = {"rise_K_per_W": rise, "time_constant_s": lag}
    return Stranger(actuator=f'thermal="{rise!r} {lag / rise!r} 0 {_COPPER!r} 25 25"'), told


def _presliding(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level = 0.08 * size * r.effort
    stiffness = level / (0.02 * rng.uniform(0.5, 2.0) * r.speed)
    told = {"stiffness_N_m_rad": stiffness, "coulomb_N_m": level}
    return Stranger(actuator=f'lugre="{stiffness!r} 0 {level!r} {level!r} 1"'), told


def _stribeck(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    level, speed = 0.05 * size * r.effort, 0.1 * r.speed
    told = {"coulomb_N_m": level, "static_N_m": 2.0 * level, "stribeck_rad_s": speed}
    stiffness = 2.0 * level / (5e-5 * r.speed)
    # Critically damped bristles answer a quick fall of the friction by more than the friction itself.
    damping = 0.2 * float(np.sqrt(stiffness * r.inertia))
    return Stranger(actuator=f'lugre="{stiffness!r} {damping!r} {level!r} {2.0 * level!r} {speed!r}"'), told


def _current_limit(r: Range, size: float, rng: np.random.Generator) -> tuple[Stranger, Mapping[str, float]]:
    top = r.stall * (0.8 - 0.6 * size)
    return Stranger(actuator=f'saturation="0 {top!r} 0"', most=top), {"current_A": top}


ANYWHERE: Mapping[str, Draw] = {
    "coulomb_friction": _coulomb, "quadratic_drag": _drag, "return_spring": _spring, "hardening_spring": _cubic,
    "gravity_torque": _gravity, "end_stop": _stop, "load_torque": _load, "flexible_coupling": _coupling,
    "backlash": _backlash, "input_saturation": _limit, "input_delay": _delay,
}  # fmt: skip
MOTOR_ONLY: Mapping[str, Draw] = {
    "cogging_torque": _cogging, "resistance_heating": _heating, "presliding_friction": _presliding,
    "stribeck_friction": _stribeck, "current_limit": _current_limit,
}  # fmt: skip


def drawn_plant(rng: np.random.Generator) -> Linear:
    """Draw a motor or a rotary stage."""
    while True:
        plant = drawn_motor(rng) if rng.random() < 0.6 else drawn_stage(rng)
        if "linear" not in plant.table:
            return plant


def _matrices(plant: Linear, values: Mapping[str, float]) -> tuple[Array, Array, Array, Array]:
    return motor_matrices(values, plant.outputs) if "R_ohm" in values else stage_matrices(values, plant.outputs)


def _range(plant: Linear, drives: Sequence[Array]) -> Range:
    every = ("speed_rad_s", "position_rad")
    motor = "R_ohm" in plant.parameters
    matrices = motor_matrices(plant.parameters, every) if motor else stage_matrices(plant.parameters, every)
    gone = np.concatenate([moved(matrices, plant.step, drive) for drive in drives])
    resistance = plant.parameters.get("R_ohm", 1.0)
    stall = plant.top / resistance
    effort = stall * plant.parameters["kt_N_m_A"] if motor else plant.top
    speed, travel = float(np.std(gone[:, 0])), float(np.max(gone[:, 1]))
    return Range(motor, effort, speed, max(travel, 0.1), stall, plant.parameters["J_kg_m2"], resistance)


def _left(plant: Linear, drives: Sequence[Array], clean: Array, noise: Array, inertia: float) -> float:
    """Return what the best linear plant leaves of the noise-free outputs over the noise."""
    begin = {**plant.parameters, "J_kg_m2": inertia}
    free = [name for name in begin if name not in plant.held]
    position = np.array([float(name.startswith("position")) for name in plant.outputs])

    def simulation(at: Array) -> Array:
        factors = np.exp(at[:-1])
        values = {**begin, **{name: begin[name] * f for name, f in zip(free, factors, strict=True)}}
        made = [moved(_matrices(plant, values), plant.step, drive) for drive in drives]
        return np.asarray((np.concatenate(made) + at[-1] * position) / noise)

    return least_left(simulation, clean / noise, np.zeros(len(free) + 1))


def write(seed: int, folder: Path) -> None:
    """Write one case with one or two train recordings; four in ten hide nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 82])
    plant = drawn_plant(rng)
    count, color = int(rng.integers(1, 3)), str(rng.choice(["white", "first_order"]))
    drives = [plant.top * drawn_drive(ROWS, rng) for _ in range(count)]
    reach = _range(plant, drives)
    draws = {**ANYWHERE, **(MOTOR_ONLY if reach.motor else {})}
    size = float(10.0 ** rng.uniform(-1.0, 0.0))
    name = "" if rng.random() < NULLS else str(rng.choice(sorted(draws)))
    hidden, told = draws[name](reach, size, rng) if name else (Stranger(), {})
    if hidden.most < np.inf:
        plant = replace(plant, parameters={**plant.parameters, "L_H": _QUICK * plant.parameters["R_ohm"]})
    text = document(plant.parameters, hidden)
    clean, added = [], []
    scale = 0.005 * _sizes(plant, drives)
    memories = [drawn_memory(rng) for _ in scale]  # a sensor's is the same in every recording
    for k, drive in enumerate(drives):
        found = run(text, drive, plant.step, hidden)
        shown = np.stack([found[output] for output in plant.outputs], axis=1)
        clean.append(shown)
        noisy = shown + of_sensors(color, ROWS, rng, plant.step, scale, memories)
        noisy = np.round(noisy / (0.2 * scale)) * (0.2 * scale)
        added.append(noisy - shown)
        columns = {plant.input: drive, **dict(zip(plant.outputs, noisy.T, strict=True))}
        time = np.arange(ROWS) * plant.step
        write_recording(make_recording(time, columns, "train", ""), folder / f"train_{k + 1}.csv")
    (folder / "project.toml").write_text(project_text(plant, count, rng), encoding="utf-8")
    rms = np.sqrt(np.mean(np.concatenate(added) ** 2, axis=0))
    rigid = reach.inertia + hidden.armature
    left = _left(plant, drives, np.concatenate(clean), rms, rigid)
    output = None
    all_hidden = (Hidden(name, output, told, same_function(name, plant.outputs), left),) if name else ()
    sensors = [each.rsplit("_rad", 1)[0] for each in plant.outputs]
    about: dict[str, Any] = {
        "machine": "motor" if reach.motor else "stage",
        "color": color,
        "colored": color != "white",
    }
    about = {**about, "sensors": sensors, "size": size, "train": count, "test": 0, "linear_leaves": left}
    named = dict(zip(plant.outputs, rms.tolist(), strict=True))
    nominal = {**plant.parameters, "J_kg_m2": rigid}
    write_truth(Truth("strangers", seed, all_hidden, "", 0.0, nominal, named, about), folder)


def _sizes(plant: Linear, drives: Sequence[Array]) -> Array:
    made = [moved(plant.matrices, plant.step, drive) for drive in drives]
    return np.asarray(np.std(np.concatenate(made), axis=0))
