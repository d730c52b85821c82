"""An Effect: one piece of physics that a nominal plant leaves out, and how it enters a simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import casadi as ca

from firmloop.identify.plants.assembly import Assembly
from firmloop.identify.plants.plant import Plant
from firmloop.identify.units import is_in

_Values = TypeVar("_Values", ca.SX, ca.DM)


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """One constant of an effect.

    `neutral` is the value at which the effect changes nothing; `default` is what a project may leave out, None where
    it must be given. `logarithmic`: positive over decades, to be fitted as its logarithm. `low`..`high` is the
    physical range: a fit that ends on it says that the effect is not what the data shows.
    """

    name: str
    unit: str
    low: float
    high: float
    neutral: float
    logarithmic: bool
    default: float | None


_NEVER_MOVE = ("K", "A", "W", "Pa", "m^3/s", "kg/s", "m^3", "kg", "N", "N*m", "J")  # nor has a speed m or rad


@dataclass(frozen=True, slots=True)
class Site:
    """Where an effect enters a plant, and how its quantities are called there.

    `effort` is `N_m` or `N`, `travel` is `rad` or `m`: the endings of parameter names. `state` is the position in
    the plant's states of the balance, `output` that of the output which a sensor effect acts on.
    """

    rotary: bool
    effort: str
    travel: str
    input: str  # ending of the input's name
    input_unit: str
    output: int
    output_name: str
    output_ending: str
    output_unit: str
    level_unit: str
    balance: int  # in plant.balances, -1 for none
    lag: int = 0  # order of a lag, where what moves the plant is in the output's unit: a speed, or of two a position
    lag_unit: str = ""  # that unit; blank where nobody says

    @property
    def moves(self) -> bool:
        """Whether what it acts on may move, by the unit of a lag: no level, flow, pressure or heat does.

        Volts, counts and shares may be what a sensor makes of anything.
        """
        never = _NEVER_MOVE if self.lag > 1 else (*_NEVER_MOVE, "m", "rad")
        return not self.lag or not any(is_in(self.lag_unit, other) for other in never)

    @property
    def force(self) -> str:
        """Unit of what moves the plant."""
        return self.force_per(0)

    def force_per(self, travels: int, seconds: int = 0) -> str:
        """Return the unit of what moves the plant, times s^seconds / travel^travels."""
        if self.lag:
            return self._lagging(1 - travels, seconds + travels * (self.lag - 2))
        return _unit({"N": 1, "m": int(self.rotary), "s": seconds} | {"rad" if self.rotary else "m": -travels})

    @property
    def travel_unit(self) -> str:
        """Unit of the way."""
        return self._lagging(1, 2 - self.lag) if self.lag else self.travel

    @property
    def speed_unit(self) -> str:
        """Unit of the speed."""
        return self._lagging(1, 1 - self.lag) if self.lag else f"{self.travel}/s"

    @property
    def input_rate(self) -> str:
        """Unit of how fast the input changes."""
        return _composed(self.input_unit, 1, -1) if self.input_unit else "/s"

    def _lagging(self, outputs: int, seconds: int) -> str:
        """Return the unit of a lag's output^outputs s^seconds; blank where that of the output counts and is unknown."""
        return "" if outputs and not self.lag_unit else _composed(self.lag_unit, outputs, seconds)

    @property
    def load(self) -> str:
        """Name of the inertia or mass of a second body."""
        return "load_inertia_kg_m2" if self.rotary else "load_mass_kg"

    @property
    def load_unit(self) -> str:
        """Unit of that."""
        if self.lag:
            return self.force_per(1, 2)
        return "kg*m^2" if self.rotary else "kg"

    @property
    def damping(self) -> str:
        """Ending of the name of a viscous constant."""
        return "N_m_s_rad" if self.rotary else "N_s_m"

    @property
    def stiffness(self) -> str:
        """Ending of the name of a spring constant."""
        return "N_m_rad" if self.rotary else "N_m"


def _composed(unit: str, power: int, seconds: int) -> str:
    """Return unit^power s^seconds, as `rad/s^2`."""
    powers: dict[str, int] = {}
    for k, part in enumerate(unit.split("/")):
        for factor in part.split("*") if power else ():
            name, _, size = factor.partition("^")
            own = (int(size) if size.isdigit() else 1) * (-power if k else power)
            powers[name] = powers.get(name, 0) + own
    powers["s"] = powers.get("s", 0) + seconds
    return _unit({name: size for name, size in powers.items() if name != "1"})


def _unit(powers: Mapping[str, int]) -> str:
    """Return the product of units to these powers, as `N*m*s^2/rad^2`."""
    above, below = (
        "*".join(f"{name}^{size}" if size > 1 else name for name, size in sized if size > 0)
        for sized in ([*powers.items()], [(name, -power) for name, power in powers.items()])
    )
    if not below:
        return above or "1"
    return f"{above or '1'}/({below})" if "*" in below else f"{above or '1'}/{below}"


