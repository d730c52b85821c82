"""Measure the predictive controller on two problems of a cart-pole: instructions, accuracy, sizes, and bits.

    python -m bench.mpc.cart_pole PROBLEM.json...  200 recorded states and 10^5 random ones, on host and emulated M4F
    python -m bench.mpc.cart_pole --states 1000000 PROBLEM.json...      so many random ones on the host

A problem holds A, B, Q, R, QN, N, u_max, x_max and `x0_sequence`, the states of a recorded run. Each optimum is judged
by a solver in double precision that shares nothing with the generated code, on the problem before its states are
eliminated (qpOASES, through CasADi).

`warm start` compares the work of the searches from the recorded states, each from the unconstrained optimum, with the
least that any start can have: one that guesses the active set of the answer and takes the columns of its rows alone.

`at most` is what no search can take more of by construction, its work, at the largest cost of a unit of it that the
first TAUGHT random states tell; all others on the M4F are held against it.

Exit status 1 when a bit differs from the reference, an output is farther than 1e-3 from the optimum, or a step takes
more instructions than `at most`.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from firmloop.codegen.bundle import Bundle
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design
from firmloop.design.law import Law
from firmloop.design.outcome import COLUMN
from firmloop.identify.signal import Signal
from firmloop.quantize.formats.quadratic import rows_of
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.quantize.twins.qp import Solution, solve
from firmloop.verify.block import Block
from firmloop.verify.build.cost import instructions
from firmloop.verify.build.host import build_host
from firmloop.verify.build.image import build_image
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.links.opener import openers
from firmloop.verify.reference import Trace, run

STATES = ("p_m", "th_rad", "v_m_s", "w_rad_s")
UNITS = ("m", "rad", "m/s", "rad/s")
RANGES = (1.2, 0.8, 3.0, 5.0)
RANDOM = 100_000
ON_TARGET = 100_000
TAUGHT = 10_000
ALLOWED = 1e-3
TARGET = "qemu_mps2_an386"


def table_of(problem: dict[str, Any]) -> dict[str, object]:
    """Return [controller] for a problem file."""
    limit = [np.inf if x is None else float(x) for x in problem["x_max"]]
    return {
        "horizon": problem["N"] - 1,
        "states": list(STATES),
        **{key: problem[key] for key in ("A", "B", "Q", "R")},
        "P": problem["QN"],
        "u_min": -problem["u_max"],
        "u_max": problem["u_max"],
        "x_max": limit,
        "x_min": [-x for x in limit],
    }


def law_of(problem: dict[str, Any]) -> Law:
    """Design the controller of a problem file."""
    inputs = tuple(Signal(name, unit, -size, size) for name, unit, size in zip(STATES, UNITS, RANGES, strict=True))
    outputs = (Signal("force", "1", -problem["u_max"], problem["u_max"]),)
    return design("mpc", f"cart_{problem['name']}", table_of(problem), problem["Ts"], inputs, outputs, None).law


class Judge:
    """The optimum in double precision, from the problem as it is written: states and inputs, nothing eliminated."""

    def __init__(self, problem: dict[str, Any]) -> None:
        a, b = np.array(problem["A"]), np.array(problem["B"])
        n, m = b.shape
        steps = problem["N"] - 1
        parts: list[Any] = []
        for k in range(steps):
            parts += [np.diag(problem["R"]), np.diag(problem["Q"]) if k < steps - 1 else np.array(problem["QN"])]
        rows = []
        for k in range(steps):  # x[k+1] - A x[k] - B u[k] = 0
            row = np.zeros((n, steps * (n + m)))
            row[:, k * (n + m) : k * (n + m) + m] = -b
            row[:, k * (n + m) + m : (k + 1) * (n + m)] = np.eye(n)
            if k:
                row[:, k * (n + m) - n : k * (n + m)] = -a
            rows.append(row)
        self.a, self.n, self.rows = a, n, n * steps
        self.hessian = ca.DM(ca.diagcat(*[ca.DM(part) for part in parts]))
        self.constraints = ca.sparsify(ca.DM(np.vstack(rows)))
        limit = [np.inf if x is None else float(x) for x in problem["x_max"]]
        self.high = np.tile([problem["u_max"], *limit], steps)
        sparsity = {"h": self.hessian.sparsity(), "a": self.constraints.sparsity()}
        self.solver = ca.conic("judge", "qpoases", sparsity, {"error_on_fail": False, "printLevel": "none"})

    def move(self, state: np.ndarray) -> float | None:
        """Return u[0] from `state` (n,), None where no moves keep every limit."""
        right = np.zeros(self.rows)
        right[: self.n] = self.a @ state
        found = self.solver(
            h=self.hessian, g=0, a=self.constraints, lba=right, uba=right, lbx=-self.high, ubx=self.high
        )
        return float(found["x"][0]) if self.solver.stats()["success"] else None


def measure(path: Path, count: int) -> int:
    """Print one problem's figures; return how much is wrong."""
    problem = json.loads(path.read_text())
    begun = time.perf_counter()
    law = law_of(problem)
    program = lower(law, "float32")
    bundle = emit(program, f"firmloop generate {law.name}.toml")
    generated = time.perf_counter() - begun
    recorded = Block("recorded", np.array(problem["x0_sequence"], dtype=np.float32)[None])
    trace = run(program, recorded.inputs)
    judge = Judge(problem)
    found = [judge.move(state) for state in recorded.inputs[0].astype(np.float64)]
    solved = np.array([u is not None for u in found])
    best = np.array([np.nan if u is None else u for u in found])
    error = float(np.max(np.abs(trace.outputs[0, :, 0] - best)[solved]))
    status = np.bincount(trace.status.ravel() & 3, minlength=4)

    random = np.random.default_rng(1)
    states = random.uniform(-1, 1, size=(count, 4)) * np.array(RANGES) * random.uniform(0, 1, size=(count, 1))
    lots = Block("random", states.astype(np.float32)[:, None])
    lots_trace = run(program, lots.inputs)
    host = LibraryLink(build_host(bundle, load_target("host")), program)
    on_host = compare(program, host, [recorded, lots], [trace, lots_trace], lambda part, label: None)

    share = Block("random", lots.inputs[:ON_TARGET])
    share_trace = run(program, share.inputs)
    counts, differences, steps, sizes = _on_target(program, bundle, [recorded, share], [trace, share_trace])
    first, rest = counts[: recorded.inputs.shape[1]], counts[recorded.inputs.shape[1] :]
    bound = _bound(program, share.inputs[:TAUGHT, 0], rest[:TAUGHT])
    exceeded = int(np.count_nonzero(rest > bound))
    rows = rows_of(program.tables[0], np.dtype(np.float32))
    work = solve(rows, lots.inputs[:, 0]).work
    told = lots_trace.status.ravel() & 3
    print(f"\n{law.name}: {law.says}")
    print(f"  generation              {generated:.2f} s")
    print(
        f"  recorded states         median {np.median(first):,.0f}, mean {first.mean():,.0f}, "
        f"worst {first.max():,} instructions; solved {solved.sum()} of {len(solved)} (status {status.tolist()})"
    )
    print(f"  worst error of u0       {error:.2g} against qpOASES")
    print(f"  flash, stack, static    {sizes}")
    print(
        f"  host                    {on_host.steps:,} states, {on_host.differences} differences; "
        f"{np.count_nonzero(told == 2):,} infeasible, {np.count_nonzero(told == 1):,} capped"
    )
    print(f"  {TARGET}         {steps:,} states, {differences} differences; worst random {rest.max():,} instructions")
    print(
        f"  at most                 {bound:,} instructions: {bound / rest.max():.2f} of the worst random state; "
        f"{exceeded} of {len(rest):,} took more"
    )
    print(
        f"  work                    {work.max():,} in the worst of {len(work):,} random states, cut short at "
        f"{rows.budget:,}: {rows.budget / work.max():.2f} of it"
    )
    print(f"  warm start              {_guessed(solve(rows, recorded.inputs[0]))}")
    return on_host.differences + differences + exceeded + int(error > ALLOWED)


