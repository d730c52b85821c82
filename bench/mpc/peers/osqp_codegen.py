"""OSQP: its own code generator for embedded use, in float, the states eliminated, warm started as it is by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.mpc.peers.image import Parts
from bench.mpc.peers.packages import emit
from bench.mpc.peers.problem import Problem, c_array

PACKAGE = "osqp==1.1.3"
SCRIPT = Path(__file__).with_name("emit_osqp.py")

ADAPTER = """
#include "osqp.h"
#include "mpc_workspace.h"
{tables}
static OSQPFloat q[{n}], low[{m}], high[{m}];
void peer_start(void) {{
    for (int i = 0; i < {n}; ++i) {{ low[i] = (OSQPFloat)(-U_MAX); high[i] = (OSQPFloat)U_MAX; }}
}}
int peer_step(const float *state, float *move) {{
    for (int i = 0; i < {n}; ++i) {{
        q[i] = 0;
        for (int j = 0; j < {states}; ++j) {{ q[i] += slope[i * {states} + j] * state[j]; }}
    }}
    for (int i = {n}; i < {m}; ++i) {{
        OSQPFloat free = 0;
        for (int j = 0; j < {states}; ++j) {{ free += rows[(i - {n}) * {states} + j] * state[j]; }}
        low[i] = -most[i - {n}] - free;
        high[i] = most[i - {n}] - free;
    }}
    osqp_update_data_vec(&mpc_solver, q, {bounds});
    osqp_solve(&mpc_solver);
    *move = mpc_solver.solution->x[0];
    return mpc_solver.info->status_val == OSQP_SOLVED;
}}
"""
TUNED = {"u": {"rho": 0.01, "eps_abs": 3e-4, "eps_rel": 0.0}, "ux": {"rho": 0.003, "eps_abs": 1e-4, "eps_rel": 0.0}}


def default(problem: Problem, folder: Path) -> Parts:
    """Return it with the settings of the package."""
    return _parts(problem, folder, {}, ())


def tuned(problem: Problem, folder: Path) -> Parts:
    """Return it with a penalty and tolerances that a scan found to fit these problems, and its constants in single."""
    return _parts(problem, folder, TUNED.get(problem.name, {}), ("-fsingle-precision-constant",))


def _parts(problem: Problem, folder: Path, settings: dict[str, float], flags: tuple[str, ...]) -> Parts:
    folder.mkdir(parents=True, exist_ok=True)
    n = len(problem.hessian)
    rows = np.vstack([np.eye(n), problem.along])
    bound = np.concatenate([np.full(n, problem.u_max), problem.high])
    np.savez(folder / "problem.npz", hessian=problem.hessian, rows=rows, bound=bound)
    pairs = [f"{key}={value!r}" for key, value in settings.items()]
    emit(PACKAGE, SCRIPT, [str(folder / "problem.npz"), str(folder / "code"), *pairs])
    nothing = np.zeros((1, len(problem.a)))
    text = f"#define U_MAX {problem.u_max!r}f\n" + c_array("slope", problem.slope, "float")
    text += c_array("rows", problem.free if len(problem.free) else nothing, "float")
    text += c_array("most", problem.high if len(problem.high) else nothing, "float")
    bounds = "low, high" if len(problem.high) else "0, 0"
    adapter = ADAPTER.format(tables=text, n=n, m=len(rows), states=len(problem.a), bounds=bounds)
    code = folder / "code"
    sources = (*sorted((code / "src").glob("*.c")), code / "mpc_workspace.c")
    return Parts(adapter, sources, (code, code / "inc" / "public", code / "inc" / "private"), flags)
