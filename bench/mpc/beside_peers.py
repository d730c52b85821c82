"""Set linear predictive control beside its peers: the same states, the same chip, every step judged.

    python -m bench.mpc.beside_peers PROBLEM.json...

Peers are OSQP's and TinyMPC's code generators, CasADi's with its solver qrqp, and the C core of DAQP, as the Python
package index has them: fetched into environments that are thrown away, their C compiled with -O2 for a Cortex-M4F and
run in QEMU under icount. One call is a state in and a move out; each starts from what it kept of the step before, as it
does by itself. The optimum is that of qpOASES in double precision. A move farther from it than the problem's `tol_u0`
is wrong; `silent` are those that the peer calls solved. What cannot be fetched or built gets a row that says so.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.mpc.cart_pole import Judge
from bench.mpc.peers import casadi_qrqp, daqp_core, osqp_codegen, own, tinympc_codegen
from bench.mpc.peers.image import MOST, Parts, PeerError, Run, bare_sizes, run
from bench.mpc.peers.problem import Problem, read_problem


@dataclass(frozen=True)
class Peer:
    """A row: its name, and what writes its code into a folder."""

    name: str
    parts: Callable[[Problem, Path], Parts]


PEERS = (
    Peer("firmloop mpc, float", own.parts),
    Peer(f"{daqp_core.PACKAGE} C core, float", daqp_core.single),
    Peer(f"{daqp_core.PACKAGE} C core, double", daqp_core.double),
    Peer(f"{osqp_codegen.PACKAGE} codegen, float", osqp_codegen.default),
    Peer(f"{osqp_codegen.PACKAGE} codegen, float, tuned", osqp_codegen.tuned),
    Peer(f"casadi {casadi_qrqp.VERSION} qrqp, float, mended", casadi_qrqp.mended),
    Peer(f"casadi {casadi_qrqp.VERSION} qrqp, float, mended, warm", casadi_qrqp.mended_warm),
    Peer(f"casadi {casadi_qrqp.VERSION} qrqp, float", casadi_qrqp.single),
    Peer(f"casadi {casadi_qrqp.VERSION} qrqp, double", casadi_qrqp.double),
    Peer(f"{tinympc_codegen.PACKAGE} codegen, double", tinympc_codegen.default),
    Peer(f"{tinympc_codegen.PACKAGE} codegen, Q and R less rho", tinympc_codegen.compensated),
)
HEADS = ("median", "mean", "worst", "worst u0", "wrong", "silent", "flash", "RAM", "__aeabi_d*", "malloc", "note")
LINE = "{:43} {:>11} {:>13} {:>13} {:>9} {:>9} {:>6} {:>8} {:>8} {:>10} {:>9}  {}"


def compare(path: Path) -> int:
    """Print one problem's table; return how many of firmloop's own moves are wrong."""
    problem = read_problem(path)
    given = json.loads(path.read_text())
    judge = Judge(given)
    found = [judge.move(state) for state in problem.states.astype(np.float64)]
    best = np.array([np.nan if u is None else u for u in found])
    print(f"\n{problem.name}: {len(best)} recorded states; instructions of one step on a Cortex-M4F, bytes")
    print(LINE.format("", *HEADS), flush=True)
    own_wrong = len(best)
    with tempfile.TemporaryDirectory(prefix="peers-") as folder:
        bare = bare_sizes(problem.states, Path(folder) / "bare")
        for k, peer in enumerate(PEERS):
            place = Path(folder) / str(k)
            try:
                done = run(peer.parts(problem, place / "generated"), problem.states, bare, place)
                wrong, line = _row(done, best, given["tol_u0"])
            except PeerError as why:
                wrong, line = len(best), ("",) * (len(HEADS) - 1) + (str(why),)
            own_wrong = own_wrong if k else wrong
            print(LINE.format(peer.name, *line), flush=True)
    return own_wrong


def _row(done: Run, best: np.ndarray, allowed: float) -> tuple[int, tuple[str, ...]]:
    """Return how many moves are wrong, and the cells of a row."""
    steps = len(done.moves)
    if not steps:
        return len(best), ("",) * (len(HEADS) - 1) + ("its image ended before the first step",)
    error = np.abs(done.moves - best[:steps])
    judged = np.isfinite(best[:steps])
    error[judged & ~np.isfinite(error)] = np.inf
    wrong = judged & (error > allowed)
    note = (
        "" if steps == len(best) else f"{steps} of {len(best)} steps, then stopped at {MOST:.0e} instructions or stuck"
    )
    return int(wrong.sum()), (
        f"{np.median(done.instructions):,.0f}",
        f"{done.instructions.mean():,.0f}",
        f"{done.instructions.max():,}",
        f"{error[judged].max():.1e}",
        str(wrong.sum()),
        str((wrong & done.solved).sum()),
        f"{done.flash:,}",
        f"{done.ram:,}",
        str(len(done.helpers) or "none"),
        f"{done.mallocs:,}" if done.malloc_linked else "none",
        note,
    )


def main() -> int:
    """Compare on every problem file named."""
    return 1 if sum(compare(Path(name)) for name in sys.argv[1:]) else 0


if __name__ == "__main__":
    sys.exit(main())
