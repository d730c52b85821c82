"""Write TinyMPC's code for a problem: run by the Python that has the package.

emit_tinympc.py PROBLEM.npz FOLDER [SETTING=VALUE...]

Its codegen() ends by compiling a Python module, for which it asks the network; the code itself is written before that.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import tinympc


def main() -> None:
    """Set the problem up and write its code."""
    given = np.load(sys.argv[1])
    solver = tinympc.TinyMPC()
    most = float(given["u_max"])
    solver.setup(
        given["a"], given["b"], np.diag(given["q"]), np.diag(given["r"]), int(given["knots"]), rho=1.0,
        u_min=np.array([-most]), u_max=np.array([most]), x_min=-given["x_max"], x_max=given["x_max"],
        **{key: float(value) for key, value in (pair.split("=") for pair in sys.argv[3:])},
    )  # fmt: skip
    module = subprocess.check_call
    subprocess.check_call = lambda *arguments, **named: 0
    solver.codegen(sys.argv[2])
    subprocess.check_call = module


if __name__ == "__main__":
    main()
