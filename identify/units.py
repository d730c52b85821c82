"""Read the unit of a quantity out of the end of its name."""

from __future__ import annotations

import re
from collections.abc import Iterator

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion, is_symbol, is_unit

# A name has no solidus, so that each ending says what it means; the longest that fits counts.
_ENDINGS = {
    "N_m_s2_rad2": "N*m*s^2/rad^2",
    "N_m_s_rad": "N*m*s/rad",
    "V_s_rad": "V*s/rad",
    "N_m_rad": "N*m/rad",
    "N_m_A": "N*m/A",
    "N_s2_m2": "N*s^2/m^2",
    "N_s_m": "N*s/m",
    "N_m": "N*m",
    "kg_m2": "kg*m^2",
    "rad_s2": "rad/s^2",
    "rad_s": "rad/s",
    "deg_s": "deg/s",
    "m3_s": "m^3/s",
    "m_s2": "m/s^2",
    "m_s": "m/s",
    "kg_s": "kg/s",
    "l_min": "l/min",
    "V_s": "V*s",
    "K_per_W": "K/W",
    "W_K": "W/K",
    "J_K": "J/K",
    "ohm": "ohm",
    "rpm": "rpm",
    "rad": "rad",
    "deg": "deg",
    "bar": "bar",
    "Pa": "Pa",
    "Wb": "Wb",
    "kg": "kg",
    "Hz": "Hz",
    "m3": "m^3",
    "m2": "m^2",
    "V": "V",
    "A": "A",
    "N": "N",
    "H": "H",
    "F": "F",
    "K": "K",
    "m": "m",
    "C": "degC",
    "s": "s",
    "W": "W",
}
# A word that ends a name as a unit does, and in no name of an effect's parameter: half_width of a drive in percent.
_SHARE = "percent"
_MOST_WORDS = 5
# Arduino's clocks, and what a whole column may be called after; letters alone are symbols of quantities.
_WHOLE = {"millis": "ms", "micros": "us", "ms": "ms", "us": "us", "rpm": "rpm", "mA": "mA", "mV": "mV", "deg": "deg"}
# Ends of names that are words in a name, not units: v_in, speed_min, gain_kp, u_pu; MV is manipulated by a controller,
# MA a moving average, and either is milli, in capitals, where a voltage or a current is meant.
_WORDS = frozenset("in min p kp Kp g h l T J F K rev prev turn turns tr second sec MV MA".split())
# What flows or moves in a time without a unit of its own, and what is counted in it: l_s is l/s, but N_s is no N/s.
_AMOUNTS = frozenset("mm cm km um ft l L ml mL cl g mg kg m rev turns tr rad mrad deg percent K degC".split())
_STEEP = dict.fromkeys(("ms", "us"), frozenset("V mV kV A mA".split()))  # slew rates: V_us; V_s is a flux
_COUNTED = frozenset(
    "1 counts ticks pulses steps samples lines px mol gal ppm rot cycles frames bits bytes beats drops strokes edges "
    "events rounds".split()
)
# Symbols that no sheet of a motor prints: of what is in a volume, on an area or in a mass, mol_m3 is no m3.
_ELSEWHERE = frozenset("mol mmol umol nmol kmol lm cd lx Bq Gy Sv kat eV Wh kWh Ah mAh VA sr dB ppm cP gal".split())
# Units whose capitals or solidus a name may have lost, CURRENT_MA, currentMa, speed_kmh, by their small letters.
_ANY_CAPITALS = {
    unit.lower(): unit
    for unit in "mV uV kV mA uA kA kHz Pa kPa MPa kN mN Nm mNm Ncm Nmm ms us ns mm cm um km kg mg mbar kW".split()
} | {
    **dict.fromkeys(("rads", "radps"), "rad/s"),
    **dict.fromkeys(("degs", "degps"), "deg/s"),
    **dict.fromkeys(("kmh", "kph"), "km/h"),
    **{"mps": "m/s", "mmps": "mm/s", "lpm": "l/min"},
}
# Words of names that are units where one of their kind is wanted.
_WORDS_OF_A_KIND = frozenset("rev turns tr sec second".split())
# Words that a letter counts: Channel A is no current.
_LETTERED = frozenset("channel ch kanal voie input probe analog sensor port trace".split())