def _guessed(solution: Solution) -> str:
    """Say what a start that knows the active set of each answer would save."""
    active = np.count_nonzero(solution.side, axis=1)
    least = COLUMN * active + active * (active - 1) // 2  # each column costs COLUMN and 1 for each row already active
    return (
        f"work {solution.work.sum():,} from the unconstrained optimum, {least.sum():,} with every active set guessed; "
        f"worst {solution.work.max():,} and {least.max():,}"
    )


def _bound(program: Program, states: np.ndarray, counts: np.ndarray) -> int:
    """Return the instructions of a search that takes its whole budget, at the largest cost of a unit of work seen."""
    rows = rows_of(program.tables[0], np.dtype(np.float32))
    low, high = (np.array([getattr(value, end) for value in program.inputs], np.float32) for end in ("low", "high"))
    work = solve(rows, np.clip(states, low, high)).work
    base = counts[work == 0].max(initial=0)
    searched = work > 0
    unit = float(np.max((counts[searched] - base) / work[searched]))
    return int(np.ceil(base + unit * rows.longest))


def _on_target(
    program: Program, bundle: Bundle, blocks: list[Block], traces: list[Trace]
) -> tuple[np.ndarray, int, int, str]:
    """Return instructions a step, differences, steps, and the sizes as text."""
    target = load_target(TARGET)
    opener = openers()[target.links[0]]
    with tempfile.TemporaryDirectory(prefix="firmloop-") as folder:
        image = build_image(firmware(program, bundle, target, opener.transport), target, Path(folder))
        with opener.open(target, image.elf, program.id) as link:
            done = compare(program, link, blocks, traces, lambda part, label: None)
            counts = instructions(done.ticks, link.hello().overhead_ticks, target)
    own = image.controller
    helpers = ", ".join(image.double_helpers) or "no double helpers"
    sizes = f"{own.text_bytes:,} B, {image.stack_bytes:,} B, {own.data_bytes + own.bss_bytes} B; {helpers}"
    return counts, done.differences, done.steps, sizes


def main() -> int:
    """Measure every problem file named."""
    parser = argparse.ArgumentParser(prog="python -m bench.mpc.cart_pole")
    parser.add_argument("problems", nargs="+", type=Path)
    parser.add_argument("--states", type=int, default=RANDOM, help="random states on the host")
    asked = parser.parse_args()
    return 1 if sum(measure(path, asked.states) for path in asked.problems) else 0


if __name__ == "__main__":
    sys.exit(main())
