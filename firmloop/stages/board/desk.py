"""Where others ask for settings while a controller is watched, and wait until they are made."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from firmloop.stages.board.tape import Made, Setting, Tape

PATIENCE = 30.0  # s for a setting to be made: the line asks four times for a reply, of 2 s each


@dataclass(slots=True)
class _Order:
    setting: Setting
    made: Made | None = None
    over: threading.Event = field(default_factory=threading.Event)


class Desk:
    """Takes orders from any thread; the one that watches makes them, and notes them on its tape."""

    def __init__(self, tape: Tape) -> None:
        self._tape = tape
        self._orders: deque[_Order] = deque()

    def ask(self, setting: Setting) -> Made | None:
        """Wait until a setting is made; return None if the watch ended before."""
        order = _Order(setting)
        self._orders.append(order)
        if not self._tape.closed:
            order.over.wait(PATIENCE)
        return order.made

    def due(self, passed: int) -> Iterator[Setting]:
        """Give what is asked for, whatever the time; what was given is made once the next one is asked for."""
        while self._orders:
            order = self._orders[0]  # it stays where close() finds it until it is made
            yield order.setting
            order.made = self._tape.made[-1]
            self._orders.popleft().over.set()

    def close(self) -> None:
        """Tell those who still wait that nothing more is made."""
        while self._orders:
            self._orders.popleft().over.set()