def unit_of(name: str) -> str:
    """Return the unit that `name` ends in (`speed_rad_s` -> `rad/s`), empty where the ending is none we know."""
    rate = re.search(r"(?:^|_)(?:rate|slew)_(.+)_s$", name)
    if rate and rate.group(1) in _ENDINGS:
        return f"{_ENDINGS[rate.group(1)]}/s"
    return _ENDINGS.get(ending_of(name), _SHARE if _is_share(name) else "")


def stem_of(name: str) -> str:
    """Return `name` without the unit at its end (`speed_rad_s` -> `speed`), empty where there is none we know."""
    ending = ending_of(name) or (_SHARE if _is_share(name) else "")
    return name.removesuffix(ending).strip("_") if ending else ""


def _is_share(name: str) -> bool:
    words = name.split("_")
    return len(words) > 1 and words[-1] == _SHARE and not (len(words) > 2 and _goes_on(words[-2], _SHARE))


def ending_of(name: str) -> str:
    """Return the unit as it is spelled in `name` (`speed_rad_s` -> `rad_s`), empty where the ending is none we know.

    Units before it that make no ending we know (`x_V_m_s`, `speed_mm_s`) leave it unknown: half a unit is a wrong one.
    """
    words = name.split("_")
    for count in range(min(_MOST_WORDS, len(words) - 1), 0, -1):
        ending = "_".join(words[-count:])
        if ending in _ENDINGS:
            return "" if len(words) > count + 1 and _goes_on(words[-count - 1], ending) else ending
    return ""


def _goes_on(before: str, ending: str) -> bool:
    """Tell whether the word before an ending belongs to the unit: the mm of mm_s, the l of l_s, counts_s, rad_per_s."""
    word = before.rstrip("234")
    if word in _ENDINGS or word in _ELSEWHERE or word == "per":
        return True
    if ending == "s" and (word in _AMOUNTS or word in _COUNTED):
        return True
    return len(word) > 1 and is_symbol(word) and word not in _WORDS


def carried_unit(name: str) -> str:
    """Return the unit that a foreign column name carries: `t_ms`, `Speed [rpm]`, `u %`, `rpm`; empty where none."""
    bracket = re.search(r"[\[({]([^\[\](){}]+(?:\([^()]*\))?[^\[\](){}]*)[\])}]\s*$", name)
    if bracket:
        return bracket.group(1).strip() if is_unit(bracket.group(1)) else ""
    if (sign := name.strip()[-1:]) in ("%", "\u2030"):  # no letter of a name
        return sign
    if name in _WHOLE or name.lower() == "rpm":
        return _WHOLE.get(name, "rpm")
    if unit_of(name):
        return unit_of(name)
    if channel := re.fullmatch(r"(?i:ch)\d+(mV|V|mA|A)", name.strip()):  # of Rigol's scopes: CH1V
        return channel.group(1)
    last = re.split(r"[_\s]+", name.strip())[-1]
    if re.search(r"[/^\u207b]|\w-1$", last):  # min-1, m/s and, as standards print it, n/min-1
        return next((each for each in (last, last.partition("/")[2]) if _is_quotient(each)), "") or _last_word(name)
    return _last_word(name)


def likely_unit(name: str, wanted: str) -> str:
    """Return the unit that a foreign name carries where a quantity in `wanted` is meant; empty where none of that kind.

    As `carried_unit`, and anywhere in the name and in any capitals: `speed_rpm_raw`, `currentMa`, `TIME_MS`.
    """
    own = carried_unit(name)
    if not wanted or is_in(own, wanted) or "/" in own:
        return own
    within = next((each for each in _units_within(name) if is_in(each, wanted)), own)
    return "degF" if not within and wanted == "degC" and _ends_in_f(name) else within


