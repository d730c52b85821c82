"""Spell samples as lines that other plotting programs read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from firmloop.stages.board.channels import Channel

Spelling = Callable[[Sequence[Channel], float, NDArray[np.float64]], Iterator[str]]


def teleplot(channels: Sequence[Channel], period: float, values: NDArray[np.float64]) -> Iterator[str]:
    """Yield `>name:milliseconds:value§unit`, a line a value, as Teleplot reads them."""
    ends = [f"§{channel.unit}" if channel.unit else "" for channel in channels]
    for step, *row in values.tolist():
        time_ms = f"{step * period * 1e3:.10g}"
        for channel, value, end in zip(channels, row, ends, strict=True):
            yield f">{channel.name}:{time_ms}:{value!r}{end}"


def serial_studio(channels: Sequence[Channel], period: float, values: NDArray[np.float64]) -> Iterator[str]:
    """Yield `/*seconds,value,value*/`, a line a sample, the frame that Serial Studio looks for by itself."""
    for step, *row in values.tolist():
        yield f"/*{step * period:.10g},{','.join(map(repr, row))}*/"


SPELLINGS: Mapping[str, Spelling] = {"teleplot": teleplot, "serial-studio": serial_studio}


def spelling_of(name: str | None) -> Spelling | None:
    """Return the spelling of that name."""
    return SPELLINGS[name] if name is not None else None
