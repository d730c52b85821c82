"""Search random problems of predictive control in single precision, and set what is found beside float64.

    python -m bench.mpc.random_problems [--problems 60] [--states 100]

Plants of one to four states, stable, oscillating, integrating or unstable; horizons of 5 to 50; limits of the moves,
half of them with limited changes too, a third each with hard, soft and no limits of the states; weights and stiffness
over decades. Each is designed and rounded as `firmloop generate` does it, and searched from states drawn over the whole
declared region, most of them far beyond what a loop would reach. A problem that its design refuses counts as refused.

`capped` and `infeasible` are searches of which float64 says that there are moves, and which say so in their status;
`wrong` are moves called solved that are farther than ALLOWED of their range from the optimum, or where there are none
even if every limit is ALLOWED wider.
Exit status 1 when one is wrong.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np
import scipy.linalg

from firmloop.design.kinds import design
from firmloop.design.law import DesignError, Law
from firmloop.design.outcome import INFEASIBLE, SOLVED
from firmloop.design.quadratic.region import drawn_parameters
from firmloop.identify.signal import Signal
from firmloop.quantize.formats.quadratic import rows_of, table_of
from firmloop.quantize.lower.budget import budget_of
from firmloop.quantize.twins.qp import exact, solve, tolerance_of

HORIZONS = (5, 10, 20, 30, 50)
ALLOWED = 1e-3
OUTPUT = Signal("u", "1", -1.0, 1.0)


def plant(random: np.random.Generator, states: int, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return A and B of a plant with random poles, behind a hold."""
    poles: list[complex] = []
    while len(poles) < states:
        kind = random.integers(4)
        if kind == 3 and len(poles) < states - 1:
            frequency, damping = random.uniform(0.5, 4), random.uniform(0.02, 0.9)
            pole = frequency * complex(-damping, np.sqrt(1 - damping**2))
            poles += [pole, pole.conjugate()]
        else:
            poles.append((-random.uniform(0.2, 4), 0.0, random.uniform(0.1, 2), -1.0)[kind])
    a = np.eye(states, k=1)
    a[-1] = -np.real(np.poly(poles))[:0:-1]
    b = np.eye(states)[:, -1:]
    whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((1, states + 1))]]) * period)
    return whole[:states, :states], whole[:states, states:]


def law_of(seed: int) -> tuple[str, Law]:
    """Design a random problem; return what it is, too."""
    random = np.random.default_rng(seed)
    states, horizon = int(random.integers(1, 5)), int(random.choice(HORIZONS))
    period = random.uniform(0.5, 4) / horizon
    a, b = plant(random, states, period)
    table: dict[str, object] = {
        "A": a.tolist(), "B": b.tolist(), "Q": (10.0 ** random.uniform(-1, 1, states)).tolist(),
        "R": float(10.0 ** random.uniform(-3, 0)), "horizon": horizon, "u_min": -1.0, "u_max": 1.0,
    }  # fmt: skip
    size, kind, says = random.uniform(0.3, 1.5, states), random.integers(3), f"{states} states, horizon {horizon}"
    if kind:
        limit = np.where(random.integers(2, size=states) > 0, 0.6 * size, np.inf)
        table |= {"x_max": limit.tolist(), "x_min": (-limit).tolist()}
        says += f", {np.isfinite(limit).sum()} {'soft' if kind == 2 else 'hard'}"
    if kind == 2:
        table["x_soft"] = float(10.0 ** random.uniform(1, 5))
    if random.integers(2):
        change = float(random.uniform(0.05, 0.6))
        table |= {"du_min": -change, "du_max": change}
        says += ", changes limited"
    inputs = tuple(Signal(f"x_{k}", "1", -float(x), float(x)) for k, x in enumerate(size))
    return says, design("mpc", f"random_{seed}", table, float(period), inputs, (OUTPUT,), None).law


def measure(says: str, law: Law, count: int) -> np.ndarray:
    """Print a problem's line if there is something to say; return searches, capped, infeasible and wrong ones."""
    assert law.solve is not None
    problem = law.solve.quadratic
    parameters = drawn_parameters(law, count, 7)[: 2 * count].astype(np.float32)
    best = solve(exact(problem), parameters.astype(np.float64))
    budget, checked = budget_of(law, problem, "float32")
    found = solve(rows_of(table_of(problem, "float32", "plan", budget, checked), np.dtype(np.float32)), parameters)
    away = np.abs(np.clip(found.moves, -1, 1) - np.clip(best.moves, -1, 1))[:, 0] / 2
    there = best.status == SOLVED
    slack = ALLOWED * tolerance_of(problem)
    wider = replace(problem, low=problem.low - slack, high=problem.high + slack)
    nearly = there | (solve(exact(wider), parameters.astype(np.float64)).status == SOLVED)
    wrong = (found.status == SOLVED) & (~nearly | (away > ALLOWED))
    infeasible = (found.status == INFEASIBLE) & (not problem.feasible)  # else the law says `capped`
    capped = (found.status != SOLVED) & ~infeasible
    row = np.array([np.count_nonzero(x) for x in (found.work, there & capped, there & infeasible, wrong)])
    if np.any(row[1:]):
        print(
            f"{law.name}: {says}; of {row[0]} searches {row[1]} capped, {row[2]} infeasible, {row[3]} wrong", flush=True
        )
    return row


def main() -> int:
    """Measure the problems asked for."""
    parser = argparse.ArgumentParser(prog="python -m bench.mpc.random_problems")
    parser.add_argument("--problems", type=int, default=60)
    parser.add_argument("--states", type=int, default=100)
    asked = parser.parse_args()
    sums, refused = np.zeros(4, np.int64), 0
    for seed in range(asked.problems):
        try:
            says, law = law_of(seed)
        except DesignError:
            refused += 1
            continue
        sums += measure(says, law, asked.states // 2)
    print(
        f"{asked.problems} problems, {refused} refused: {sums[0]:,} searches; float64 finds moves, but {sums[1]} are "
        f"capped, {sums[2]} called infeasible; {sums[3]} wrong"
    )
    return 1 if sums[3] else 0


if __name__ == "__main__":
    sys.exit(main())
