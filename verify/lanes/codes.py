"""The numbers by which the compiled reference knows each operation, as in `steps.h`."""

from __future__ import annotations

from typing import Any

import numpy as np

CODES = {
    **{"copy": 0, "neg": 1, "abs": 2, "not": 3, "add": 4, "sub": 5, "mul": 6, "wide": 6, "min": 7, "max": 8},
    **{"lt": 9, "le": 10, "eq": 11, "ne": 12, "and": 13, "or": 14, "select": 15, "clamp": 16},
}
WHOLE = {
    **{"mac": 17, "mul_shift": 18, "mul_down": 19, "shr": 20, "high": 20, "asr": 21, "high_down": 21},
    **{"shl": 22, "wrap": 23, "mul_add": 32, "turn": 33, "turn_sine": 34, "turn_cosine": 35},
    **{"whole_root": 36, "inverse": 37, "mul_add_short": 50},
}
REAL = {
    **{"div": 24, "outside": 25, "beyond": 26, "none": 27, "nought": 28, "none_where": 29, "lost": 30},
    **{"sin": 38, "cos": 39, "exp": 40, "tanh": 41, "sqrt": 42},
}
PLANS = {"improve": 48, "solve": 49}  # which write many rows
# Of a law, as true as its numbers: the functions above are a program's own.
LAW = {
    **{"magnitude": 31, "true_sin": 43, "true_cos": 44, "true_exp": 45, "true_tanh": 46, "true_sqrt": 47},
}


def known(kind: np.dtype[Any]) -> dict[str, int]:
    """Return the numbers of all operations on a kind of number."""
    return CODES | (WHOLE if kind.kind == "i" else REAL | PLANS | LAW)
