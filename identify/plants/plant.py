"""A Plant: the equations of a machine, its parameters, and what is uncertain about them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import casadi as ca

from firmloop.identify.normal import NORMAL_95
from firmloop.identify.signal import Signal

_FARTHEST = 50.0  # powers of e that a value is away from the one of all recordings


@dataclass(frozen=True, slots=True)
class Parameter:
    """One physical constant; `deviation` is one standard deviation in `unit`, None where it was not estimated.

    `logarithmic`: the fit works with its logarithm.
    """

    name: str
    unit: str
    value: float
    free: bool
    low: float
    high: float
    deviation: float | None
    logarithmic: bool = False

    @property
    def interval_95(self) -> tuple[float, float] | None:
        """95 % confidence interval within the physical bounds; None where the value was not estimated."""
        if self.deviation is None:
            return None
        reach = NORMAL_95 * self.deviation
        return max(self.value - reach, self.low), min(self.value + reach, self.high)

    @property
    def may_be_zero(self) -> bool:
        """Tell whether the value was estimated, and its 95 % interval holds 0."""
        interval = self.interval_95
        return interval is not None and interval[0] <= 0.0 <= interval[1]


@dataclass(frozen=True, slots=True)
class Balance:
    """An equation that effects can attach to: per * (sum of torques, forces, voltages, flows) = rate of a state.

    `state` is the index of that state; -1 where a voltage balance is algebraic (no inductance), so that the current
    follows at once. `position` is the index of the state that integrates a speed, -1 for none; `to` that of the state
    an overflow runs into, -1 for none. `effort` is what the drive gives, in N m or N; it is proportional to `current`
    where there is one. `inside` are the arguments of `Plant.inside` that an effect on this balance sets, in the order
    of its parameters; `current` and `effort` need not be linear there, nor the amplitude of phase currents in `axes`.
    """

    kind: str  # torque | force | voltage | flow | capacitor | winding | magnetizing | axes | bridge
    state: int
    per: ca.Function  # (p (k,)) -> scalar
    position: int = -1
    to: int = -1
    effort: ca.Function | None = None  # (x, u, p) -> scalar; not linear only in an `ode`
    current: ca.Function | None = None  # (x, u, p) -> scalar
    resistance: ca.Function | None = None  # (p) -> scalar
    inside: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Inside:
    """The equations with what effects change in the middle of them, as functions of (x, u, p, z).

    Where z (c,) is `neutral` they are those of the plant, which are quicker.
    """

    rate: ca.Function  # -> dx/dt (n,)
    reading: ca.Function  # -> y (r,)
    effort: ca.Function  # -> scalar, that of the torque or force balance
    neutral: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class EffectUse:
    """An effect of the library as a plant has it: values of its parameters (SI), and which of them a fit may change.

    `output` names what a sensor effect acts on (or the state of an overflow); None is the first one. `at` names the
    state of the balance that any other effect acts on; None is the first one that fits, in the order of the plant.
    """

    name: str
    output: str | None = None
    values: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    free: tuple[str, ...] = ()
    at: str | None = None


@dataclass(frozen=True, slots=True)
class Varying:
    """A value that differs from recording to recording, and does not change during one.

    What one recording has of it is an initial state, number `state`, that never moves: the parameter is its value plus
    that state, or, where `factor` says so, its value times e^state. `free`: whether a fit might change it for all.
    """

    name: str  # as a project lists it
    parameter: str  # full name
    state: int
    factor: bool
    free: bool

    def at(self, value: float, state: float) -> float:
        """Return what a recording has, where the parameter has that value."""
        return value * math.exp(min(max(state, -_FARTHEST), _FARTHEST)) if self.factor else value + state


@dataclass(frozen=True, slots=True)
class Plant:
    """Equations x' = rate(x, u, p), y = reading(x, u, p); the input acts `delay` later where a parameter says so.

    Effects come on top: their parameters stand behind the nominal ones and are no arguments of `rate` and `reading`.
    What is `varying` has states that stand still.
    """

    kind: str
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    parameters: tuple[Parameter, ...]
    rate: ca.Function  # (x (n,), u (m,), p (k,)) -> dx/dt (n,)
    reading: ca.Function  # (x (n,), u (m,), p (k,)) -> y (r,)
    delay: str | None  # name of the parameter that delays every input, s
    balances: tuple[Balance, ...] = ()
    effects: tuple[EffectUse, ...] = ()
    inside: Inside | None = None
    varying: tuple[Varying, ...] = ()
    input_at_rest: str | None = None  # name of the parameter that the input is at before the first row; None: zero

    @property
    def remembers(self) -> bool:
        """Tell whether the plant's own equations have states, which may be at rest before the first row."""
        return len(self.states) > len(self.varying)

    @property
    def moves(self) -> bool:
        """Tell whether it turns or moves something; a lag does where its output is called so."""
        if self.delay is not None:
            return self.outputs[0].name.partition("_")[0] in ("speed", "position")
        speeds = any(state.unit in ("rad/s", "m/s") for state in self.states)
        return speeds or any(balance.kind in ("torque", "force") for balance in self.balances)

    @property
    def driven(self) -> int:
        """The balance of the body that the drive pushes; -1 where none says what the drive gives it."""
        bodies = (k for k, b in enumerate(self.balances) if b.kind in ("torque", "force") and b.effort is not None)
        return next(bodies, -1)

    @property
    def resting_input(self) -> float:
        """The first input with which the plant rests, as given; zero where none is given."""
        given = next((p.value for p in self.parameters if p.name == self.input_at_rest), 0.0)
        return 0.0 if math.isnan(given) else given

    def valued(self, values: Mapping[str, float]) -> Plant:
        """Return the plant with these values of its parameters, by name; what is not among them stays."""
        return replace(self, parameters=tuple(replace(p, value=values.get(p.name, p.value)) for p in self.parameters))

    def freed(self, *names: str) -> Plant:
        """Return the plant with these of its parameters to be fitted as well, by name."""
        return replace(self, parameters=tuple(replace(p, free=p.free or p.name in names) for p in self.parameters))
