"""What the search of a quadratic program ends with, and what its work is counted in."""

SOLVED, CAPPED, INFEASIBLE = 0, 1, 2
COLUMN = 6  # work of one column beside 1 for each active row, in the proportion of instructions
