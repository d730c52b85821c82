"""Give a plant states behind its own, or take some away that move nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import casadi as ca

from firmloop.identify.plants.plant import Inside, Plant
from firmloop.identify.signal import Signal


def with_states(plant: Plant, added: Sequence[Signal], moves: Callable[[ca.SX], ca.SX]) -> Plant:
    """Return the plant with more states; `moves` gives their rates (k,) by the plant's own states (n,)."""
    n = len(plant.states)
    return _over(plant, (*plant.states, *added), lambda x: x[:n], lambda x, rate: ca.vertcat(rate, moves(x[:n])))


def without_states(plant: Plant, gone: Collection[int]) -> Plant:
    """Return the plant without the states of these numbers, on which nothing depends."""
    kept = [k for k in range(len(plant.states)) if k not in gone]
    places = {old: new for new, old in enumerate(kept)}

    def whole(x: ca.SX) -> ca.SX:
        return ca.vertcat(*(x[places[k]] if k in places else ca.SX(0) for k in range(len(plant.states))))

    made = _over(plant, tuple(plant.states[k] for k in kept), whole, lambda _, rate: rate[kept])
    balances = [
        replace(b, state=places.get(b.state, -1), position=places.get(b.position, -1), to=places.get(b.to, -1))
        for b in made.balances
    ]
    return replace(made, balances=tuple(balances))


def _over(
    plant: Plant, states: Sequence[Signal], own: Callable[[ca.SX], ca.SX], rated: Callable[[ca.SX, ca.SX], ca.SX]
) -> Plant:
    """Return the plant over other states, out of which `own` are those it has; `rated` are the rates by their rates."""
    x, u, p = ca.SX.sym("x", len(states)), ca.SX.sym("u", len(plant.inputs)), ca.SX.sym("p", plant.rate.numel_in(2))

    def over(function: ca.Function) -> ca.Function:
        return ca.Function(
            function.name(), [x, u, p], [ca.densify(function(own(x), u, p))], ["x", "u", "p"], ["result"]
        )

    inside = plant.inside
    if inside is not None:
        z = ca.SX.sym("z", len(inside.neutral))
        rate, reading, effort = (made(own(x), u, p, z) for made in (inside.rate, inside.reading, inside.effort))
        inside = Inside(
            ca.Function("rate", [x, u, p, z], [ca.densify(rated(x, rate))]),
            ca.Function("reading", [x, u, p, z], [ca.densify(reading)]),
            ca.Function("effort", [x, u, p, z], [effort]),
            inside.neutral,
        )
    moved = ca.densify(rated(x, plant.rate(own(x), u, p)))
    return replace(
        plant,
        states=tuple(states),
        rate=ca.Function("rate", [x, u, p], [moved], ["x", "u", "p"], ["result"]),
        reading=over(plant.reading),
        balances=tuple(
            replace(
                b,
                effort=None if b.effort is None else over(b.effort),
                current=None if b.current is None else over(b.current),
            )
            for b in plant.balances
        ),
        inside=inside,
    )
