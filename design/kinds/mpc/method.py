"""Choose how a predictive controller finds its moves: by a search, a fixed number of iterations, or a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from firmloop.design.law import DesignError, Flag, Law
from firmloop.design.optimum import QuadraticSolver
from firmloop.design.quadratic.splitting import choose_sweeps
from firmloop.design.quadratic.tree import choose_tree
from firmloop.design.table import real

ACCURACY, LEAST_ACCURACY = 0.01, 1e-4  # of an output over its range, where the number of iterations is fixed
SEARCH_CODE, TABLE_CODE = 1850, 210  # bytes of step() beside its constants, float32, Cortex-M4F
ONLINE = (
    Flag("capped", "the search was cut short; the output is the last plan's, or that without limits, limited"),
    Flag("infeasible", "no moves keep every limit; the output is the last plan's, or that without limits, limited"),
)
FLAGS = {
    "online": ONLINE,
    "auto": ONLINE,
    "explicit": (Flag("infeasible", "no moves keep every limit; the output is that without limits, limited"),),
    "fixed_iterations": (
        Flag("capped", "the last iteration is far from the optimum, or there is none; the output is limited"),
    ),
}


def with_method(
    built: Callable[[bool], Law], table: Mapping[str, object], solver: str, optimum: QuadraticSolver | None
) -> tuple[Law, dict[str, float]]:
    """Return the law as `solver`, a key of FLAGS, has it, and the figures of that, judged by the `optimum`.

    `built` returns the law for a search, which may end without an answer, where it is told True.
    """
    if solver == "online":
        return built(True), {}
    if optimum is None:
        raise DesignError(
            f"controller.solver = '{solver}' is judged by the optimum, and no solver of quadratic programs was passed; "
            "call design with optimum = firmloop.quantize.twins.qp.optimum"
        )
    match solver:
        case "fixed_iterations":
            return _with_sweeps(built(False), real(table, "accuracy", ACCURACY, LEAST_ACCURACY), optimum)
        case "explicit":
            return _with_tree(built(False), optimum)
    return _smaller(built, optimum)


def _smaller(built: Callable[[bool], Law], optimum: QuadraticSolver) -> tuple[Law, dict[str, float]]:
    """Take a table where it is smaller than a search, which it is faster than anyway."""
    try:
        found, figures = _with_tree(built(False), optimum)
    except DesignError:
        return built(True), {}
    return (found if figures["flash_bytes"] < figures["online_flash_bytes"] else built(True)), figures


def _with_tree(law: Law, optimum: QuadraticSolver) -> tuple[Law, dict[str, float]]:
    """Let the law look its moves up in a table of regions; return its figures too."""
    assert law.solve is not None
    tree, judged = choose_tree(law, optimum)
    rows, parameters = law.solve.quadratic.slope.shape
    width = -(-rows // 4) * 4
    figures = {
        "regions": float(judged.regions),
        "laws": float(len(tree.laws) - 1),
        "planes": float(len(tree.planes)),
        "depth": float(tree.depth),
        "flash_bytes": TABLE_CODE + 4.0 * (tree.planes.size + len(tree.planes) + tree.laws.size),
        "online_flash_bytes": SEARCH_CODE + 4.0 * (width * (rows + parameters) + 2 * rows),
        "worst_error_share": judged.worst,
        "judged_states": float(judged.count),
    }
    stages = (replace(law.solve, method=tree), law.last)
    return replace(law, says=f"{law.says}, {judged.regions} regions", stages=stages), figures


def _with_sweeps(law: Law, accuracy: float, optimum: QuadraticSolver) -> tuple[Law, dict[str, float]]:
    """Let the law find its moves by a fixed number of sweeps; return its figures too."""
    assert law.solve is not None
    sweeps, judged = choose_sweeps(law, accuracy, optimum)
    figures = {
        "iterations": float(sweeps.times),
        "worst_error_share": judged.worst,
        "judged_states": float(judged.count),
        "capped_share": judged.capped,
    }
    stages = (replace(law.solve, method=sweeps), law.last)
    return replace(law, says=f"{law.says}, {sweeps.times} iterations", stages=stages), figures
