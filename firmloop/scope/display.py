"""What a page is told of a watched controller, and what it may ask for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.recordings.recording import Recording
from firmloop.project.table import ProjectError
from firmloop.quantize.program import Program
from firmloop.stages.board.channels import Channel
from firmloop.stages.board.desk import Desk
from firmloop.stages.board.monitoring import recording_of
from firmloop.stages.board.tape import Made, Tape, steps_after
from firmloop.stages.board.tunables import setting_of
from firmloop.verify.link import LinkError
from firmloop.verify.scaling import to_physical


@dataclass(frozen=True, slots=True)
class Display:
    """A watch that goes on; `held` are the values of the parameters when it began, in their units."""

    target: str
    program: Program
    channels: tuple[Channel, ...]
    tape: Tape
    desk: Desk
    every: int
    held: Mapping[str, float]

    def facts(self) -> dict[str, object]:
        """Return what does not change while the watch goes on."""
        program = self.program
        return {
            "name": program.name,
            "program_id": program.id,
            "target": self.target,
            "period_s": program.period,
            "every": self.every,
            "channels": [
                {"name": each.name, "column": each.column, "unit": each.unit, "low": each.low, "high": each.high}
                for each in self.channels
            ],
            "tunables": [
                {"name": each.name, "unit": each.unit, "low": low, "high": high, "value": self.held[each.name]}
                for each in program.parameters
                for low, high in [to_physical(each, np.array([each.low, each.high])).tolist()]
            ],
            "status": [{"name": bit.name, "bit": bit.bit, "says": bit.says} for bit in program.status],
        }

    def values(self, rows: NDArray[np.void]) -> NDArray[np.float64]:
        """Return rows as numbers (n, 1 + channels): steps since the first sample, then each channel in its unit."""
        if not len(rows):
            return np.zeros((0, 1 + len(self.channels)))
        steps = (rows["step"] - np.uint32(self.tape.first)).astype(np.float64)
        return np.column_stack([steps, *(channel.physical(rows) for channel in self.channels)])

    def now(self) -> dict[str, float]:
        """Return the values that the parameters hold."""
        return {**self.held, **{made.setting.name: self._value(made) for made in self.tape.made}}

    def set(self, name: str, value: float) -> dict[str, str | float]:
        """Set a parameter on the controller; return what it holds now, and from when on.

        Raises
        ------
        ProjectError
            when it is none, or the value is beyond its proven range.
        LinkError
            when the watch ended before it was set.
        """
        made = self.desk.ask(setting_of(self.program, name, value, 0))
        if made is None:
            raise LinkError(f"{name} was not set: the controller is not watched any more")
        passed = steps_after(self.tape.first, made.step) if len(self.tape) else 0
        return {"name": name, "value": self._value(made), "time_s": passed * self.program.period}

    def recording(self, begin: int, end: int) -> Recording:
        """Return the rows from number `begin` to before `end` as a recording.

        Raises
        ------
        ProjectError
            when there are none.
        """
        rows = self.tape.read(begin, end - begin)
        if not len(rows):
            raise ProjectError(f"rows {begin} to {end}: there are none; there are {len(self.tape)} so far")
        return recording_of(self.program, self.channels, rows, "view")

    def _value(self, made: Made) -> float:
        parameters = {parameter.name: parameter for parameter in self.program.parameters}
        return float(to_physical(parameters[made.setting.name], made.setting.value)[0])


def held_of(program: Program, rows: NDArray[np.void]) -> dict[str, float]:
    """Return the values of the parameters in the last of some rows."""
    return {each.name: float(to_physical(each, rows[each.name][-1:])[0]) for each in program.parameters}
