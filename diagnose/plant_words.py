"""Say what an effect does in words of the plant: a tank and a circuit have no shaft, and no torque."""

from __future__ import annotations

from firmloop.identify.plants.plant import Plant
from firmloop.identify.units import stem_of


def turns(plant: Plant) -> bool:
    """Tell whether a plant turns or moves something; a lag does where its output is called so."""
    if plant.delay is not None:
        return plant.outputs[0].name.partition("_")[0] in ("speed", "position")
    return any(balance.kind in ("torque", "force") for balance in plant.balances)


def balance_told(plant: Plant, name: str) -> str:
    """Name a balance; that of a lag that turns nothing and moves nothing by its output."""
    return f"{name} balance" if turns(plant) or plant.delay is None else f"balance of {plant.outputs[0].name}"


def missing_told(plant: Plant, kind: str) -> str:
    """Name what is missing from a balance of a kind."""
    bare = turns(plant) or plant.delay is None or kind != "torque"
    return f"missing {kind}" if bare else f"missing in the {balance_told(plant, kind)}"


def in_its_words(plant: Plant, text: str) -> str:
    """Return a sentence about a shaft as it is said of this plant."""
    if any(balance.kind == "torque" for balance in plant.balances) and turns(plant):
        return text
    moved = "what moves" if turns(plant) else plant.outputs[0].name
    return text.replace("the shaft", moved).replace("torque", "force" if turns(plant) else "input")


def constant_told(plant: Plant, name: str, acts: str) -> str:
    """Name a constant of an effect that `acts` in a place.

    What moves a lag is in its output's unit, whatever the name says that the effect has on an axis.
    """
    if plant.delay is None or acts != "torque" or not stem_of(name):
        return name
    return stem_of(name) if turns(plant) else stem_of(name).replace("torque", "size")
