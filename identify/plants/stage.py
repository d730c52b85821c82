"""Write the equations of one inertia moved by one effort: m dv/dt = F - b v, dx/dt = v; linear and rotary alike."""

from __future__ import annotations

import math

import casadi as ca

from firmloop.identify.plants.kind import PlantConstant, PlantKind, equations
from firmloop.identify.plants.plant import Balance, Parameter, Plant
from firmloop.identify.signal import Signal


def stage_kind(
    name: str, effort: str, position: Signal, speed: Signal, inertia: PlantConstant, friction: PlantConstant
) -> PlantKind:
    """Return a kind driven by `effort` whose position is a state only where it is an output."""

    def build(inputs: tuple[Signal, ...], outputs: tuple[Signal, ...], parameters: tuple[Parameter, ...]) -> Plant:
        states = (speed, position) if position.name in {o.name for o in outputs} else (speed,)
        state, command, constants = ca.SX.sym("x", len(states)), ca.SX.sym("u"), ca.SX.sym("p", len(parameters))
        mass, damping, *per_unit = ca.vertsplit(constants)
        force = per_unit[0] * command if per_unit else command
        known = dict(zip((signal.name for signal in states), ca.vertsplit(state), strict=True))
        rates = {speed.name: (force - damping * state[0]) / mass, position.name: state[0]}
        return Plant(
            kind=name,
            states=states,
            inputs=inputs,
            outputs=outputs,
            parameters=parameters,
            rate=equations("rate", state, command, constants, ca.vertcat(*(rates[s.name] for s in states))),
            reading=equations("reading", state, command, constants, ca.vertcat(*(known[o.name] for o in outputs))),
            delay=None,
            balances=(
                Balance(
                    kind="torque" if position.unit == "rad" else "force",
                    state=0,
                    per=ca.Function("per", [constants], [1.0 / mass]),
                    position=len(states) - 1 if len(states) == 2 else -1,
                    effort=equations("effort", state, command, constants, force),
                ),
            ),
        )

    return PlantKind(
        name=name,
        constants=(inertia, friction),
        inputs=((effort,),),
        outputs=(position.name, speed.name),
        build=build,
        scale=None,
        per_unit=f"{effort.partition('_')[0]}_per_unit",
    )


def wide(name: str, unit: str) -> Signal:
    """Return a signal of the stage without limits."""
    return Signal(name, unit, -math.inf, math.inf)
