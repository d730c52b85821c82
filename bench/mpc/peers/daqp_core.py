"""DAQP: the C core of its source package over constant data, its working set kept from step to step.

The package has no code generator, so the data are laid out here: H = R'R, z = R u + v, v = F'x, rows of unit length,
bounds d = d0 + D x on M z. Settings for float are ours, for those of the package are far below what float resolves: of
those scanned they are the loosest with which no step of either problem is wrong.
"""

from __future__ import annotations

import tarfile
from pathlib import Path

import numpy as np

from bench.mpc.peers.image import Parts
from bench.mpc.peers.packages import source_of
from bench.mpc.peers.problem import Problem, c_array

PACKAGE = "daqp==0.11.0"
CORE = ("daqp.c", "auxiliary.c", "factorization.c")

ADAPTER = """
#include "daqp.h"
#include "auxiliary.h"
{tables}
#define MOVES {n}
#define ROWS {m}
#define MOST (MOVES + 2)
static c_float du[ROWS], dl[ROWS], along[ROWS], v[MOVES], x[MOVES], xold[MOVES], u[MOVES];
static c_float lam[MOST], star[MOST], pivots[MOST], xldl[MOST], zldl[MOST], factor[MOST * (MOST + 1) / 2];
static int sense[ROWS], set[MOST];
static DAQPSettings settings = {{{settings}}};
static DAQPWorkspace work;
void peer_start(void) {{
    work.n = MOVES; work.m = ROWS; work.ms = MOVES;
    work.M = (c_float *)rows_m; work.dupper = du; work.dlower = dl; work.Rinv = (c_float *)rinv; work.v = v;
    work.sense = sense; work.scaling = (c_float *)scaling;
    work.x = x; work.xold = xold; work.lam = lam; work.lam_star = star; work.u = u;
    work.L = factor; work.D = pivots; work.xldl = xldl; work.zldl = zldl; work.WS = set;
    work.Mu = ROWS > MOVES ? along : 0; work.settings = &settings; work.state = DAQP_STATE_RINV_NORMALIZED;
    reset_daqp_workspace(&work);
}}
int peer_step(const float *state, float *move) {{
    for (int i = 0; i < ROWS; ++i) {{
        c_float toward = 0;
        for (int j = 0; j < {states}; ++j) {{
            toward += shift[i * {states} + j] * (c_float)state[j];
        }}
        du[i] = high[i] + toward;
        dl[i] = toward - high[i];
    }}
    for (int i = 0; i < MOVES; ++i) {{
        v[i] = 0;
        for (int j = 0; j < {states}; ++j) {{
            v[i] += middle[i * {states} + j] * (c_float)state[j];
        }}
    }}
    work.reuse_ind = 0;
    const int flag = daqp_ldp(&work);
    ldp2qp_solution(&work);
    *move = (float)x[0];
    if (flag < 0) {{
        for (int i = 0; i < ROWS; ++i) {{
            sense[i] = 0;
        }}
        reset_daqp_workspace(&work);
    }}
    return flag > 0;
}}
"""
LIMITS = ".cycle_tol = 10, .iter_limit = 1000, .fval_bound = 1e30, .rho_soft = 1e-6"
IN_FLOAT = (
    ".primal_tol = 3e-5f, .dual_tol = 1e-7f, .zero_tol = 1e-7f, .pivot_tol = 1e-5f, .progress_tol = 1e-7f, "
    ".sing_tol = 1e-7f, .refactor_tol = 1e-7f, "
)
IN_DOUBLE = (
    ".primal_tol = DAQP_DEFAULT_PRIM_TOL, .dual_tol = DAQP_DEFAULT_DUAL_TOL, .zero_tol = DAQP_DEFAULT_ZERO_TOL, "
    ".pivot_tol = DAQP_DEFAULT_PIVOT_TOL, .progress_tol = DAQP_DEFAULT_PROG_TOL, .sing_tol = DAQP_DEFAULT_SING_TOL, "
    ".refactor_tol = DAQP_DEFAULT_REFACTOR_TOL, "
)


def single(problem: Problem, folder: Path) -> Parts:
    """Single precision, its constants too: as they stand in the source they are double and cost 15 % more."""
    flags = ("-DDAQP_SINGLE_PRECISION", "-fsingle-precision-constant")
    return _parts(problem, folder, "float", IN_FLOAT, flags)


def double(problem: Problem, folder: Path) -> Parts:
    """Double precision, as the package is set."""
    return _parts(problem, folder, "double", IN_DOUBLE, ())


def _parts(problem: Problem, folder: Path, kind: str, settings: str, flags: tuple[str, ...]) -> Parts:
    folder.mkdir(parents=True, exist_ok=True)
    with tarfile.open(source_of(PACKAGE)) as archive:
        archive.extractall(folder, filter="data")
    (core,) = folder.glob("daqp-*/csrc")
    n = len(problem.hessian)
    inverse = np.linalg.inv(np.linalg.cholesky(problem.hessian).T)
    rows = np.vstack([inverse, problem.along @ inverse])
    scaling = 1 / np.linalg.norm(rows, axis=1)
    rows *= scaling[:, None]
    middle = inverse.T @ problem.slope  # v = R^-T f
    free = np.vstack([np.zeros((n, len(problem.a))), problem.free]) * scaling[:, None]
    bounds = np.concatenate([np.full(n, problem.u_max), problem.high]) * scaling
    tables = {
        "rinv": rows[:n][np.triu_indices(n)],
        "rows_m": rows[n:] if len(rows) > n else np.zeros(1),
        "scaling": scaling,
        "high": bounds,
        "shift": rows @ middle - free,
        "middle": middle,
    }
    text = "".join(c_array(name, values, kind) for name, values in tables.items())
    adapter = ADAPTER.format(tables=text, n=n, m=len(rows), states=len(problem.a), settings=settings + LIMITS)
    return Parts(adapter, tuple(core / "src" / name for name in CORE), (core / "include",), flags)