@dataclass(frozen=True, slots=True)
class Scales:
    """Typical sizes in a set of recordings (largest magnitudes, SI), from which starts of a fit are drawn."""

    input: float
    output: float  # of the output a sensor effect acts on
    output_low: float
    output_high: float
    plateau: (
        float  # magnitude near the largest one at which that output's readings gather; the largest where they do not
    )
    rested: float  # magnitude that a limit of that output is not below; 0 where it does not rest at its largest
    current: float  # A
    effort: float  # N m or N: what the drive gives
    speed: float
    travel: float  # range of position
    place_low: float  # lowest position
    place_high: float
    inertia: float
    resistance: float  # ohm
    step: float  # s, typical sample time
    span: float  # s
    begin: float  # s, first row of all recordings
    end: float  # s, last row
    slew: float  # largest change of the input from row to row, over the sample time
    fall: float  # by which the size of the input falls after a larger one, at the most
    other_way: float  # largest size of the input on the side where that is smaller
    least: float  # size that the input is never below; 0 where it goes both ways
    level: float  # of the state an overflow acts on
    comes_back: bool = True  # whether a place that nobody reads does; where it only grows, it is as a time
    switched: tuple[float, ...] = ()  # s, the moments at which an input changes, where it does so twice at the most

    def times(self, rows: float) -> tuple[float, ...]:
        """Return times from that many rows to a tenth of the longest recording, each four times the last, in s.

        How fast a recording was sampled says nothing of how fast the machine is.
        """
        last = max(0.1 * self.span, rows * self.step)
        count = 1 + int(math.log(last / (rows * self.step), 4.0) + 1e-9)
        return tuple(rows * self.step * 4.0**k for k in range(count))


