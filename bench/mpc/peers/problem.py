"""A problem of linear predictive control with its states eliminated, in numpy alone.

    min 1/2 u'Hu + (F x)'u,   |u| <= u_max,   |E x + G u| <= x_max     for x[k+1] = A x[k] + B u[k]

Peers are handed this form, or A and B where they want those; it shares nothing with the product's own elimination.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Problem:
    """One problem file; `limited` are the rows of x[1..N] that have a limit."""

    name: str
    path: Path
    a: np.ndarray
    b: np.ndarray
    q: np.ndarray  # diagonal
    r: np.ndarray  # diagonal
    knots: int  # x[0] and one for every move
    u_max: float
    x_max: np.ndarray  # (n,), inf where there is none
    hessian: np.ndarray
    slope: np.ndarray  # F
    along: np.ndarray  # G
    free: np.ndarray  # E
    high: np.ndarray  # of the rows of G
    states: np.ndarray  # (steps, n), float32


def read_problem(path: Path) -> Problem:
    """Read a problem file and eliminate its states."""
    given = json.loads(path.read_text())
    a, b = np.array(given["A"]), np.array(given["B"])
    n, m = b.shape
    moves = given["N"] - 1
    free = np.vstack([np.linalg.matrix_power(a, k + 1) for k in range(moves)])
    along = np.zeros((n * moves, m * moves))
    for k in range(moves):
        for j in range(k + 1):
            along[n * k : n * k + n, m * j : m * j + m] = np.linalg.matrix_power(a, k - j) @ b
    weight = np.kron(np.eye(moves), np.diag(given["Q"]))
    weight[-n:, -n:] = given["QN"]
    x_max = np.array([np.inf if x is None else float(x) for x in given["x_max"]])
    limited = np.isfinite(np.tile(x_max, moves))
    return Problem(
        name=given["name"],
        path=path,
        a=a,
        b=b,
        q=np.array(given["Q"]),
        r=np.array(given["R"]),
        knots=given["N"],
        u_max=given["u_max"],
        x_max=x_max,
        hessian=np.kron(np.eye(moves), np.diag(given["R"])) + along.T @ weight @ along,
        slope=along.T @ weight @ free,
        along=along[limited],
        free=free[limited],
        high=np.tile(x_max, moves)[limited],
        states=np.array(given["x0_sequence"], dtype=np.float32),
    )


def c_array(name: str, values: np.ndarray, kind: str) -> str:
    """Return the definition of a constant array with every digit of `values`."""
    suffix = "f" if kind == "float" else ""
    rows = np.asarray(values, dtype=np.float32 if kind == "float" else np.float64).ravel()
    return f"static const {kind} {name}[] = {{{', '.join(f'{x!s}{suffix}' for x in rows.tolist())}}};\n"
