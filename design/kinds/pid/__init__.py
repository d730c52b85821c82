"""PID: two weighted set points, filtered derivative, a saturated output, and an integral that does not wind up."""

from firmloop.design.kinds.pid.kind import KIND as KIND
