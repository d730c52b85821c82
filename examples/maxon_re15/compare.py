"""Compare every controller that the RE 15 study names on one motor, with one step of the speed and one of the load.

    python -m examples.maxon_re15.compare

The motor is the bench's (bench.py): equations of its own, 4 to 8 % off the data sheet that the controllers are designed
from, with noisy readings. Each controller runs as its program, bit for bit what its C computes; where there are
a cross compiler and an emulated Cortex-M4F, its C is run there, held against the program, and its instructions counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from examples.audit_table import step_figures
from examples.maxon_re15.bench import Motor, read
from examples.maxon_re15.controllers import PERIOD, Contestant, contestants, model, static_gain, tuned
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.law import Law
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.link import LinkError
from firmloop.verify.reference import Machine, start_state
from firmloop.verify.run import verify
from firmloop.verify.scaling import to_physical, to_raw

Array = NDArray[np.float64]

TARGET = 450.0  # rad/s, of the step at 0
LOAD, LOADED, SECONDS = 1.5e-3, 0.1, 0.2  # N m from which second on, s; about the motor's rated torque
TARGET_NAME, STEPS = "qemu_mps2_an386", 2_000
SEED = 4


@dataclass(frozen=True, slots=True)
class Figures:
    """What one controller did: of the true speed, not of the readings."""

    rise: float  # s, 10 to 90 %
    overshoot: float  # %
    settling: float  # s, 2 %
    error: float  # %, mean of the last 20 ms before the load
    step_iae: float  # rad
    step_ise: float  # rad^2/s
    dip: float  # rad/s, largest after the load
    load_iae: float  # rad
    load_ise: float  # rad^2/s


class Running:
    """A program in motion, one sample after the other."""

    def __init__(self, program: Program) -> None:
        self.program, self.machine = program, Machine(program)
        self.state = start_state(program, 1)

    def step(self, given: Mapping[str, float]) -> float:
        """Return the first output (in its unit) for inputs by name."""
        raw = [to_raw(value, np.array([given[value.name]])) for value in self.program.inputs]
        values = self.machine.step([x.astype(np.int64) for x in raw], self.state)
        self.state = [np.broadcast_to(values[slot], 1) for slot in self.machine.next]
        return float(to_physical(self.program.outputs[0], np.atleast_1d(values[self.machine.results[0]]))[0])


Answer = Callable[[float, float], float]  # current A and speed rad/s as read -> voltage V


def course(answer: Answer) -> Array:
    """Run a loop on the bench's motor; return the true speed (n,) at the samples."""
    random, motor, speeds = np.random.default_rng(SEED), Motor(), []
    for k in range(round(SECONDS / PERIOD)):
        current, speed = (float(x) for x in read(motor.state, random))
        speeds.append(motor.state[1])
        motor.go(PERIOD, answer(current, speed), LOAD if k * PERIOD >= LOADED else 0.0)
    return np.array(speeds)


def closed(program: Program) -> Answer:
    """Let a program follow the measured speed."""
    controller = Running(program)
    return lambda current, speed: controller.step({"reference": TARGET, "measurement": speed})


def without_sensor(program: Program, watcher: Program) -> Answer:
    """Let a program follow the speed that another makes of voltage and current."""
    controller, observer, applied = Running(program), Running(watcher), [0.0]

    def answer(current: float, speed: float) -> float:
        seen = observer.step({"voltage": applied[-1], "current": current})
        applied.append(controller.step({"reference": TARGET, "measurement": seen}))
        return applied[-1]

    return answer


def of(contestant: Contestant) -> Answer:
    """Close the loop of one contestant."""
    if contestant.watcher:
        return without_sensor(contestant.program, contestant.watcher[1])
    return closed(contestant.program)


def figures(speed: Array) -> Figures:
    """Measure a course of the speed (n,)."""
    split = round(LOADED / PERIOD)
    before, after = speed[:split] - TARGET, speed[split:] - TARGET
    found = step_figures(np.arange(split) * PERIOD, speed[:split], TARGET)
    tail = float(before[-round(0.02 / PERIOD) :].mean())
    return Figures(
        found["rise"],
        found["overshoot"],
        found["settling_2"],
        100 * abs(tail) / TARGET,
        float(np.abs(before).sum()) * PERIOD,
        float((before**2).sum()) * PERIOD,
        float(-after.min()),
        float(np.abs(after).sum()) * PERIOD,
        float((after**2).sum()) * PERIOD,
    )


def counted(contestant: Contestant) -> str:
    """Run the C on an emulated Cortex-M4F and count its instructions; without the tools, say which is missing."""
    pairs = [(contestant.law, contestant.program), *([contestant.watcher] if contestant.watcher else [])]
    try:
        return " + ".join(f"{_instructions(law, program):,}" for law, program in pairs)
    except (ToolError, LinkError) as error:
        return f"not counted: {error}"


def _instructions(law: Law, program: Program) -> int:
    bundle = emit(program, "examples")
    verdict = verify(law, program, bundle, load_target(TARGET_NAME), (), STEPS, 1, None, lambda share, label: None)
    if not verdict.agrees or verdict.cost.instructions_max is None:
        raise LinkError(f"{program.name} differs from its reference")
    return int(verdict.cost.instructions_max)


def open_and_closed() -> list[tuple[str, Figures]]:
    """Do what the study's table 1 does: each order in open loop, by the voltage its gain asks for, and in closed loop.

    The motor is the same; it is the model that is of first or second order.
    """
    made = []
    for order, name in ((1, "re15_first_order.toml"), (2, "re15.toml")):
        plant = model(name)
        volts = TARGET / static_gain(plant)
        law, _ = tuned("ise", "pi", plant, f"re15_order_{order}")
        made.append((f"open loop, order {order}", figures(course(lambda current, speed, held=volts: held))))
        made.append((f"closed loop, order {order}", figures(course(closed(lower(law, "fixed32"))))))
    return made


def line(name: str, f: Figures, cost: str) -> str:
    """Write one row of the table."""
    cells = [
        name,
        f"{1e3 * f.rise:.2f}",
        f"{f.overshoot:.1f}",
        f"{1e3 * f.settling:.1f}" if f.settling else "not",
        f"{f.error:.2f}",
        f"{f.step_iae:.3f}",
        f"{f.step_ise:.1f}",
        f"{f.dip:.1f}",
        f"{f.load_iae:.3f}",
        f"{f.load_ise:.2f}",
        cost,
    ]
    return f"| {' | '.join(cells)} |"


def table(cost: Callable[[Contestant], str]) -> str:
    """Write both tables as Markdown."""
    lines = [
        f"Step to {TARGET:g} rad/s, at {LOADED:g} s a load of {1e3 * LOAD:g} mN m; period {1e3 * PERIOD:g} ms; fixed32 "
        "where nothing else is said.",
        "",
        "| | rise ms | overshoot % | settling 2 % ms | error % | step IAE rad | step ISE rad^2/s | load dip rad/s "
        "| load IAE rad | load ISE rad^2/s | instructions |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [line(name, found, "-") for name, found in open_and_closed()]
    lines += [line(one.name, figures(course(of(one))), cost(one)) for one in contestants()]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    print(table(counted), end="")
