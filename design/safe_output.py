"""Read `safe_output` of [controller]: what each output is in a sample in which an input is not a number, or infinite.

One number for every output, or a table of numbers by the outputs' names::

    safe_output = 0.0
    safe_output = { left = 0.0, right = -1.0 }

An output that it does not name stands at its low limit then. It may be any value of the signal's range, also one beyond
`u_min` and `u_max`: what is safe need not be what the controller commands otherwise. In fixed point every input is a
number, and the key has no effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from firmloop.design.law import DesignError
from firmloop.design.table import real
from firmloop.identify.signal import Signal

KEY = "safe_output"


def safe_outputs(table: Mapping[str, object], outputs: Sequence[Signal]) -> tuple[float | None, ...]:
    """Return the safe value of each output, None for its low limit; none at all where the table has no such key."""
    if KEY not in table:
        return ()
    given = table[KEY]
    names = [output.name for output in outputs]
    if not isinstance(given, Mapping):
        return tuple(_within(KEY, given, output) for output in outputs)
    for name in given:
        if name not in names:
            raise DesignError(
                f"controller.{KEY} names {name!r}, which is no output of the controller; its outputs: "
                f"{', '.join(names)}"
            )
    return tuple(
        _within(f"{KEY}.{output.name}", given[output.name], output) if output.name in given else None
        for output in outputs
    )


def _within(key: str, value: object, output: Signal) -> float:
    number = real({key: value}, key, None)
    if not output.low <= number <= output.high:
        raise DesignError(
            f"controller.{key} = {number:g} is outside of signals.{output.name}, {output.low:g} to {output.high:g} "
            f"{output.unit}; give a value in that range, or widen the signal and keep u_min and u_max"
        )
    return number