@dataclass(frozen=True, slots=True)
class Holding:
    """What a drive has to give, in the unit of the balance, to hold a plant against an effect; nothing where all is 0.

    With w the speed and th the position it is the sum of: `up` for w > 0 and -`down` for w < 0; `extra`
    exp(-(w/`slow`)^2) sign(w); `drag` w |w|; `constant`; `spring` th + `cubic` th^3; `wave` sin(`turns` th + `phase`);
    `share` of the rest's magnitude, times sign(w). A dead zone instead takes `dead` from what the drive is told.
    """

    up: float = 0.0
    down: float = 0.0
    extra: float = 0.0
    slow: float = 1.0
    drag: float = 0.0
    constant: float = 0.0
    spring: float = 0.0
    cubic: float = 0.0
    wave: float = 0.0
    turns: float = 1.0
    phase: float = 0.0
    share: float = 0.0
    dead: float = 0.0

    def effort(self, w: _Values, sign: _Values, th: _Values) -> _Values:
        """Return the torque or force of the effect at a speed, its sign, and a position; none of `share` and `dead`."""
        terms = []
        if self.extra:
            terms.append(-(self.up + self.extra * ca.exp(-((w / self.slow) ** 2))) * sign)
        elif self.up == self.down != 0:
            terms.append(-self.up * sign)
        elif self.up or self.down:
            terms.append(-self.up * (1 + sign) / 2 + self.down * (1 - sign) / 2)
        if self.drag:
            terms.append(-self.drag * w * w * sign)
        if self.constant:
            terms.append(0.0 * w - self.constant)
        if self.wave:
            terms.append(-self.wave * ca.sin(self.turns * th + self.phase))
        if self.spring:
            terms.append(-self.spring * th)
        if self.cubic:
            terms.append(-self.cubic * th * th * th)
        return sum(terms, start=0.0 * w)


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect of the library.

    `place` says what it needs: `torque` (a torque or force balance), `current` (a torque balance driven by a current),
    `voltage`, `actuator`, `sensor`, `flow`, `timing`. `parameters(site)` names its constants, `starts(site, scales)`
    gives the points a fit begins from, in the order of the parameters. `attach(assembly, site, values)` adds it to a
    simulation; it is not called where the values are neutral. `code` is C for the simulator: the body of a function
    of `v` (the moment's view of the plant: `x[]`, `u`, `t`, `w`, `th`, `turn`, `i`, `effort`, `s`) and `q[]`
    (constants) that returns a double. `holding(site, values)` is what a controller can give against it, None where it
    cannot; `unmet` then says why, in half a sentence. `possible(site, scales)` says whether recordings of these sizes
    may show it, `bounded(parameter, scales)` narrows a parameter to what they can tell, `within(values, scales)` brings
    a fit's values back to where they are this effect's at all, `believable(values, scales)` says whether a fit's values
    are still this effect's, `distinct(values, scales)` whether they may stand for no change of the input,
    `becomes(values, scales)` names the simpler effect that they amount to, blank for none; None where they do not
    matter.
    `coordinate` is what it is seen against, blank for its term; `contains` are the effects that are special cases of
    it; `units` those of the outputs that a sensor effect can act on, none for any. An input and a reading pass through
    their effects in the order of `stage`. `contact` begins the names of the parameters that say where bodies meet, how
    stiff they are there and how damped: a cost has kinks. `limits`: it cuts a signal off; `slow`: it may look like a
    slow disturbance; `lasting`: it stays the same, as the average of such a one does not; `late`: it may look like
    another hold of the input. `screened`: what it changes at a start tells how much a fit gains by it. `touches`: its
    force is zero but where bodies touch, and the simulator finds the moment. `fits(plant)` replaces the question
    whether the plant has such a place, where another decides. `straight`: what it makes of a reading has a slope at
    rest. `remembers` names its function that keeps where the motion last turned round. `regime` is what recordings must
    hold to show it: `reversal` (both directions of motion), `way back` or `quick input`, blank for nothing in
    particular. `seen_by` is what finds it before any fit, blank for nothing: `wraps`, `steps` or `folds` of a reading;
    `moment`, at which a torque comes; `order` or `order of effort`, how often per turn a torque repeats, by itself or
    in proportion to the drive's; `turn`, that it does so once. `per_recording` is what a project calls its parameter
    where each recording has its own, before the place; blank where it is called by its full name. `undo(values,
    reading)` is what a reading was before it, None where that cannot be told. `anywhere`: a balance of what does not
    move may have it, too, as of a level; other torques are not looked for there.
    """

    name: str
    equation: str  # torque | voltage | actuator | sensor | flow | timing
    place: str
    term: str  # as text
    says: str  # one sentence for a reader who meets it
    parameters: Callable[[Site], tuple[EffectParameter, ...]]
    starts: Callable[[Site, Scales], tuple[tuple[float, ...], ...]]
    confusable_with: tuple[str, ...]
    experiment: str  # one sentence: what would tell it apart
    rotary_only: bool
    needs_position: bool
    attach: Callable[[Assembly, Site, tuple[float, ...]], None]
    codes: tuple[tuple[str, str], ...]  # (name of the C function, its body)
    switches: tuple[int, ...] = (0,)  # parameters that are all neutral where the effect changes nothing
    sum_of: tuple[tuple[str, tuple[float, ...]], ...] = ()  # effects it is the sum of: times each one's first parameter
    holding: Callable[[Site, tuple[float, ...]], Holding] | None = None
    unmet: str = ""
    possible: Callable[[Site, Scales], bool] | None = None
    bounded: Callable[[EffectParameter, Scales], EffectParameter] | None = None
    within: Callable[[Sequence[float], Scales], tuple[float, ...]] | None = None
    believable: Callable[[Sequence[float], Scales], bool] | None = None
    distinct: Callable[[Sequence[float], Scales], bool] | None = None
    becomes: Callable[[Sequence[float], Scales], str] | None = None
    coordinate: str = ""
    contains: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    stage: int = 0
    contact: tuple[str, ...] = ()
    limits: bool = False
    slow: bool = False
    lasting: bool = False
    late: bool = False
    screened: bool = True
    touches: bool = False
    fits: Callable[[Plant], bool] | None = None
    straight: bool = False
    remembers: str = ""
    regime: str = ""
    seen_by: str = ""
    per_recording: str = ""
    undo: Callable[[Mapping[str, float], float], float] | None = None
    anywhere: bool = False

    def neutral(self, site: Site) -> tuple[tuple[int, float], ...]:
        """Return the parameters, by position, and their values at which the effect changes nothing."""
        known = self.parameters(site)
        return tuple((k, known[k].neutral) for k in self.switches)


def turning(body: str) -> bool:
    """Tell whether the body of a function of an effect follows the angle turn by turn."""
    return "v->turn" in body or "angle(v" in body


def size(name: str, unit: str) -> EffectParameter:
    """Return a parameter that is zero or more, and neutral at zero."""
    return EffectParameter(name, unit, 0.0, math.inf, 0.0, False, None)


def signed(name: str, unit: str) -> EffectParameter:
    """Return a parameter of either sign that is neutral at zero."""
    return EffectParameter(name, unit, -math.inf, math.inf, 0.0, False, None)


def within(values: Sequence[float], scales: Scales) -> bool:
    """Tell whether a time, the first value, is over before half of the longest recording: else little tells of it."""
    return values[0] < 0.5 * scales.span


def ceiling(name: str, unit: str) -> EffectParameter:
    """Return a positive parameter that is neutral where it is infinite."""
    return EffectParameter(name, unit, 0.0, math.inf, math.inf, True, None)


def shape(name: str, unit: str, usual: float) -> EffectParameter:
    """Return a positive parameter that matters only beside another one; `usual` stands for it while it does not."""
    return EffectParameter(name, unit, 0.0, math.inf, usual, True, None)


def damping(site: Site) -> EffectParameter:
    """Return the viscous constant of what bodies press on or hang by, that may be left out."""
    return EffectParameter(f"damping_{site.damping}", site.force_per(1, 1), 0.0, math.inf, 0.0, False, 0.0)


def phase(name: str) -> EffectParameter:
    """Return an angle in rad."""
    return EffectParameter(name, "rad", -math.inf, math.inf, 0.0, False, 0.0)


def ended(name: str, ending: str) -> str:
    """Put the ending of a unit behind a name, where there is one."""
    return f"{name}_{ending}" if ending else name
