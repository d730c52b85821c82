"""Judge nonlinear predictive control: bits, instructions, and whether a step that is called good is the optimum.

    python -m bench.mpc.nmpc [--states 100000] [--judged 300]

Three controllers: the swing-up of examples/pendulum_nmpc, the same between the ends of a short track, so that many
states have no moves that keep it, and the motor with friction of examples/motor_nmpc. Of each:

- random states, reachable or not, every fourth without a plan and three from the plan of an unrelated state, some
  with NaN, infinities and numbers far outside: the C on the host and on the emulated M4F against its Python twin;
- runs from random states against the plant itself: where the status word is clean, u must be that of the nonlinear
  program's optimum, found by ipopt in double precision from the same plan, within ALLOWED of its range.

Exit status 1 when a bit differs, a clean status is wrong, an output leaves its limits, or one step of ten samples takes
more than the instructions allowed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design
from firmloop.design.law import Horizon, Law
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.stages.plant import plant_of
from firmloop.verify.block import Block
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.host import build_host
from firmloop.verify.build.image import build_image
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.opener import openers
from firmloop.verify.reference import Machine, Trace, run, start_state

EXAMPLES = Path(__file__).parents[2] / "examples"
TARGET = "qemu_mps2_an386"
TRACK = {"x_min": [-0.9, -np.inf, -np.inf, -np.inf], "x_max": [0.9, np.inf, np.inf, np.inf]}
STEPS = 4  # of a random lane: the first has no plan
JUDGED_STEPS = 12  # of a run against the plant
ALLOWED = 0.01  # of the range of the output: what the status word promises
MOST = 150_000  # instructions of one step
FAILED = 3  # the bits `capped` and `infeasible`


@dataclass(frozen=True)
class Case:
    """A controller and what it takes to judge it."""

    name: str
    law: Law
    program: Program
    bundle: Bundle
    seconds: float  # of the processor, from the project to its C

    @property
    def horizon(self) -> Horizon:
        """The program that every sample takes a step of."""
        assert self.law.solve is not None and isinstance(self.law.solve.problem, Horizon)
        return self.law.solve.problem


def made(name: str, example: str, keys: Mapping[str, Any]) -> Case:
    """Design the controller of an example, with other keys, and write its C."""
    begun = time.process_time()
    project = read_project(EXAMPLES / example / f"{example}.toml")
    part = project.controller
    assert part is not None
    table = {key: value for key, value in {**part.settings, **keys}.items() if key not in ("kind", "period_s")}
    wires = project.controller_inputs, project.controller_outputs
    law = design("nmpc", project.name, table, part.period, *wires, plant_of(project)).law
    program = lower(law, "float32")
    bundle = emit(program, f"firmloop generate {example}.toml")
    return Case(name, law, program, bundle, time.process_time() - begun)


class Judge:
    """The whole nonlinear program, states kept, solved by ipopt in double precision from a given plan."""

    def __init__(self, horizon: Horizon) -> None:
        n, m, length = len(horizon.q), len(horizon.r), horizon.length
        x, u = ca.SX.sym("x", n, length + 1), ca.SX.sym("u", m, length)
        target, last = ca.SX.sym("t", n), ca.SX.sym("last", m)
        cost, gaps = ca.SX(0), []
        self.after = horizon.model.last.function
        for k in range(length):
            weight = horizon.q if k < length - 1 else horizon.p
            away, push = x[:, k + 1] - target, u[:, k] - horizon.rest
            change = u[:, k] - (u[:, k - 1] if k else last)
            cost += (away.T @ weight @ away + push.T @ horizon.r @ push) / 2
            cost += ca.dot(change * horizon.change, change) / 2
            gaps.append(x[:, k + 1] - self.after(ca.SX(0, 1), ca.vertcat(x[:, k], u[:, k]))[1][:n])
        problem = {"x": ca.veccat(x, u), "f": cost, "g": ca.vertcat(*gaps), "p": ca.vertcat(target, last)}
        quiet = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-9, "error_on_fail": False}
        self.solver, self.horizon = ca.nlpsol("optimum", "ipopt", problem, quiet), horizon
        low, high = np.full((length, n), -np.inf), np.full((length, n), np.inf)
        low[:, horizon.limited], high[:, horizon.limited] = horizon.low[m:], horizon.high[m:]
        self.states = low.ravel(), high.ravel()
        self.moves = np.tile(horizon.low[:m], length), np.tile(horizon.high[:m], length)

    def moved(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return the state one sample later."""
        return np.array(self.after([], np.append(x, u))[1]).ravel()[: len(x)]

    def move(self, x: np.ndarray, target: np.ndarray, last: np.ndarray, moves: np.ndarray) -> np.ndarray | None:
        """Return u[0] (m,) of the optimum near the plan `moves` (N, m), None where ipopt finds none."""
        states = [x]
        for u in moves:
            states.append(self.moved(states[-1], u))
        found = self.solver(
            x0=np.concatenate([*states, moves.ravel()]), p=np.concatenate([target, last]), lbg=0, ubg=0,
            lbx=np.concatenate([x, self.states[0], self.moves[0]]),
            ubx=np.concatenate([x, self.states[1], self.moves[1]]),
        )  # fmt: skip
        if not self.solver.stats()["success"]:
            return None
        first = len(x) * (self.horizon.length + 1)
        return np.array(found["x"]).ravel()[first : first + len(last)]


