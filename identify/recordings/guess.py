"""Guess what each column of a file is, from its name, its unit and whether it rises: time, quantity, unit."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion
from firmloop.identify.recordings.columns import Column, called_a_time
from firmloop.identify.recordings.stamps import in_no_order
from firmloop.identify.recordings.table import RawTable
from firmloop.identify.recordings.ticks import tick_of
from firmloop.identify.units import carried_unit, ending_of, likely_unit, unit_of

Array = NDArray[np.float64]

# What a quantity may be called by others; the names that firmloop knows it by, of which the first is meant where the
# file says no unit.
_QUANTITIES: tuple[tuple[frozenset[str], tuple[str, ...]], ...] = (
    (frozenset("u v volt volts voltage vin uin vm um uq vq spannung tension tensao tensione".split()), ("voltage_V",)),
    (frozenset("i current curr amps amp ampere im ia iq strom courant corriente corrente".split()), ("current_A",)),
    (
        frozenset(
            "speed omega w rpm velocity vel rps drehzahl geschwindigkeit vitesse velocidad velocidade velocita".split()
        ),
        ("speed_rad_s", "speed_m_s"),
    ),
    (frozenset("angle theta phi alpha winkel angulo angolo".split()), ("position_rad",)),
    (
        frozenset("position pos encoder x weg posicion posicao posizione".split()),
        ("", "position_rad", "position_m"),
    ),
    (frozenset("temperature temp temperatur temperatura".split()), ("temperature_C",)),
    (frozenset("torque moment drehmoment couple coppia".split()), ("torque_N_m",)),
    (frozenset("force kraft fuerza forca forza thrust".split()), ("force_N",)),
)
# A unit that says by itself which quantity it is of, where the name does not.
_BY_UNIT = ("current_A", "speed_rad_s", "position_rad", "temperature_C", "torque_N_m", "force_N")
# In kg, g or lb a force has to be called one: what stands on a scale is a mass, a tank's level as often as not.
_MASS = "kg"
# Of these, g is the acceleration of gravity, and no gram of force.
_ACCELERATIONS = frozenset(
    "acc accel acceleration accx accy accz ax ay az vibration vib beschleunigung aceleracion aceleracao accelerazione "
    "vibracion vibracao vibrazione".split()
)
_REFERENCES = frozenset(
    "ref reference set setpoint sp target desired demanded demand requested wanted goal commanded soll sollwert "
    "referenz zielwert consigne referencia consigna objetivo deseado deseada desejado desejada riferimento".split()
)
# German writes as one word what is wanted or is, of what, and the quantity: Sollgeschwindigkeit, Motorspannung.
_COMPOUND = re.compile(
    "(soll|ist)?.*?(spannung|strom|drehzahl|geschwindigkeit|winkel|temperatur|drehmoment|kraft|druck)"
)
# Of what is read from a plant a command is a reference, too, and so it is beside what else drives the plant.
_COMMANDS = frozenset(["cmd", "command"])
_EITHER = frozenset(["output", "out"])  # of a controller, which drives the plant, or of the plant
# What a controller sends to a drive: a voltage beside it may be that of the drive, or of its supply.
_SENT = frozenset("duty pwm throttle esc servo cmd command".split())
_PULSES = frozenset("pulse pulses width puls impuls impulso pulso".split())  # that, where its unit is a time
_DRIVES = _SENT | frozenset(
    "u input in drive voltage volt volts vin uin vm um uq vq force torque valve heater pump fan relay switch heating "
    "cooling compressor solenoid relais schalter heizung pumpe ventil "
    "power control ctrl actuator q1 q2 stell stellgrad stellgroesse spannung tension mv manipulated co op".split()
)
_ANSWERS = frozenset(
    "y vout uout vo sensor tacho measured meas measurement actual feedback process pv ist istwert response level speed "
    "velocity vel omega rpm position pos angle theta temperature temp pressure flow estimate counts ticks encoder "
    "vitesse drehzahl geschwindigkeit winkel weg temperatur druck angulo angolo velocidad velocidade velocita posicion "
    "posicao posizione temperatura thrust mass weight scale balance masse gewicht waage poids peso".split()
)
# Which way a column leans whose words say nothing of it, such as those of another language.
_BY_QUANTITY = {
    "voltage_V": 1,
    "force_N": 1,
    "torque_N_m": 1,
    "speed_rad_s": -1,
    "position_rad": -1,
    "temperature_C": -1,
}
_SHARES = ("%", "percent")  # of what a drive can do
_PUSHES = ("V", "A", "N", "N*m")  # units in which a command is one of a drive
_GIVEN = frozenset("supply battery bat vbat vbus bus vcc vdd ff feedforward enable limit max min".split())
# What a column of a few whole numbers says of a drive whose quantity it names: torque_enable is no torque.
_FLAGS = frozenset(
    "enable enabled en on off active flag flags fault error state status mode ok ready alarm brake".split()
)
_CLOCKS = frozenset("s S sec Sec secs min h hr".split())
_MOST_STATES = 10  # of them


@dataclass(frozen=True, slots=True)
class Guessed:
    """What one column of a file seems to be.

    `unit` is what the file says of it, empty where it says nothing; `known` whether `name` is one that firmloop gives a
    quantity, of a time whether the file says its unit; `reference` a value that was asked for; `drives` and `reads` how
    much the name sounds like what moves the plant and like what is read from it: a supply is neither.
    """

    foreign: str
    name: str
    unit: str
    known: bool
    reference: bool
    drives: int
    reads: int
    quantity: str = ""  # what firmloop calls its quantity, which another column may be called too
    sent: bool = False  # whether a controller sends it to a drive

    @property
    def commands(self) -> bool:
        """Whether it is a reference of what moves a plant: of a current, a voltage, a torque or a force."""
        return self.reference and self.quantity in ("current_A", "voltage_V", "torque_N_m", "force_N")

    def alone(self, among: Sequence[Guessed]) -> Guessed:
        """Return it under the name of its quantity, where no other column has that name."""
        taken = any(each.name == self.quantity for each in among if each.foreign != self.foreign)
        return self if taken or not self.quantity else replace(self, name=self.quantity)

    @property
    def column(self) -> Column:
        """How the project has to read it."""
        wanted = unit_of(self.name)
        return Column(self.name, self.unit if self.unit and wanted and not _same(self.unit, wanted) else "")


def guess_time(table: RawTable) -> Guessed | None:
    """Return which column is the time, None where there is none; of several that say so the one that rises most often.

    A stamp may have fewer digits than a clock beside it.
    """
    units = [
        unit or likely_unit(name, "s") or _bare_unit(name)
        for name, unit in zip(table.names, _units(table), strict=True)
    ]
    found: list[tuple[tuple[int, float], Guessed]] = []
    for name, unit, values in zip(table.names, units, table.columns, strict=True):
        says = _converts(unit, "s")
        mixed = in_no_order(values) or _runs(-values)
        if not (says or called_a_time(name)) or (unit and not says) or not (mixed or _runs(values)):
            continue
        sure = 0 if mixed else 3 if name == "time_s" else 2 if says and called_a_time(name) else 1
        rises = float(np.mean(np.diff(values) > 0.0))
        found.append(((sure, rises), Guessed(name, "time_s", unit or tick_of(values, name), bool(unit), False, 0, 0)))
    return max(found, key=lambda each: each[0])[1] if found else None


def _bare_unit(name: str) -> str:
    """Return the name of a column that is a unit of time and nothing else, which a rising one then is in."""
    return name.strip() if name.strip() in _CLOCKS else ""


def guess_columns(table: RawTable, time: Guessed | None) -> tuple[Guessed, ...]:
    """Return what each column but the time seems to be."""
    pairs = [
        (name, unit)
        for name, unit in zip(table.names, _units(table), strict=True)
        if time is None or name != time.foreign
    ]
    held = dict(zip(table.names, table.columns, strict=True))
    flags = frozenset(name for name, _ in pairs if _stems(name) & _FLAGS and _counts(held[name]))
    aims = ["" if name in flags else _quantity(name, unit) for name, unit in pairs]
    pairs = [(name, _unit_in(name, unit, unit_of(aim))) for (name, unit), aim in zip(pairs, aims, strict=True)]
    asked = [_asks(name, aim) for (name, _), aim in zip(pairs, aims, strict=True)]
    wishes = ["" if asks else aim for asks, aim in zip(asked, aims, strict=True)]
    made: list[Guessed] = []
    for (foreign, unit), wish, aim, asks in zip(pairs, wishes, aims, asked, strict=True):
        words = _stems(foreign)
        own = foreign if ending_of(foreign) and re.fullmatch(r"[A-Za-z]\w*", foreign, re.ASCII) else ""
        twins = [other for (other, _), same in zip(pairs, wishes, strict=True) if wish and same == wish]
        apart = own not in ("", wish) and (not wish or _same(unit_of(own), unit_of(wish)))
        plain = not wish or (len(twins) > 1 and apart)
        name = (own or _slug(foreign, unit, [each.name for each in made])) if plain else wish
        pulse = bool(words & _PULSES) and _converts(unit, "s")
        leaning, aside = pulse + len(words & _DRIVES) - len(words & _ANSWERS), 2 * len(words & _GIVEN)
        share = 1 if unit in _SHARES and not words & _EITHER else 0
        leans = words & (_DRIVES | _ANSWERS) or pulse
        leaning = 0 if foreign in flags else leaning if leans else _BY_QUANTITY.get(wish, share)
        sent = pulse or bool(words & _SENT)
        made.append(Guessed(foreign, name, unit, not plain, asks, leaning - aside, -leaning - aside, aim, sent))
    return _with_references(_with_sides(made))


def _with_sides(made: Sequence[Guessed]) -> list[Guessed]:
    """Tell the output of a controller from that of a plant: it drives where nothing else does and another one reads."""
    either = [each for each in made if not each.drives and not each.reference and _stems(each.foreign) & _EITHER]
    others = [each for each in made if each not in either and not each.reference]
    alone, read = not any(each.drives > 0 for each in others), any(each.reads > 0 for each in others)
    sides = {each.foreign: 1 if alone and (read or each.unit in _SHARES) else -1 for each in either}
    return [
        replace(each, drives=sides[each.foreign], reads=-sides[each.foreign]) if each.foreign in sides else each
        for each in made
    ]


def _with_references(made: Sequence[Guessed]) -> tuple[Guessed, ...]:
    """Take a plain command for a reference where another column drives: then a controller stands between."""
    plain = [
        each.foreign
        for each in made
        if (words := _stems(each.foreign)) & _COMMANDS
        and not words & _DRIVES - _COMMANDS
        and not any(_converts(each.unit, unit) for unit in _PUSHES)
    ]
    if not any(each.drives > 0 and not each.reference and each.foreign not in plain for each in made):
        return tuple(made)
    return tuple(replace(each, reference=True) if each.foreign in plain else each for each in made)


def apart(one: Guessed, other: Guessed) -> tuple[Guessed, Guessed]:
    """Return two columns of one quantity, such as what goes in and what comes out, each under its own name."""
    if one.name != other.name:
        return one, other
    first = _slug(one.foreign, one.unit, ())
    second = _slug(other.foreign, other.unit, (first,))
    return replace(one, name=first, known=False), replace(other, name=second, known=False)


def refuse_twins(used: Sequence[Guessed], among: Sequence[Guessed], file: str) -> None:
    """Refuse two columns that seem to be the same signal where it is used.

    Raises
    ------
    IdentifyError
        naming both.
    """
    for one in used:
        same = [each.foreign for each in among if each.name == one.name and not each.reference]
        if len(same) > 1:
            both = " and ".join(map(repr, same)) + " both"
            if len(set(same)) < len(same):
                raise IdentifyError(
                    f"{file}: {len(same)} columns are called {same[-1]!r}; give each a name of its own in the header"
                )
            left, which = [same[-1]], "which one is"
            if len(same) > 2:
                both, which = f"{', '.join(map(repr, same))} all", "which ones are"
                left = [name for name in same if name != one.foreign]
            raise IdentifyError(
                f"{file}: columns {both} seem to be {one.name}; say {which} to be left out: "
                f"{' '.join(f'--leave-out {name!r}' for name in left)}"
            )


def rename_of(used: Sequence[Guessed]) -> Mapping[str, Column]:
    """Return what [recordings.rename] has to hold for columns to be read as guessed."""
    return {each.foreign: each.column for each in used if each.column != Column(each.foreign)}


def _units(table: RawTable) -> tuple[str, ...]:
    printed = table.units or ("",) * len(table.names)
    return tuple(unit or carried_unit(name) for name, unit in zip(table.names, printed, strict=True))


def _runs(values: Array) -> bool:
    """Tell whether values go up as a clock does: nearly always, though a counter may wrap and stamps repeat."""
    steps = np.diff(values)
    return bool(len(steps)) and bool(np.mean(steps >= 0.0) > 0.98) and bool(np.any(steps > 0.0))


def _counts(values: Array) -> bool:
    """Tell whether a column has a few whole numbers alone."""
    return len(seen := np.unique(values)) <= _MOST_STATES and bool(np.all(seen == np.round(seen)))


def _quantity(foreign: str, unit: str) -> str:
    """Return the name that firmloop has for a column, empty where none fits."""
    words = _words(foreign)
    if words & _ACCELERATIONS and _converts(unit, "m/s^2"):
        return ""
    others = words - {"w"} if words & _DRIVES else words  # the w of heater_w is no omega, but watts
    for called, names in _QUANTITIES:
        if not others & called:
            continue
        fits = [name for name in names if name and _converts(_unit_in(foreign, unit, unit_of(name)), unit_of(name))]
        if fits:
            return fits[0]
        if not unit:
            return names[0]
    if _converts(unit, _MASS):
        return ""
    return next((name for name in _BY_UNIT if unit and _converts(unit, unit_of(name))), "")


def _unit_in(foreign: str, unit: str, wanted: str) -> str:
    """Return the unit of a column as `wanted` lets its name be read, where the name alone tells it."""
    return likely_unit(foreign, wanted) if wanted and unit in ("", carried_unit(foreign)) else unit


def _asks(foreign: str, quantity: str) -> bool:
    """Tell whether a column holds what was asked for of a quantity."""
    words = _stems(foreign)
    return bool(words & _REFERENCES) or (_BY_QUANTITY.get(quantity) == -1 and bool(words & _COMMANDS))


def _words(name: str) -> frozenset[str]:
    """Return the words of a name without the unit at its end, which may be a word too: tacho_V, CH1 in V."""
    ending = ending_of(name)
    name = name.removesuffix(f"_{ending}") if ending else name
    carried = carried_unit(name)
    bare = re.sub(rf"(?:\bin\s+)?[\[(]?{re.escape(carried)}[\])]?\s*$", "", name) if carried else name
    name = bare if re.search(r"[A-Za-z]", bare) else name
    plain = "".join(sign for sign in unicodedata.normalize("NFKD", name) if not unicodedata.combining(sign))
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", plain)
    words = frozenset(word.lower() for word in re.split(r"[^A-Za-z0-9]+", spaced) if word)
    compounds = filter(None, (_COMPOUND.fullmatch(word) for word in words))
    return words | {part for compound in compounds for part in compound.groups() if part}


def _stems(name: str) -> frozenset[str]:
    """Return the words of a name, and those that are more than a letter without the number of a channel: temp1."""
    words = _words(name)
    return words | {bare for word in words if len(bare := word.rstrip("0123456789")) > 1}


def _slug(foreign: str, unit: str, taken: Sequence[str]) -> str:
    """Return a name that can stand for any column and is not taken, with the unit of ours that fits at its end."""
    bare = re.sub(r"[\[(].*?[\])]", "", foreign)
    plain = "_".join(re.findall(r"[A-Za-z0-9]+", bare)) or "column"
    plain = plain if plain[0].isalpha() else f"column_{plain}"
    likely = ("m_s2",) if _words(foreign) & _ACCELERATIONS else _PLAIN_ENDINGS
    endings = (each for each in likely if _converts(unit, unit_of(f"x_{each}")))
    ending = "" if _same(unit, "1") else next(endings, "")  # what is counted in ones is so under any name
    carried = carried_unit(bare.strip()) if ending and unit_of(plain) != unit_of(f"x_{ending}") else ""
    plain = plain.removesuffix(f"_{ending}") if ending else plain
    if carried:
        plain = re.sub(rf"_?{re.escape(carried)}$", "", plain) or "column"
    tail = f"_{ending}" if ending else ""
    names = (f"{plain}{number}{tail}" for number in ("", *(f"_{k}" for k in range(2, len(taken) + 3))))
    return next(name for name in names if name not in taken)


_PLAIN_ENDINGS = tuple("V A rad_s rad m m_s C N_m kg N Pa m3_s kg_s W m3 ohm percent".split())


def _converts(unit: str, wanted: str) -> bool:
    try:
        return bool(unit) and bool(wanted) and conversion(unit, wanted, "").factor > 0.0
    except IdentifyError:
        return False


def _same(unit: str, wanted: str) -> bool:
    return _converts(unit, wanted) and conversion(unit, wanted, "").changes_nothing