def _ends_in_f(name: str) -> bool:
    """Tell whether the last word of a name is the letter of Fahrenheit, in capitals: f is filtered as often."""
    words = [word for piece in re.split(r"[\W_\d]+", name) if piece for word in camel_words(piece)]
    return len(words) > 1 and words[-1] == "F" and words[-2].lower() not in _LETTERED


def _units_within(name: str) -> Iterator[str]:
    """Yield what may be a unit in a name, from its end: what stands in brackets, words, and words in other capitals."""
    yield from reversed(re.findall(r"[\[({]([^\[\](){}]+)[\])}]", name))
    pieces = [each for each in re.split(r"[^\w/^*%\u2030\u00b0\u00b7-]+|_", name) if each]
    before = ("_".join(pieces[: k + 1]) for k in range(len(pieces) - 1, -1, -1))
    yield from (unit for each in before if len(unit := carried_unit(each)) > 1)
    parts = (part for each in reversed(pieces) if each.lower() != "erpm" for part in reversed(camel_words(each)))
    for piece in [*reversed(pieces), *parts]:
        word = re.sub(r"(?i)^[^ke](?=r(pm|ps)$)", "", piece.rstrip("0123456789"))  # nRpm holds no nano
        if word.lower() in _ANY_CAPITALS:
            yield _ANY_CAPITALS[word.lower()]
        elif len(word) > 1 and word.lower() not in _WORDS - _WORDS_OF_A_KIND and is_symbol(word):
            yield word
        elif _is_quotient(piece):
            yield piece


def camel_words(name: str) -> list[str]:
    """Return the words of a name that capitals part: `motorSpeedRPM`."""
    return re.split(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", name)


def is_in(unit: str, wanted: str) -> bool:
    """Tell whether a value in `unit` can become one in `wanted`."""
    try:
        return conversion(unit, wanted, "").factor > 0.0
    except IdentifyError:
        return False


def _is_quotient(text: str) -> bool:
    return bool(re.search(r"[/^\-\u207b]", text)) and is_unit(text)


def _last_word(name: str) -> str:
    """Return the unit that the last words of a name are."""
    words = re.split(r"[_\s/]+", name.strip())
    if composed := _composed(words):
        return composed
    last = words[-1]
    if len(words) < 2:  # alone, only what has its prefix written out: milliamps
        return last if re.match(r"(?i)(milli|micro|kilo|nano|centi)\w", last) and is_symbol(last) else ""
    if last in _WORDS or (len(last) == 1 and last not in _ENDINGS):
        return ""
    if words[-2] == "per" or (last == "s" and words[-2] in _COUNTED):  # the end of a unit, and another one alone
        return ""
    if len(last) == 1 and words[-2].lower() in _LETTERED:
        return ""
    return last if is_symbol(last) or last in ("mNm", "Nm", "Ncm", "uNm") else ""


def _composed(words: list[str]) -> str:
    """Return the unit of several words: an ending we know with a prefix, mN_m, an amount a time, l_s, or rad_per_s."""
    for count in range(min(_MOST_WORDS, len(words) - 1), 1, -1):
        known = "_".join((words[-count][1:], *words[1 - count :]))
        if known in _ENDINGS and is_symbol(words[-count]):
            return words[-count][0] + _ENDINGS[known]
    found = re.search(r"(?:^|_)([^_]+)_per_([^_]+)$|_([^_]+)_(s|min|h|ms|us)$", "_".join(words))
    if found is None or (found[3] and found[3].rstrip("234") not in (_AMOUNTS | _STEEP.get(found[4], frozenset()))):
        return ""
    quotient = f"{found[1] or found[3]}/{found[2] or found[4]}"
    return quotient if is_unit(quotient) else ""
