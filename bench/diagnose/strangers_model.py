"""Move a motor or a body on a bearing by MuJoCo, with one piece of physics that its makers wrote."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MASS = 1e-3  # kg
STEP = 1e-5  # s: the first-order integrator is then wrong by a fiftieth of these sensors' noise


@dataclass(frozen=True, slots=True)
class Stranger:
    """Attributes in MJCF of what is hidden; each is empty where it is nothing."""

    joint: str = ""
    actuator: str = ""
    damping: str = ""  # further coefficients of the joint's damping
    armature: float = 0.0  # kg m^2, of a second body
    tendon: str = ""  # between the bodies
    gravity: float = 0.0  # m/s^2
    arm: tuple[float, float] = (0.0, 0.0)  # m, to a mass whose weight pulls
    constant: float = 0.0  # N m, against the motion
    most: float = np.inf  # A, at which the current is cut


def document(values: Mapping[str, float], hidden: Stranger) -> str:
    """Return the MJCF of a motor (where there is a resistance) or of a body that a torque moves."""
    inertia = values["J_kg_m2"]
    if "R_ohm" in values:
        drive = (
            f'<dcmotor joint="shaft" motorconst="{values["kt_N_m_A"]!r}" resistance="{values["R_ohm"]!r}" '
            f'input="voltage" inductance="{values["L_H"]!r}" {hidden.actuator}/>'
        )
    else:
        drive = f'<motor joint="shaft" {hidden.actuator}/>'
    second = ""
    if hidden.armature:
        second = (
            f'<body><inertial pos="0 0 0" mass="1" diaginertia="{_ball(hidden.armature)}"/>'
            f'<joint name="load" type="hinge" axis="0 0 1"/></body>'
        )
    weight = ""
    if hidden.gravity:
        weight = (
            f'<body pos="{hidden.arm[0]!r} {hidden.arm[1]!r} 0">'
            f'<inertial pos="0 0 0" mass="{MASS!r}" diaginertia="{_ball(1e-12)}"/></body>'
        )
    return (
        f'<mujoco><compiler angle="radian" autolimits="true"/>'
        f'<option timestep="{STEP!r}" integrator="implicitfast" gravity="0 {-hidden.gravity!r} 0"/><worldbody><body>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="{_ball(inertia)}"/>'
        f'<joint name="shaft" type="hinge" axis="0 0 1" damping="{values["b_N_m_s_rad"]!r} {hidden.damping}" '
        f"{hidden.joint}/>{weight}</body>{second}</worldbody>{hidden.tendon}"
        f'<actuator>{drive}<motor joint="shaft"/></actuator></mujoco>'
    )


def _ball(inertia: float) -> str:
    return " ".join([repr(float(inertia))] * 3)


def run(text: str, drive: Array, step: float, hidden: Stranger) -> Mapping[str, Array]:
    """Return current (where there is one), speed and position (n,) from rest, read just before `drive` (n,) acts."""
    import mujoco
    from mujoco import rollout

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    every = round(step / STEP)
    whole = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(model, whole))
    mujoco.mj_getState(model, data, start, whole)
    commands = np.zeros((1, len(drive) * every, model.nu))
    commands[0, :, 0] = np.repeat(drive, every)
    commands[0, :, 1] = -hidden.constant
    states, _ = rollout.rollout(model, data, start[None, :], commands)
    seen = np.concatenate([start[None, :], states[0, every - 1 : -1 : every]])
    speed = 1 + model.nq
    found = {"position_rad": seen[:, 1], "speed_rad_s": seen[:, speed]}
    if model.na:
        found["current_A"] = np.clip(seen[:, speed + model.nv + model.na - 1], -hidden.most, hidden.most)
    return found
