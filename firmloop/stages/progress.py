"""How a stage tells what it does and how far it is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

Report = Callable[[float, str], None]  # told the share of the work that is done, and what is being done
Stage = Callable[[str], AbstractContextManager[Report]]  # opened with the name of a stage, gives its Report


@contextmanager
def quietly(name: str) -> Iterator[Report]:
    """Tell nobody."""
    yield lambda share, doing: None
