"""Write OSQP's embedded code for a problem: run by the Python that has the package.

emit_osqp.py PROBLEM.npz FOLDER [SETTING=VALUE...]
"""

from __future__ import annotations

import sys

import numpy as np
import osqp
import scipy.sparse as sparse


def main() -> None:
    """Set the problem up and write its code."""
    given = np.load(sys.argv[1])
    settings = {key: float(value) for key, value in (pair.split("=") for pair in sys.argv[3:])}
    solver = osqp.OSQP()
    hessian = sparse.csc_matrix(np.triu(given["hessian"]))
    nothing = np.zeros(len(given["hessian"]))
    rows = sparse.csc_matrix(given["rows"])
    solver.setup(hessian, nothing, rows, -given["bound"], given["bound"], verbose=False, **settings)
    solver.codegen(sys.argv[2], parameters="vectors", use_float=True, force_rewrite=True, prefix="mpc_")


if __name__ == "__main__":
    main()
