"""Twins: the support functions of the generated C once more in Python, bit for bit."""
