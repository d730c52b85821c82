"""Say in words what was guessed of recordings."""

from __future__ import annotations

from collections.abc import Iterator

from firmloop.console import table
from firmloop.project.first_text import FirstProject


def about_first(first: FirstProject) -> Iterator[str]:
    """Yield how the columns are read, the plant, the controller, and what was left aside."""
    yield f"plant: {first.kind}, {first.input} -> {', '.join(first.outputs)}"
    yield from table(
        [
            (foreign, "is", column.name, f"in {column.unit}" if column.unit else "", first.says.get(foreign, ""))
            for foreign, column in first.rename.items()
        ]
    )
    yield f"controller: pid, every {first.period:g} s"
    yield from table([(one.name, f"{one.low:g} to {one.high:g}", one.unit) for one in first.loop])
    for aside in first.asides:
        yield f"  note: {aside}"
