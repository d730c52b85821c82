"""Tell which input of a controller is the reference and which the measurement, and whether they can meet."""

from __future__ import annotations

from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal


def reference_and_measurement(inputs: tuple[Signal, ...]) -> tuple[int, int]:
    """Index of each: by the names `reference` and `measurement`, else the first and second input in file order."""
    names = [signal.name for signal in inputs]
    if len(names) < 2:
        raise DesignError(
            f"the controller has the inputs ({', '.join(names)}); it needs a reference and a measurement: "
            "add both to [signals]"
        )
    if "reference" in names and "measurement" in names:
        return names.index("reference"), names.index("measurement")
    if "reference" in names:
        reference = names.index("reference")
        return reference, 0 if reference else 1
    if "measurement" in names:
        measurement = names.index("measurement")
        return 0 if measurement else 1, measurement
    return 0, 1


def check_meeting(reference: Signal, measurement: Signal) -> None:
    """Refuse a reference that no measurement can reach: the error between them would never be 0."""
    if max(reference.low, measurement.low) > min(reference.high, measurement.high):
        raise DesignError(
            f"signals.{reference.name} ranges from {reference.low:g} to {reference.high:g}, signals.{measurement.name} "
            f"from {measurement.low:g} to {measurement.high:g}; they never meet: correct one of them"
        )
