"""Follow the step numbers of a watched controller, and tell when they cannot be those of one that runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.verify.link import LinkError

SILENCE = 10.0  # s without a sample, beside the time of two, after which the controller has stopped
AHEAD = 2.0  # s that samples may be ahead of our clock, for they wait on the line before they are read
FASTER = 1.5  # than our clock: what an emulator's may be for a while
SLOWER = 20.0  # than our clock, beside MINUTE: an emulator's on a busy machine
MINUTE = 60.0  # s


@dataclass(frozen=True, slots=True)
class Watching:
    """What has come of one watch: every so many steps of `period` s, since `begun_at` by our clock.

    `last` is the latest step as the image counts, in 32 bits; `passed` are the steps since the first one.
    """

    period: float
    every: int
    begun_at: float
    heard_at: float = -1.0
    last: int = -1
    passed: int = 0

    @property
    def begun(self) -> bool:
        """Tell whether a sample has come."""
        return self.last >= 0

    def after(self, steps: NDArray[np.uint32], now: float) -> Watching:
        """Return what is known after more samples, whose steps these are.

        Raises
        ------
        LinkError
            when they stand still, go back, are not those asked for, or run ahead of the clock.
        """
        began = self.begun_at if self.begun else now
        before = np.concatenate([[self.last if self.begun else int(steps[0]) - 1], steps[:-1]]).astype(np.uint32)
        ahead = (steps - before).astype(np.int64)  # of 32 bits: backwards is far ahead
        passed = self.passed + int(ahead.sum()) - (0 if self.begun else 1)
        most = self._most(now - began)
        if not ahead.all() or (steps % self.every).any() or passed > most:
            k = int(np.argmax((ahead == 0) | (ahead > most) | (steps % self.every != 0)))
            raise LinkError(
                f"the controller sends step {int(steps[k])} after step {int(before[k])}, which no run does at a period "
                f"of {self.period:g} s: was it reset? watch again"
            )
        return replace(self, begun_at=began, heard_at=now, last=int(steps[-1]), passed=passed)

    def _most(self, seconds: float) -> float:
        """Return the most steps that a run makes in so long."""
        return (AHEAD + FASTER * seconds) / self.period + 2 * self.every

    def check_set(self, name: str, step: int, now: float) -> None:
        """Raise LinkError when a setting is said to act from a step on that is past, or not yet to be thought of."""
        if self.begun and self.passed + (step - self.last) % 2**32 > self._most(now - self.begun_at):
            raise LinkError(
                f"the controller says that {name} is set from step {step} on, after step {self.last}, which no run "
                "does: was it reset? watch again"
            )

    def check(self, steps: int, now: float) -> None:
        """Raise LinkError when nothing came for long, or the `steps` to be seen take far longer than they should."""
        if now - max(self.heard_at, self.begun_at) > SILENCE + 2 * self.every * self.period:
            raise LinkError("the controller sends no samples any more: was it reset?")
        if now - self.begun_at > MINUTE + SLOWER * steps * self.period:
            raise LinkError(
                f"the controller made {self.passed:,} of {steps:,} steps in {now - self.begun_at:.0f} s, far less than "
                "its period asks for: does its timer run?"
            )
