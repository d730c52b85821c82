"""The numbers by which the compiled reference knows each operation, as in `steps.h`."""

from __future__ import annotations

CODES = {
    **{"copy": 0, "neg": 1, "abs": 2, "not": 3, "add": 4, "sub": 5, "mul": 6, "wide": 6, "min": 7, "max": 8},
    **{"lt": 9, "le": 10, "eq": 11, "ne": 12, "and": 13, "or": 14, "select": 15, "clamp": 16},
}
WHOLE = {
    **{"mac": 17, "mul_shift": 18, "mul_down": 19, "shr": 20, "high": 20, "asr": 21, "high_down": 21},
    **{"shl": 22, "wrap": 23, "mul_add": 32},
}
REAL = {
    **{"div": 24, "outside": 25, "beyond": 26, "none": 27, "nought": 28, "none_where": 29, "lost": 30},
    "magnitude": 31,
}
