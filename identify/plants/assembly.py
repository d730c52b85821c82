"""An Assembly: the linear part of a simulation and the terms that effects have added to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.plants.linear_forms import Forms
from firmloop.identify.plants.plant import Plant

Array = NDArray[np.float64]

ADD, LEVEL, FACTOR, OUTPUT = range(4)  # as in driver/segments.c
FRICTION, LIMIT = range(2)
Change = Callable[[Array, float], Array]
Rate = tuple[float, float, float, float, float, float]  # see Term
STEADY: Rate = (0.0,) * 6  # constant while the input is
_QUICK = 1e-8  # s; electrical time constant that stands for none


@dataclass(frozen=True, slots=True)
class EffectTerm:
    """One function of the simulator.

    `rate` says how fast it changes, 1/s: constant, per |w|, per |dw/dt|, per i^2, per |position|, and
    while the current settles. `flank` are the slopes of a function by states, (state, slope) each, if it is linear as
    long as bodies touch, and zero while they do not. `speed` and `position` are the states of the body it acts on.
    """

    what: int
    code: str
    target: int
    constants: tuple[float, ...]
    per: float
    rate: Rate
    flank: tuple[tuple[int, float], ...] = ()
    speed: int = -1
    position: int = -1


@dataclass(frozen=True, slots=True)
class StickingState:
    """A state that can stick: a friction at zero, or a level at its limit with `share` of the excess passed `to`.

    A friction's level counts `per`; of a limit it is the side on which that is: 1 above, -1 below.
    """

    what: int
    row: int
    per: float
    limit: float
    to: int
    share: float


@dataclass(slots=True)
class Timing:
    """When inputs act and outputs are read."""

    input_delay: float = 0.0  # s
    output_delay: dict[int, float] = field(default_factory=dict)  # s, by output
    stretch: float = 0.0  # of the outputs' clock
    breaks: tuple[float, ...] = ()  # s
    slew: float = np.inf  # input unit per s
    # What is done to the input, as it differs from a centre, and by how much, in order; the same in C of u and size.
    maps: tuple[tuple[Change, float, str, float], ...] = ()

    def key(self) -> tuple[object, ...]:
        """Return what the segments of a course depend on."""
        late = tuple(sorted(self.output_delay.items()))
        return (self.input_delay, late, self.stretch, self.breaks, self.slew, self.maps)


def ringing(stiffness: float, per: float) -> float:
    """Return how fast (1/s) what a spring of `stiffness` moves rings; `per` is 1 / its inertia.

    Equations of one's own may be tried with an inertia below zero: from there it leaves as fast.
    """
    return math.sqrt(abs(stiffness * per))


class Assembly:
    """Grows while effects are attached; `rows` are states, and a form is (factors of states, factors of inputs)."""

    def __init__(self, plant: Plant, forms: Forms, constants: Array) -> None:
        self.plant = plant
        self.constants = constants  # of the plant and its effects
        self.a = forms.a.copy()
        self.b = forms.b.copy()
        self.c = forms.c.copy()
        self.read_x = forms.read_x.copy()
        self.read_u = forms.read_u.copy()
        self.read_c = forms.read_c.copy()
        self.forms = forms
        self.inputs = self.b.shape[1]
        self.current_x, self.current_u = np.zeros(len(self.a)), np.zeros(self.inputs)
        self.effort_x, self.effort_u = np.zeros(len(self.a)), np.zeros(self.inputs)
        self.speed = self.position = -1
        self.terms: list[EffectTerm] = []
        self.coordinates: list[StickingState] = []
        self.timing = Timing()
        self.lags: list[tuple[int, int, float]] = []  # output, row, 1/s
        # start value of each added state, from those before it and, by these shares, the inputs before the first row
        self.starts: list[tuple[Callable[[Array], float], Array]] = []
        self.per = [balance.per for balance in forms.balances]
        self.row = [balance.state for balance in plant.balances]
        self.bodies = bodies = [index for index, b in enumerate(plant.balances) if b.kind in ("torque", "force")]
        if bodies:
            self.act_at(bodies[0])
        if plant.driven >= 0:
            self.effort_x, self.effort_u = self._split(forms.balances[plant.driven].effort)
        for index, balance in enumerate(plant.balances):
            if balance.current is not None:
                self.current_x, self.current_u = self._split(forms.balances[index].current)

    def value(self, name: str) -> float:
        """Return what a constant of the plant is at this moment of a fit."""
        return float(self.constants[[p.name for p in self.plant.parameters].index(name)])

    def act_at(self, balance: int) -> None:
        """Let what is attached from now on act on the body of a balance, where that is one."""
        if balance >= 0 and self.plant.balances[balance].kind in ("torque", "force"):
            self.speed, self.position = self.plant.balances[balance].state, self.plant.balances[balance].position

    def _term(
        self,
        what: int,
        code: str,
        target: int,
        constants: tuple[float, ...],
        per: float,
        rate: Rate,
        flank: tuple[tuple[int, float], ...] = (),
    ) -> None:
        self.terms.append(EffectTerm(what, code, target, constants, per, rate, flank, self.speed, self.position))

    def _split(self, row: Array) -> tuple[Array, Array]:
        return row[: len(row) - self.inputs].copy(), row[len(row) - self.inputs :].copy()

    def add_state(self, start: Callable[[Array], float], by_input: Array | None = None) -> int:
        """Add a state at rest in the equations so far; `start` computes its first value from the plant's states.

        `by_input` (m,) is what the inputs before the first row add to it.
        """
        n = len(self.a)
        self.a = _grown(self.a, n + 1, n + 1)
        self.b = _grown(self.b, n + 1, self.inputs)
        self.read_x = _grown(self.read_x, len(self.read_x), n + 1)
        self.c, self.current_x, self.effort_x = (np.append(row, 0.0) for row in (self.c, self.current_x, self.effort_x))
        self.starts.append((start, np.zeros(self.inputs) if by_input is None else by_input))
        return n

    def add_term(self, row: int, code: str, constants: tuple[float, ...], per: float, rate: Rate) -> None:
        """Add per * code(...) to the derivative of a state."""
        self._term(ADD, code, row, constants, per, rate)

    def add_flank(
        self, row: int, code: str, constants: tuple[float, ...], per: float, rate: float, *slopes: tuple[int, float]
    ) -> None:
        """Add per * code(...) to the derivative of a state, a force of bodies: see Term for its slopes."""
        self._term(ADD, code, row, constants, per, (rate, *STEADY[1:]), slopes)

    def add_factor(self, row: int, code: str, constants: tuple[float, ...], rate: Rate) -> None:
        """Multiply the derivative of a state by 1 + code(...)."""
        self._term(FACTOR, code, row, constants, 1.0, rate)

    def add_level(self, balance: int, code: str, constants: tuple[float, ...], rate: Rate) -> None:
        """Add a friction of level code(...) >= 0 against the motion of a balance's state; it sticks at zero."""
        row = self.row[balance]
        known = [c.row for c in self.coordinates]
        if row not in known:
            self.coordinates.append(StickingState(FRICTION, row, self.per[balance], 0.0, -1, 0.0))
            known.append(row)
        self._term(LEVEL, code, known.index(row), constants, 1.0, rate)

    def add_limit(self, balance: int, limit: float, share: float) -> None:
        """Keep a state at or below `limit`; `share` of the flow that is blocked goes to the balance's `to`."""
        to = self.plant.balances[balance].to
        further = next((k for k, b in enumerate(self.plant.balances) if b.state == to), balance)
        passed = share * self.per[further] / self.per[balance]
        self.coordinates.append(StickingState(LIMIT, self.row[balance], 1.0, limit, to, passed))

    def add_limits(self, balance: int, size: float) -> None:
        """Keep a state within -`size` and `size`."""
        for side in (1.0, -1.0):
            self.coordinates.append(StickingState(LIMIT, self.row[balance], side, side * size, -1, 0.0))

    def map_output(self, output: int, code: str, constants: tuple[float, ...]) -> None:
        """Replace an output by code(...) of it."""
        self._term(OUTPUT, code, output, constants, 1.0, STEADY)

    def map_input(self, change: Change, size: float, c: str, centre: float = 0.0) -> None:
        """Replace the first input (n,), as it is recorded, by change(input, size); `c` is that of u and size in C.

        Both are of what the input differs from `centre`.
        """
        self.timing.maps = (*self.timing.maps, (change, size, c, centre))

    def resting_input(self) -> float:
        """Return the first input with which the plant rests."""
        return 0.0 if self.plant.input_at_rest is None else self.value(self.plant.input_at_rest)

    def lag_output(self, output: int, time_constant: float) -> None:
        """Filter an output by a first-order lag."""
        rate = 1.0 / time_constant
        by_x, by_u = self.read_x[output].copy(), self.read_u[output].copy()
        row = self.add_state(lambda x: float(by_x[: len(x)] @ x[: len(by_x)]) + offset, by_u)
        offset = float(self.read_c[output])
        self.a[row, : len(by_x)] = rate * by_x
        self.a[row, row] = -rate
        self.b[row] = rate * by_u
        self.c[row] = rate * offset
        self.read_x[output] = 0.0
        self.read_x[output, row] = 1.0
        self.read_u[output] = 0.0
        self.read_c[output] = 0.0
        self.lags.append((output, row, rate))

    def winding(self) -> int:
        """Return which balance is that of the voltage, -1 where there is none."""
        return next((k for k, b in enumerate(self.plant.balances) if b.kind == "voltage"), -1)

    def dynamic_current(self) -> None:
        """Give an algebraic current a state with a time constant far below anything recorded."""
        index = self.winding()
        if index < 0 or self.row[index] >= 0:
            return
        form, torque = self.forms.balances[index], self.speed
        by_x, by_u = self._split(form.current)
        row = self.add_state(lambda x: float(by_x @ x[: len(by_x)]))
        drive = next(k for k, b in enumerate(self.plant.balances) if b.kind == "torque")
        constant = self._ratio(self.forms.balances[drive].effort, form.current)
        width = len(by_x)
        self.a[torque, :width] -= self.per[drive] * constant * by_x
        self.b[torque] -= self.per[drive] * constant * by_u
        self.a[torque, row] += self.per[drive] * constant
        for output, signal in enumerate(self.plant.outputs):
            if signal.name == "current_A":
                self.read_x[output, :width] -= by_x
                self.read_u[output] -= by_u
                self.read_x[output, row] += 1.0
        self.a[row, :width] = by_x / _QUICK
        self.b[row] = by_u / _QUICK
        self.a[row, row] = -1.0 / _QUICK
        self.current_x[:], self.current_u[:] = 0.0, 0.0
        self.current_x[row] = 1.0
        self.effort_x[:], self.effort_u[:] = 0.0, 0.0
        self.effort_x[row] = constant
        self.row[index], self.per[index] = row, 1.0 / (form.resistance * _QUICK)

    def current_rate(self) -> float:
        """Return how fast the current follows, 1/s; 0 where it does so at once."""
        for balance in self.plant.balances:
            if balance.kind == "voltage" and balance.state >= 0:
                return abs(float(self.a[balance.state, balance.state]))
        return 0.0

    def current_settles(self) -> Rate:
        """Return the rate of a term of the current or the effort: quick while it settles, then that of the speed."""
        if not np.any(self.effort_x):
            return STEADY
        quick = self.current_rate()
        slow = abs(float(self.a[self.speed, self.speed]))
        if quick > 0.0:
            row = self.plant.balances[self.winding()].state
            slow += abs(float(self.a[self.speed, row] * self.a[row, self.speed])) / quick
        return (slow, 0.0, 0.0, 0.0, 0.0, quick)

    @staticmethod
    def _ratio(effort: Array, current: Array) -> float:
        k = int(np.argmax(np.abs(current)))
        return float(effort[k] / current[k])

    def start(self, given: Array, before: Array) -> Array:
        """Return the whole start state from that of the plant, with the inputs (m,) `before` the first row."""
        whole = np.asarray(given, dtype=np.float64)
        for first, by_input in self.starts:
            whole = np.append(whole, first(whole) + float(by_input @ before))
        return whole


def _grown(matrix: Array, rows: int, columns: int) -> Array:
    """Return the matrix with zeroes below and to the right."""
    whole = np.zeros((rows, columns))
    whole[: matrix.shape[0], : matrix.shape[1]] = matrix
    return whole
