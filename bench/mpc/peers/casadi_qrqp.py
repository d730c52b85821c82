"""CasADi's own quadratic solver, qrqp, from its code generator: as generated, and as its users mend it for float."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca

from bench.mpc.peers.image import Parts
from bench.mpc.peers.problem import Problem

VERSION = ca.__version__

# Without it the float code calls the double functions of math.h.
SINGLE = """
#include <math.h>
#define fabs fabsf
#define sqrt sqrtf
#define fmin fminf
#define fmax fmaxf
#define pow powf
"""
ADAPTER = """
#include <math.h>
#include "qrqp_mpc.h"
static casadi_int iw[qrqp_mpc_SZ_IW + 1];
static casadi_real w[qrqp_mpc_SZ_W + 1], given[{n}], found[{moves}], held[{moves}], rows[{rows} + 1];
void peer_start(void) {{ qrqp_mpc_incref(); }}
int peer_step(const float *state, float *move) {{
    const casadi_real *arg[qrqp_mpc_SZ_ARG + 1] = {{given, {warm_in}}};
    casadi_real *res[qrqp_mpc_SZ_RES + 1] = {{found, {warm_out}}};
    for (int i = 0; i < {n}; ++i) {{
        given[i] = (casadi_real)state[i];
    }}
    const int failed = qrqp_mpc(arg, res, iw, w, 0);
    *move = (float)found[0];
    return failed == 0;
}}
"""


def double(problem: Problem, folder: Path) -> Parts:
    """As generated: double precision, from no guess."""
    return _parts(problem, folder, "double", {}, False)


def single(problem: Problem, folder: Path) -> Parts:
    """As generated with casadi_real = float."""
    return _parts(problem, folder, "float", {}, False)


MENDED = {"constr_viol_tol": 1e-4, "dual_inf_tol": 1e-4, "max_iter": 60}


def mended(problem: Problem, folder: Path) -> Parts:
    """Float with tolerances that float can meet, single constants and functions; from no guess."""
    return _parts(problem, folder, "float", MENDED, False)


def mended_warm(problem: Problem, folder: Path) -> Parts:
    """Mended, and started from its last answer and multipliers."""
    return _parts(problem, folder, "float", MENDED, True)


def _parts(problem: Problem, folder: Path, kind: str, settings: dict[str, Any], warm: bool) -> Parts:
    folder.mkdir(parents=True, exist_ok=True)
    n, moves, rows = len(problem.a), len(problem.hessian), len(problem.high)
    u, p = ca.SX.sym("u", moves), ca.SX.sym("p", n)
    x0, guess, held, held_rows = (
        ca.MX.sym(name, k) for name, k in (("x0", n), ("u", moves), ("l", moves), ("g", rows))
    )
    cost = u.T @ ca.DM(problem.hessian) @ u / 2 + (ca.DM(problem.slope) @ p).T @ u
    limited = ca.DM(problem.along) @ u + ca.DM(problem.free) @ p if rows else ca.SX(0, 1)
    quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": True}
    solver = ca.qpsol("qp", "qrqp", {"x": u, "p": p, "f": cost, "g": limited}, {**quiet, **settings})
    start = {"x0": guess, "lam_x0": held, "lam_g0": held_rows} if warm else {}
    found = solver(p=x0, lbx=-problem.u_max, ubx=problem.u_max, lbg=-problem.high, ubg=problem.high, **start)
    ends = [x0, guess, held, held_rows] if warm else [x0]
    results = [found["x"], found["lam_x"], found["lam_g"]] if warm else [found["x"]]
    function = ca.Function("qrqp_mpc", ends, results)
    options = {"casadi_real": kind, "casadi_int": "int", "with_header": True, "mex": False}
    generator = ca.CodeGenerator("qrqp_mpc.c", options)
    generator.add(function)
    generator.generate(f"{folder}/")
    flags: tuple[str, ...] = ()
    if settings:
        (folder / "single.h").write_text(SINGLE)
        flags = ("-fsingle-precision-constant", "-include", str(folder / "single.h"))
    adapter = ADAPTER.format(
        n=n,
        moves=moves,
        rows=rows,
        warm_in="found, held, rows" if warm else "0",
        warm_out="held, rows" if warm else "0",
    )
    return Parts(adapter, (folder / "qrqp_mpc.c",), (folder,), flags)
