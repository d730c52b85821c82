"""Say what an effect does in words of the plant: a tank and a circuit have no shaft, and no torque."""

from __future__ import annotations

from firmloop.identify.plants.plant import Plant
from firmloop.identify.units import stem_of

# What is said of a motor, and how it is said of what has neither shaft nor brushes, such as a tank or a circuit.
_STILL = {
    " with the shaft locked": "",
    " with a locked shaft": "",
    "brushes or the driver drop": "a diode or the driver drops",
    "a known current, speed or angle for comparison": "a known value for comparison",
    "very slow motion": "a very slow change",
    "motion in both directions": "values of both signs",
    "motion within": "values within",
    "slow motion": "a slow change",
}


def balance_told(plant: Plant, name: str) -> str:
    """Name a balance; that of a lag that turns nothing and moves nothing by its output."""
    return f"{name} balance" if plant.moves or plant.delay is None else f"balance of {plant.outputs[0].name}"


def missing_told(plant: Plant, kind: str) -> str:
    """Name what is missing from a balance of a kind."""
    bare = plant.moves or plant.delay is None or kind != "torque"
    return f"missing {kind}" if bare else f"missing in the {balance_told(plant, kind)}"


def in_its_words(plant: Plant, text: str) -> str:
    """Return a sentence about a shaft as it is said of this plant."""
    if any(balance.kind == "torque" for balance in plant.balances) and plant.moves:
        return text
    moved = "what moves" if plant.moves else plant.outputs[0].name
    for words, others in ({} if plant.moves else _STILL).items():
        text = text.replace(words, others)
    return text.replace("the shaft", moved).replace("torque", "force" if plant.moves else "input")


def constant_told(plant: Plant, name: str, acts: str) -> str:
    """Name a constant of an effect that `acts` in a place.

    What moves a lag is in its output's unit, whatever the name says that the effect has on an axis.
    """
    if plant.delay is None or acts != "torque" or not stem_of(name):
        return name
    return stem_of(name) if plant.moves else stem_of(name).replace("torque", "size")
