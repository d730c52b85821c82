"""Read the unit of a quantity out of the end of its name."""

from __future__ import annotations

import re

from firmloop.identify.printed_units import is_symbol, is_unit

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
# Ends of names that are words in a name, not units: v_in, speed_min, gain_kp, u_pu.
_WORDS = frozenset("in min p kp Kp g h l T J F K rev turn turns tr second sec".split())
# What flows or moves in a time without a unit of its own, and what is counted in it: l_s is l/s, but N_s is no N/s.
_AMOUNTS = frozenset("mm cm km um ft l L ml mL cl g mg kg m rev turns tr rad mrad deg percent K degC".split())
_STEEP = dict.fromkeys(("ms", "us"), frozenset("V mV kV A mA".split()))  # slew rates: V_us; V_s is a flux
_COUNTED = frozenset("1 counts ticks pulses steps samples lines px mol".split())
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
    if word in _ENDINGS or word == "per":
        return True
    if ending == "s" and (word in _AMOUNTS or word in _COUNTED):
        return True
    return len(word) > 1 and is_symbol(word) and word not in _WORDS


def carried_unit(name: str) -> str:
    """Return the unit that a foreign column name carries: `t_ms`, `Speed [rpm]`, `u %`, `rpm`; empty where none."""
    bracket = re.search(r"[\[(]([^\[\]()]+(?:\([^()]*\))?[^\[\]()]*)[\])]\s*$", name)
    if bracket:
        return bracket.group(1).strip() if is_unit(bracket.group(1)) else ""
    if (sign := name.strip()[-1:]) in ("%", "\u2030"):  # no letter of a name
        return sign
    if name in _WHOLE or name.lower() == "rpm":
        return _WHOLE.get(name, "rpm")
    if unit_of(name):
        return unit_of(name)
    words = re.split(r"[_\s/]+", name.strip())
    if composed := _composed(words):
        return composed
    last = words[-1]
    if len(words) < 2 or last in _WORDS or (len(last) == 1 and last not in _ENDINGS):
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
    found = re.search(r"_([^_]+)_per_([^_]+)$|_([^_]+)_(s|min|h|ms|us)$", "_".join(words))
    if found is None or (found[3] and found[3].rstrip("234") not in (_AMOUNTS | _STEEP.get(found[4], frozenset()))):
        return ""
    quotient = f"{found[1] or found[3]}/{found[2] or found[4]}"
    return quotient if is_unit(quotient) else ""