def random_states(program: Program, count: int) -> Block:
    """Return lanes of random inputs: near and far within the range, one in twenty beyond it, one in fifty no number."""
    random = np.random.default_rng(7)
    low, high = (np.array([getattr(value, end) for value in program.inputs]) for end in ("low", "high"))
    shape = (count // STEPS, STEPS, len(low))
    near = random.uniform(-1, 1, size=shape) * random.uniform(0, 1, size=(*shape[:2], 1))
    near *= np.where(random.uniform(size=shape[:2]) < 0.05, 1e3, 1.0)[..., None]
    inputs = (low + high) / 2 + near * (high - low) / 2
    broken = random.uniform(size=shape) < 0.02 / len(low)
    inputs[broken] = random.choice([np.nan, np.inf, -np.inf, 3e38, 1e-42], size=int(broken.sum()))
    return Block("random", inputs.astype(np.float32))


def judge(case: Case, count: int) -> tuple[str, int]:
    """Run the controller against the plant from random states and judge each step; return what to print, and faults."""
    horizon, program = case.horizon, case.program
    referee, random = Judge(horizon), np.random.default_rng(3)
    lanes, wires = max(1, count // JUDGED_STEPS), list(case.law.states)
    n, m = len(horizon.q), len(horizon.r)
    low, high = (np.array([getattr(value, end) for value in program.inputs]) for end in ("low", "high"))
    held = (low + high) / 2 + random.uniform(-0.5, 0.5, size=(lanes, len(low))) * (high - low)
    held[::2, wires] *= 0.2  # near the middle, where plans settle
    x, machine, state = held[:, wires], Machine(program), start_state(program, lanes)
    last, tally = np.zeros((lanes, m)), np.zeros(4, np.int64)  # clean, unsettled, failed, failed but solvable
    worst, wrong = 0.0, 0
    span = horizon.high[:m] - horizon.low[:m]
    for _ in range(JUDGED_STEPS):
        seen = held.copy()
        seen[:, wires] = x
        seen = seen.astype(np.float32)
        with np.errstate(all="ignore"):
            values = machine.step(list(seen.T), state)
        status = sum(np.broadcast_to(values[slot], lanes).astype(int) << bit for slot, bit in machine.status)
        u = np.stack([np.broadcast_to(values[slot], lanes) for slot in machine.results], axis=1).astype(np.float64)
        state = [np.broadcast_to(values[slot], lanes) for slot in machine.next]
        parameters = case.law.solve.function  # type: ignore[union-attr]
        before = np.zeros(parameters.numel_in(0))
        for lane in range(lanes):
            exact = seen[lane].astype(np.float64)
            target = np.array(parameters(before, exact)).ravel()[n : 2 * n]
            plan = _moves(case, state, lane, u[lane])
            failed, unsettled = bool(status[lane] & FAILED), bool(status[lane] & ~FAILED)
            tally[2 if failed else int(unsettled)] += 1
            best = None if unsettled and not failed else referee.move(exact[wires], target, last[lane], plan)
            tally[3] += failed and best is not None
            if not failed and not unsettled:
                away = np.inf if best is None else float(np.max(np.abs(u[lane] - best) / span))
                worst, wrong = max(worst, away), wrong + (away > ALLOWED)
            wrong += not np.all(np.isfinite(u[lane]) & (u[lane] >= horizon.low[:m]) & (u[lane] <= horizon.high[:m]))
            x[lane] = referee.moved(exact[wires], u[lane])
        last = u
    text = (
        f"{tally[:3].sum()} steps judged by ipopt: {tally[0]} clean, worst {worst:.1e} of the range, {wrong} wrong; "
        f"{tally[1]} told unsettled, {tally[2]} told failed ({tally[3]} of these ipopt solves)"
    )
    return text, wrong


def _moves(case: Case, state: list[np.ndarray], lane: int, u: np.ndarray) -> np.ndarray:
    """Return the moves (N, m) of the plan that ends in `state`, from before it was moved up by a sample."""
    m, length = len(case.horizon.r), case.horizon.length
    kept = np.array([part[lane] for part in state[-m * length :]], np.float64).reshape(length, m)
    return np.vstack([u, kept[:-1]])


def failures(trace: Trace, block: Block, case: Case) -> tuple[int, int]:
    """Return how many steps had an input that is no number, and how many of these went unsaid or beyond a limit."""
    m, broken = len(case.horizon.r), ~np.all(np.isfinite(block.inputs), axis=2)
    low, high = case.horizon.low[:m].astype(np.float32), case.horizon.high[:m].astype(np.float32)
    kept = np.all((trace.outputs >= low) & (trace.outputs <= high), axis=2)
    return int(broken.sum()), int(np.sum(~kept) + np.sum(kept & broken & ((trace.status & FAILED) == 0)))


def measure(case: Case, states: int, judged: int) -> int:
    """Print a controller's figures; return how much is wrong."""
    print(f"\n{case.name}: {case.law.says}\n  generation        {case.seconds:.1f} s of one processor", flush=True)
    text, wrong = judge(case, judged)
    print(f"  optimum           {text}", flush=True)
    block = random_states(case.program, states)
    trace = run(case.program, block.inputs)
    told = trace.status.ravel() & FAILED
    broken, unsaid = failures(trace, block, case)
    print(
        f"  failed solves     {np.sum((told & 2) > 0):,} infeasible, {np.sum(told == 1):,} capped of {told.size:,} "
        f"random states; {broken:,} with NaN or infinity; {unsaid} unsaid or beyond the output's limits",
        flush=True,
    )
    host = LibraryLink(build_host(case.bundle, load_target("host")), case.program)
    done = compare(case.program, host, [block], [trace], lambda part, label: None)
    print(f"  host              {done.steps:,} states, {done.differences} differences", flush=True)
    steps, differences, counts, sizes = _on_target(case, block, trace)
    print(f"  {TARGET}   {steps:,} states, {differences} differences; {sizes}")
    print(
        f"  one step          median {np.median(counts):,.0f}, worst {counts.max():,} instructions",
        flush=True,
    )
    return wrong + unsaid + done.differences + differences + int(counts.max() > MOST)


def _on_target(case: Case, block: Block, trace: Trace) -> tuple[int, int, np.ndarray, str]:
    """Return steps, differences, instructions a step, and the sizes as text."""
    target = load_target(TARGET)
    opener = openers()[target.links[0]]
    with tempfile.TemporaryDirectory(prefix="firmloop-") as folder:
        image = build_image(firmware(case.program, case.bundle, target, opener.transport), target, Path(folder))
        with opener.open(target, image.elf, case.program.id) as link:
            done = compare(case.program, link, [block], [trace], lambda part, label: None)
            counts = instructions(done.ticks, link.hello().overhead_ticks, target)
    own, helpers = image.controller, ", ".join(image.double_helpers) or "no double helpers"
    stack = "unknown" if image.stack_bytes is None else f"{image.stack_bytes:,} B"
    return done.steps, done.differences, counts, f"{own.text_bytes:,} B flash, stack {stack}; {helpers}"


def main() -> int:
    """Measure the three controllers."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--judged", type=int, default=300)
    given = parser.parse_args()
    cases = (
        ("swing-up", "pendulum_nmpc", {}),
        ("swing-up on a short track", "pendulum_nmpc", TRACK),
        ("motor with friction", "motor_nmpc", {}),
    )
    return 1 if sum(measure(made(*case), given.states, given.judged) for case in cases) else 0


if __name__ == "__main__":
    sys.exit(main())
