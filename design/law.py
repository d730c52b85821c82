"""A Law: what a controller should compute, in real numbers and physical units.

The Law is the seam between design and arithmetic. It knows no controller kind and no number format: a
controller kind writes a Law, `quantize` turns it into a Program, and neither knows the other.

One sample of a law is

    (x[k+1], u[k], flags[k], named[k]) = stages(x[k], z[k])

with x the state, z the inputs, u the outputs, all in physical units. The last stage is a `Scalar`, a CasADi SX
function. Before it may stand a `Solve`, whose results w the last stage reads too: its function is one of (x, z, w).
What it solves has constant data (`Quadratic`), or is made from a model in every sample (`Horizon`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from firmloop.identify.signal import Signal

Array = npt.NDArray[np.float64]


class DesignError(Exception):
    """The controller asked for cannot be designed; the message names the key, the value, the rule and the way out."""


@dataclass(frozen=True, slots=True)
class Scalar:
    """Straight-line arithmetic: `function(x (n,), z (m,)) -> (x_next (n,), u (r,), flags (f,), named (l,))`.

    `named` gives intermediate values that deserve a name in the generated C; it may be empty.
    """

    function: ca.Function
    named: tuple[Signal, ...]


@dataclass(frozen=True, slots=True)
class Quadratic:
    """A quadratic program with constant data, in the rows y of its constraints alone.

        y = slope p - gram m,    low <= y <= high,    m_i > 0 only where y_i = high_i, m_i < 0 only where y_i = low_i

    with p its parameters and m its multipliers; the first rows times `scale` are the moves. `freedom` is how many rows
    can be active at a time, `budget` the work that one search may take (0: what the law's ranges ask for). The first
    `moves` rows limit moves, of this sample and of later ones. `feasible`: some moves keep every limit, whatever p is.
    """

    slope: Array  # (rows, p)
    low: Array  # (rows,), infinite where there is no limit
    high: Array  # (rows,)
    gram: Array  # (rows, rows), diagonal 1
    scale: Array  # (k,)
    freedom: int
    budget: int
    moves: int = 0
    feasible: bool = False

    @property
    def results(self) -> int:
        """How many moves there are."""
        return len(self.scale)


@dataclass(frozen=True, slots=True)
class Sweeps:
    """A fixed number of sweeps toward the optimum of a quadratic program, in its rows times a weight each.

        s = slope p;   `times` times:  c = min(max(s, low), high),  y = mix (2 c - s) + push p,  s = s + 7/4 (y - c)

    s is limited to `reach` before each; the first rows of the last y, limited, times `scale` are the moves. Where the
    last y misses its limits by more than `tolerance` in a row, the moves are not trusted.
    """

    slope: Array  # (rows, p)
    push: Array  # (rows, p)
    mix: Array  # (rows, rows), symmetric, eigenvalues from 0 to 1
    low: Array  # (rows,), infinite where there is no limit
    high: Array  # (rows,)
    scale: Array  # (k,)
    reach: float
    tolerance: float
    times: int


@dataclass(frozen=True, slots=True)
class Tree:
    """The moves of a quadratic program as a function of its parameters p: a tree of planes, and affine laws.

    From node 0: where planes[k] (p, 1) > 0 it goes on at above[k], else at below[k]; -1 - j there is law j, whose moves
    are laws[j] (p, 1). What follows a node has a larger number. The last law is for parameters that have no optimum.
    """

    planes: Array  # (nodes, p + 1)
    below: tuple[int, ...]
    above: tuple[int, ...]
    laws: Array  # (laws, k, p + 1)

    @property
    def depth(self) -> int:
        """Nodes on the longest way from the first one to a law."""
        longest = [1] * len(self.below)
        for k in reversed(range(len(longest))):
            longest[k] += max(longest[child] if child >= 0 else 0 for child in (self.below[k], self.above[k]))
        return longest[0]


@dataclass(frozen=True, slots=True)
class Horizon:
    """A nonlinear program over N samples, of which every sample takes one or more steps: see `quantize/twins/rti.py`.

    `model` is a law without state from x and u (n + m) to x of the next sample and its slopes by both, row by row.
    `low`, `high` and `weight`, one over the span between them, are of the m inputs, then of the `limited` states.
    """

    model: Law
    length: int  # N
    q: Array  # (n, n)
    r: Array  # (m, m)
    p: Array  # (n, n)
    change: Array  # (m,), weights of the change from sample to sample
    rest: Array  # (m,), what u is weighed from
    low: Array
    high: Array
    weight: Array
    limited: tuple[int, ...]
    iterations: int  # of one sample
    budget: int  # changes of the active set in one iteration

    @property
    def results(self) -> int:
        """Outputs, whether there is a plan, the largest change of a move, and the plan."""
        return len(self.r) + 2 + self.length * (len(self.q) + len(self.r))


@dataclass(frozen=True, slots=True)
class Solve:
    """w = (results (k,), capped, infeasible) of `problem` for the parameters `function(x (n,), z (m,)) -> p`.

    `method` is how the controller finds them; None: by a search that ends at the optimum.
    """

    function: ca.Function
    problem: Quadratic | Horizon
    method: Sweeps | Tree | None = None

    @property
    def quadratic(self) -> Quadratic:
        """The problem, where it is a quadratic program."""
        assert isinstance(self.problem, Quadratic)
        return self.problem


@dataclass(frozen=True, slots=True)
class Flag:
    """One bit of the status word: true (1) when `says` holds."""

    name: str
    says: str


@dataclass(frozen=True, slots=True, eq=False)  # its functions cannot be compared: a law is equal to itself alone
class Law:
    """A discrete-time control law in physical units.

    `state` carries for each state variable the range that it provably never leaves while every input stays in its
    own range (`why` is that argument, one sentence a state); infinite where there is none.
    """

    name: str
    says: str
    period: float  # s
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    state: tuple[Signal, ...]
    start: tuple[float, ...]  # each in its state's unit
    why: tuple[str, ...]
    flags: tuple[Flag, ...]
    stages: tuple[Solve | Scalar, ...]
    rest: tuple[float, ...] = ()  # what each input stands at on paper where it is neither r nor y; empty: near 0
    states: tuple[int, ...] = ()  # inputs that carry the plant's states, in their order; empty: y is all it measures
    watched: tuple[int, ...] = ()  # inputs that carry the plant's outputs, where it is more than y
    watched_outputs: tuple[int, ...] = ()  # which output of the plant each of those carries; empty: the first ones
    first: ca.Function | None = None  # (x, z) -> x of the first sample: as if its inputs z had always stood
    opening: str = ""  # the state variable that is 0 in the first sample and 1 after it
    safe: tuple[float | None, ...] = ()  # outputs where an input is not finite; None, or empty: its low limit
    paired: bool = True  # one reference and one measurement close its loop on paper
    tunable: tuple[str, ...] = ()  # state that a step keeps and a user may set within its range, the last of `state`

    @property
    def last(self) -> Scalar:
        """The stage that gives next state, outputs and flags."""
        stage = self.stages[-1]
        assert isinstance(stage, Scalar)
        return stage

    @property
    def solve(self) -> Solve | None:
        """The stage before it, if there is one."""
        if len(self.stages) == 1:
            return None
        stage, _ = self.stages
        assert isinstance(stage, Solve)
        return stage

    @property
    def reasons(self) -> Mapping[str, str]:
        """`why` by the name of the state variable."""
        return {signal.name: why for signal, why in zip(self.state, self.why, strict=True)}
