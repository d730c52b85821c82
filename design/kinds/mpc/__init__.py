"""Linear model predictive control: the cheapest moves over the horizon that keep every limit."""

from firmloop.design.kinds.mpc.kind import KIND as KIND
