"""Field-oriented control of currents: a current loop of a permanent-magnet machine, from currents to duties."""

from firmloop.design.kinds.foc.kind import KIND as KIND
