"""Condense a linear predictive controller: from model, weights and limits over a horizon to rows with constant data.

With the parameters p of one sample (state, last output, disturbance, reference) and the moves v, the prediction is

    x[k+1] = A x[k] + B u[k] + E[k] p,   x[0] = X p,   U = (u[0] .. u[N-1]) = M v,   k = 0 .. N-1

and the problem  min 1/2 sum_k (x - x_s)'Q(x - x_s) + (u - u_s)'R(u - u_s) + 1/2 (x[N] - x_s)'P(x[N] - x_s), where the
targets x_s, u_s of each sample are linear in p, subject to limits on u, on its changes and on x[1] .. x[N].
Eliminating x leaves min 1/2 v'Hv + p'F'v, low <= Gv + Sp <= high; eliminating v as well leaves the rows of `Quadratic`
(Maciejowski, Predictive Control with Constraints, 2002, ch. 3). A soft limit costs 1/2 weight (excess)^2 in each
sample: its share of the gram's diagonal is 1/weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.law import DesignError, Quadratic

Array = npt.NDArray[np.float64]

MOST_ROWS = 500  # 1 MB of constants in float32: the flash of a large microcontroller
CONDITION = 1e8  # of H: beyond it the moves cannot be told apart in float32
SOFTEST = 2.0**-13  # share of a row that is its softness, at least: float32 cannot tell a stiffer one from a hard one
NONE = 1e-9  # a row this small beside its kind cannot be moved


@dataclass(frozen=True, slots=True)
class Constraints:
    """Limits of inputs (m,), of their changes (m,) and of states (n,), infinite where there is none; `soft` (n,)."""

    u_low: Array
    u_high: Array
    du_low: Array
    du_high: Array
    x_low: Array
    x_high: Array
    soft: Array  # weight of a state's excess; infinite: hard


@dataclass(frozen=True, slots=True)
class Prediction:
    """What is to be condensed; the columns of `start`, `drift`, `x_target`, `u_target`, `last` are the parameters."""

    a: Array  # (n, n)
    b: Array  # (n, m)
    q: Array  # (n, n)
    r: Array  # (m, m)
    p: Array  # (n, n)
    blocks: tuple[int, ...]  # samples that each move is held
    start: Array  # (n, params): x[0]
    drift: Array  # (N, n, params): what is added to x[1] .. x[N]
    x_target: Array  # (N, n, params), of x[1] .. x[N]
    u_target: Array  # (N, m, params), of u[0] .. u[N-1]
    last: Array  # (m, params): the output of the sample before


@dataclass(frozen=True, slots=True)
class Condensed:
    """The problem with its moves, before they are eliminated as well: H, F, G, S, low, high, `softness` of each row.

    `feasible`: the last output that was applied, held, keeps every hard limit.
    """

    h: Array
    f: Array
    g: Array
    s: Array
    low: Array
    high: Array
    softness: Array
    feasible: bool


def condense(prediction: Prediction, limits: Constraints) -> Condensed:
    """Eliminate the states.

    Raises
    ------
    DesignError
        when there would be too many rows, or moves that cannot be told apart.
    """
    n, m = prediction.b.shape
    horizon, hold = sum(prediction.blocks), _hold(prediction.blocks, m)
    count = len(prediction.blocks) * m
    bounded = [k for k in range(n) if np.isfinite(limits.x_low[k]) or np.isfinite(limits.x_high[k])]
    changing = [j for j in range(m) if np.isfinite(limits.du_low[j]) or np.isfinite(limits.du_high[j])]
    rows = count + len(changing) * len(prediction.blocks) + len(bounded) * horizon
    if rows > MOST_ROWS:
        raise DesignError(
            f"controller.horizon = {horizon}: {len(prediction.blocks)} moves and {len(bounded)} limited state(s) give "
            f"{rows} rows, {4 * rows * rows} bytes of constants; at most {MOST_ROWS} rows are built: shorten the "
            "horizon, hold moves longer (blocks), or limit fewer states"
        )
    with np.errstate(over="ignore", invalid="ignore"):
        free, forced = _trajectory(prediction, horizon)
        moved = forced @ hold
        x_weight = np.kron(np.eye(horizon), prediction.q)
        x_weight[-n:, -n:] = prediction.p
        u_weight = np.kron(np.eye(horizon), prediction.r)
        h = moved.T @ x_weight @ moved + hold.T @ u_weight @ hold
        away = free - prediction.x_target.reshape(horizon * n, -1)
        f = moved.T @ x_weight @ away - hold.T @ u_weight @ prediction.u_target.reshape(horizon * m, -1)
    condition = float(np.linalg.cond(h)) if np.all(np.isfinite(h)) else math.inf
    if condition > CONDITION:
        raise DesignError(
            f"controller.horizon = {horizon} makes the problem too ill-conditioned for float32: {condition:.3g}, at "
            f"most {CONDITION:.0e} can be solved; shorten the horizon, hold moves longer (blocks) or raise R"
        )
    return _rows(prediction, limits, (h + h.T) / 2, f, free, moved, bounded, changing)


def eliminate(problem: Condensed, budget: int, moves: int) -> Quadratic:
    """Eliminate the moves, of which the first `moves` are asked for; a limit is softened by SOFTEST or not at all."""
    factor = scipy.linalg.cho_factor(problem.h)
    gram = problem.g @ scipy.linalg.cho_solve(factor, problem.g.T)
    soft = problem.softness > 0
    gram += np.diag(np.where(soft, np.maximum(problem.softness, SOFTEST * np.diag(gram)), 0.0))
    slope = problem.s - problem.g @ scipy.linalg.cho_solve(factor, problem.f)
    size = np.sqrt(np.diag(gram))
    return Quadratic(
        slope=slope / size[:, None],
        low=problem.low / size,
        high=problem.high / size,
        gram=gram / np.outer(size, size),
        scale=size[:moves],
        freedom=len(problem.h) + int(np.count_nonzero(problem.softness)),
        budget=budget,
        moves=len(problem.h),
        feasible=problem.feasible,
    )


def check_feasible(problem: Condensed, low: Array, high: Array) -> None:
    """Refuse limits that no parameters from `low` to `high` (params,) and no moves keep."""
    hard = problem.softness == 0
    rows = np.hstack([problem.g[hard], problem.s[hard]])
    above, below = np.isfinite(problem.high[hard]), np.isfinite(problem.low[hard])
    table = np.vstack([rows[above], -rows[below]])
    excess = np.full((len(table), 1), -1.0)
    edge = np.concatenate([problem.high[hard][above], -problem.low[hard][below]])
    width = rows.shape[1]
    found = scipy.optimize.linprog(
        np.append(np.zeros(width), 1.0),
        A_ub=np.hstack([table, excess]),
        b_ub=edge,
        bounds=[*([(None, None)] * len(problem.h)), *zip(low, high, strict=True), (0, None)],
        method="highs",
    )
    if found.status != 0 or found.x[-1] > NONE:
        amount = f"the least violation is {found.x[-1]:.4g}" if found.status == 0 else "none was found"
        raise DesignError(
            "controller.u_min, u_max, x_min and x_max leave no state within the ranges in [signals] from which every "
            f"limit can be kept over the horizon ({amount}); widen them, or make the limits of the states soft (x_soft)"
        )


def _hold(blocks: tuple[int, ...], drives: int) -> Array:
    """Return M (N m, moves m), which holds each move for its block."""
    pattern = np.zeros((sum(blocks), len(blocks)))
    pattern[np.arange(sum(blocks)), np.repeat(np.arange(len(blocks)), blocks)] = 1.0
    return np.asarray(np.kron(pattern, np.eye(drives)), dtype=np.float64)


def _trajectory(prediction: Prediction, horizon: int) -> tuple[Array, Array]:
    """Return x[1] .. x[N] as functions of the parameters (N n, params) and of the inputs (N n, N m)."""
    n, m = prediction.b.shape
    state, free = prediction.start, []
    forced = np.zeros((horizon * n, horizon * m))
    response = prediction.b
    for k in range(horizon):
        state = prediction.a @ state + prediction.drift[k]
        free.append(state)
        for j in range(horizon - k):
            forced[(j + k) * n : (j + k + 1) * n, j * m : (j + 1) * m] = response
        response = prediction.a @ response
    return np.vstack(free), forced


def _rows(
    prediction: Prediction,
    limits: Constraints,
    h: Array,
    f: Array,
    free: Array,
    moved: Array,
    bounded: list[int],
    changing: list[int],
) -> Condensed:
    """Stack the limits: the moves first, then their changes, then the states in time that a move can reach."""
    n, m = prediction.b.shape
    count, params = len(h), prediction.start.shape[1]
    g, s = [np.eye(count)], [np.zeros((count, params))]
    low, high = [np.tile(limits.u_low, count // m)], [np.tile(limits.u_high, count // m)]
    softness = [np.zeros(count)]
    for j in changing:
        change = np.eye(count)[j::m] - np.eye(count, k=-m)[j::m]
        before = np.zeros((len(change), params))
        before[0] = -prediction.last[j]
        g.append(change)
        s.append(before)
        low.append(np.full(len(change), limits.du_low[j]))
        high.append(np.full(len(change), limits.du_high[j]))
        softness.append(np.zeros(len(change)))
    for k in bounded:
        rows = moved[k::n]
        reached = np.max(np.abs(rows), axis=1) > NONE * np.max(np.abs(rows))
        g.append(rows[reached])
        s.append(free[k::n][reached])
        low.append(np.full(reached.sum(), limits.x_low[k]))
        high.append(np.full(reached.sum(), limits.x_high[k]))
        softness.append(np.full(reached.sum(), 0.0 if np.isinf(limits.soft[k]) else 1.0 / limits.soft[k]))
    rests = not changing or bool(np.all(limits.u_low <= 0) and np.all(limits.u_high >= 0))  # the first one last is 0
    return Condensed(
        h, f, np.vstack(g), np.vstack(s), np.concatenate(low), np.concatenate(high), np.concatenate(softness),
        feasible=rests and not np.any(np.isinf(limits.soft[bounded])),
    )  # fmt: skip
