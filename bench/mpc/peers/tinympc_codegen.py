"""TinyMPC: its own generated code, double precision as it comes, warm started as it is by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bench.mpc.peers.image import Parts
from bench.mpc.peers.packages import emit
from bench.mpc.peers.problem import Problem

PACKAGE = "tinympc==0.0.8"
SCRIPT = Path(__file__).with_name("emit_tinympc.py")
SOURCES = ("tinympc/admm.cpp", "tinympc/tiny_api.cpp", "tinympc/rho_benchmark.cpp", "src/tiny_data.cpp")

ADAPTER = """
#include <tinympc/tiny_api.hpp>
#include <tinympc/tiny_data.hpp>
extern "C" void *__dso_handle;
void *__dso_handle;
extern "C" void peer_start(void) {{}}
extern "C" int peer_step(const float *state, float *move) {{
    for (int i = 0; i < {n}; ++i) {{
        tiny_solver.work->x(i, 0) = state[i];
    }}
    const int failed = tiny_solve(&tiny_solver);
    *move = static_cast<float>(tiny_solver.solution->u(0, 0));
    return failed == 0;
}}
"""


def default(problem: Problem, folder: Path) -> Parts:
    """Return it with the weights as a user writes them."""
    return _parts(problem, folder, 0.0, [])


def compensated(problem: Problem, folder: Path) -> Parts:
    """Return it with Q and R less rho, for the package adds rho to them twice."""
    return _parts(problem, folder, 1.0, ["abs_pri_tol=1e-4", "abs_dua_tol=1e-4"])


def _parts(problem: Problem, folder: Path, less: float, settings: list[str]) -> Parts:
    folder.mkdir(parents=True, exist_ok=True)
    x_max = np.tile(np.where(np.isfinite(problem.x_max), problem.x_max, 1e17)[:, None], problem.knots)
    x_max[:, 0] = 1e17  # x[0] is as measured
    np.savez(
        folder / "problem.npz", a=problem.a, b=problem.b, q=problem.q - less, r=problem.r - less,
        knots=problem.knots, u_max=problem.u_max, x_max=x_max,
    )  # fmt: skip
    code = folder / "code"
    emit(PACKAGE, SCRIPT, [str(folder / "problem.npz"), str(code), *settings])
    folders = (code / "include", code / "include" / "Eigen", code, code / "tinympc")
    sources = tuple(code / name for name in SOURCES)
    return Parts(ADAPTER.format(n=len(problem.a)), sources, folders, ("-std=gnu++17",), "c++")
