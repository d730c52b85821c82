"""Read a unit as makers print it, "mNm/A", "oz-in-s^2", "V/1000 min^-¹": its factor to SI, checked by dimension.

Own instead of a library: a data sheet runs symbols together, prints forces as masses and turning speeds without a turn,
so a unit is read in every way that its print allows and the wanted dimension picks the one that is meant. It also
starts in no time.

Factors are exact by definition (Bureau International des Poids et Mesures, The International System of Units, 9th ed.;
NIST Special Publication 811, appendix B.8): 1 in = 25.4 mm, 1 lb = 0.45359237 kg, g_n = 9.80665 m/s^2.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

from firmloop.identify.error import IdentifyError
from firmloop.identify.unit_marks import COLUMNS, no_unit, without_marks

POUND, INCH, FOOT, GRAVITY = 0.45359237, 0.0254, 0.3048, 9.80665
_TURN = 2 * math.pi
_POWERS = {"k": 3, "K": 3, "M": 6, "d": -1, "c": -2, "m": -3, "u": -6, "\u03bc": -6, "n": -9, "p": -12}
_SPELLED_OUT = {"kilo": "k", "mega": "M", "centi": "c", "milli": "m", "micro": "u", "nano": "n"}
_PREFIXES = {letter: float(f"1e{power}") for letter, power in _POWERS.items()}

# factor; powers of kg, m, s, A, K; of an angle that is named; of a rate that counts turns in a turning speed
_Row = tuple[float, tuple[int, int, int, int, int], int, int]
_PREFIXED: dict[str, _Row] = {
    "V": (1.0, (1, 2, -3, -1, 0), 0, 0),
    "A": (1.0, (0, 0, 0, 1, 0), 0, 0),
    "\u03a9": (1.0, (1, 2, -3, -2, 0), 0, 0),
    "H": (1.0, (1, 2, -2, -2, 0), 0, 0),
    "F": (1.0, (-1, -2, 4, 2, 0), 0, 0),
    "Wb": (1.0, (1, 2, -2, -1, 0), 0, 0),
    "T": (1.0, (1, 0, -2, -1, 0), 0, 0),
    "C": (1.0, (0, 0, 1, 1, 0), 0, 0),
    "N": (1.0, (1, 1, -2, 0, 0), 0, 0),
    "J": (1.0, (1, 2, -2, 0, 0), 0, 0),
    "W": (1.0, (1, 2, -3, 0, 0), 0, 0),
    "Pa": (1.0, (1, -1, -2, 0, 0), 0, 0),
    "bar": (1e5, (1, -1, -2, 0, 0), 0, 0),
    "m": (1.0, (0, 1, 0, 0, 0), 0, 0),
    "g": (1e-3, (1, 0, 0, 0, 0), 0, 0),
    "s": (1.0, (0, 0, 1, 0, 0), 0, 0),
    "l": (1e-3, (0, 3, 0, 0, 0), 0, 0),
    "K": (1.0, (0, 0, 0, 0, 1), 0, 0),
    "rad": (1.0, (0, 0, 0, 0, 0), 1, 0),
    "Hz": (1.0, (0, 0, -1, 0, 0), 0, 1),
    "rpm": (_TURN / 60, (0, 0, -1, 0, 0), 1, 0),
    "rps": (_TURN, (0, 0, -1, 0, 0), 1, 0),
    "rev": (_TURN, (0, 0, 0, 0, 0), 1, 0),
    "gf": (1e-3 * GRAVITY, (1, 1, -2, 0, 0), 0, 0),
    "p": (1e-3 * GRAVITY, (1, 1, -2, 0, 0), 0, 0),
    "gn": (GRAVITY, (0, 1, -2, 0, 0), 0, 0),
    "dyn": (1e-5, (1, 1, -2, 0, 0), 0, 0),
}
_PLAIN: dict[str, _Row] = {
    "min": (60.0, (0, 0, 1, 0, 0), 0, -1),
    "h": (3600.0, (0, 0, 1, 0, 0), 0, -1),
    "day": (86400.0, (0, 0, 1, 0, 0), 0, -1),
    "deg": (math.pi / 180, (0, 0, 0, 0, 0), 1, 0),
    "dps": (math.pi / 180, (0, 0, -1, 0, 0), 1, 0),
    "degC": (1.0, (0, 0, 0, 0, 1), 0, 0),
    "degF": (5 / 9, (0, 0, 0, 0, 1), 0, 0),
    "hp": (550 * FOOT * POUND * GRAVITY, (1, 2, -3, 0, 0), 0, 0),
    "PS": (75 * GRAVITY, (1, 2, -3, 0, 0), 0, 0),
    "lb": (POUND, (1, 0, 0, 0, 0), 0, 0),
    "oz": (POUND / 16, (1, 0, 0, 0, 0), 0, 0),
    "lbf": (POUND * GRAVITY, (1, 1, -2, 0, 0), 0, 0),
    "ozf": (POUND / 16 * GRAVITY, (1, 1, -2, 0, 0), 0, 0),
    "slug": (POUND * GRAVITY / FOOT, (1, 0, 0, 0, 0), 0, 0),
    "mph": (5280 * FOOT / 3600, (0, 1, -1, 0, 0), 0, 0),
    "kph": (1 / 3.6, (0, 1, -1, 0, 0), 0, 0),
    "lpm": (1e-3 / 60, (0, 3, -1, 0, 0), 0, 0),
    "gpm": (231 * INCH**3 / 60, (0, 3, -1, 0, 0), 0, 0),
    "cfm": (FOOT**3 / 60, (0, 3, -1, 0, 0), 0, 0),
    "atm": (101325.0, (1, -1, -2, 0, 0), 0, 0),
    **{name: (pascal, (1, -1, -2, 0, 0), 0, 0) for name, pascal in COLUMNS.items()},
    "torr": (101325.0 / 760, (1, -1, -2, 0, 0), 0, 0),
    "hPa": (100.0, (1, -1, -2, 0, 0), 0, 0),
    "cc": (1e-6, (0, 3, 0, 0, 0), 0, 0),
    "psi": (POUND * GRAVITY / INCH**2, (1, -1, -2, 0, 0), 0, 0),
    "in": (INCH, (0, 1, 0, 0, 0), 0, 0),
    "ft": (FOOT, (0, 1, 0, 0, 0), 0, 0),
    "%": (0.01, (0, 0, 0, 0, 0), 0, 0),
    "\u2030": (1e-3, (0, 0, 0, 0, 0), 0, 0),
}
_ALSO = {  # other spellings; those of words are compared without regard to capitals
    **dict.fromkeys(("ohm", "ohms"), "\u03a9"),
    **dict.fromkeys(("volt", "volts"), "V"),
    **dict.fromkeys(("amp", "amps", "ampere", "amperes"), "A"),
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("minute", "minutes", "mins"), "min"),
    **dict.fromkeys(("hour", "hours", "hr", "hrs"), "h"),
    **{"days": "day", "hertz": "Hz", "kelvin": "K"},
    **dict.fromkeys(("watt", "watts"), "W"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("henry", "henries", "hy"), "H"),
    **dict.fromkeys(("gram", "grams"), "g"),
    **dict.fromkeys(("l", "liter", "liters", "litre", "litres"), "l"),
    **dict.fromkeys(("radian", "radians", "rads"), "rad"),
    **dict.fromkeys(("revolution", "revolutions", "revs", "turn", "turns", "tr", "umdr", "rot"), "rev"),
    **dict.fromkeys(("degree", "degrees", "\u00b0"), "deg"),
    **dict.fromkeys(("\u00b0c", "celsius"), "degC"),
    **dict.fromkeys(("\u00b0f", "fahrenheit"), "degF"),
    **dict.fromkeys(("lbs", "lbm", "pound", "pounds"), "lb"),
    **dict.fromkeys(("ozm", "ounce", "ounces"), "oz"),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys(("percent", "pct"), "%"),
    **dict.fromkeys(("permille", "promille"), "\u2030"),
}
_MEANT_TOO = {"g": ("gf", "gn"), "lb": ("lbf",), "oz": ("ozf",), "C": ("degC",), "F": ("degF",)}  # as many print them
_ZERO = {"degC": 273.15, "degF": 459.67 * 5 / 9}  # what 0 of a scale is, K
_TORQUES = ((1, 2, -2, 0, 0), (1, 2, -2, -1, 0), (1, 2, 0, 0, 0))  # N*m, N*m/A and kg*m^2: J/rad and so on
_SIGNS = {
    **dict.fromkeys("\u00b7\u22c5\u2219\u2022\u00d7", "*"),
    **dict.fromkeys("\u2212\u2013\u2010\u2011", "-"),
    **dict.fromkeys("\u00ba\u02da", "\u00b0"),
    "\u2044": "/",
}
_HIGH = "\u207a\u207b\u00b9\u00b2\u00b3\u2070\u2074-\u2079"  # signs and digits of a power
_TOKEN = re.compile(r"\s*(?:(\d+(?:\.\d+)?(?:e[-+]?\d+)?)|(\u00b0?[^\W\d_]+|[\u00b0%\u2030])|([-*/()^\u221a]))")
_LONGEST, _MOST_WAYS, _MOST_SYMBOLS = 48, 64, 4  # what is longer is no unit

_Token = tuple[str, bool]  # and whether it touches the one before


@dataclass(frozen=True, slots=True)
class Unit:
    """One way to read a unit: times `factor` it is SI; `basis` holds the powers of kg, m, s, A and K.

    `angle` is the power of an angle that is named; `turns` that of Hz, 1/min and 1/h, which count turns where a turning
    speed is meant and no angle is named. `zero` is what 0 of a temperature scale is, K.
    """

    factor: float = 1.0
    basis: tuple[float, ...] = (0.0,) * 5
    angle: float = 0.0
    turns: float = 0.0
    zero: float = 0.0

    def times(self, other: Unit, power: float) -> Unit:
        """Return this unit times the `power` of another."""
        if self == Unit() and power == 1.0:
            return other
        basis = tuple(a + power * b for a, b in zip(self.basis, other.basis, strict=True))
        factor = self.factor * other.factor**power
        return Unit(factor, basis, self.angle + power * other.angle, self.turns + power * other.turns)


@dataclass(frozen=True, slots=True)
class Conversion:
    """`factor` times a value plus `offset` is the value in the other unit."""

    factor: float
    offset: float = 0.0

    @property
    def changes_nothing(self) -> bool:
        """Tell whether both units are the same."""
        return math.isclose(self.factor, 1.0, rel_tol=1e-12) and self.offset == 0.0


def conversion(unit: str, wanted: str, key: str) -> Conversion:
    """Return how a value in `unit`, as printed, becomes one in `wanted`, a unit of ours such as "V*s/rad".

    Raises
    ------
    IdentifyError
        naming `key` where the unit is unknown, of another dimension, or fits in two ways.
    """
    goal = _readings(wanted)[0]
    if said := no_unit(unit):
        raise IdentifyError(f"{key}: in the unit {unit!r}, {said}")
    found = _readings(unit)
    if not found:
        known = ", ".join((*_PREFIXED, *_PLAIN)).replace("water", "H2O")
        raise IdentifyError(f"{key}: the unit {unit!r} holds {_stranger(unit)!r}, which is unknown; known: {known}")
    fits: list[Conversion] = []
    for one in found:
        if not _near(one.basis, goal.basis) or not _angles_fit(one, goal):
            continue
        factor = one.factor / goal.factor
        if _spins(goal) and not one.angle:
            factor *= _TURN**one.turns
        if goal.turns and one.angle:
            factor /= _TURN**goal.turns
        if all(not math.isclose(factor, other.factor, rel_tol=1e-9) for other in fits):
            fits.append(Conversion(factor, (one.zero - goal.zero) / goal.factor))
    if not fits:
        raise IdentifyError(f"{key} is in {unit or 'no unit'!r}, which is no {wanted}; give it in a unit of that kind")
    if len(fits) > 1:
        ways = " or ".join(f"{one.factor:.6g} {wanted}" for one in fits)
        raise IdentifyError(f"{key}: the unit {unit!r} can be {ways}; write * and brackets so that one is left")
    return fits[0]


def joined_groups(text: str) -> str:
    """Return `text` without what parts the thousands of its numbers: "10 600", "10'600"; ISO 80000-1, section 7.3."""
    return re.sub(r"(?<![\w.,])(\d{1,3})((?:[\s'\u2019_]\d{3})+)(?![\w])", lambda m: re.sub(r"\D", "", m[0]), text)


def is_unit(text: str) -> bool:
    """Tell whether `text` can be read as a unit at all."""
    return bool(text.strip()) and bool(_readings(text))


def is_symbol(word: str) -> bool:
    """Tell whether `word` is one symbol, with its prefix or without, such as mA or rpm."""
    return bool(word and _symbol(word))


def _near(one: Sequence[float], other: Sequence[float]) -> bool:
    return all(abs(a - b) < 1e-9 for a, b in zip(one, other, strict=True))


def _spins(goal: Unit) -> bool:
    """Tell whether a turning speed or a torque, which is a joule per radian, is part of a unit."""
    return goal.angle != 0.0 or any(_near(goal.basis, basis) for basis in _TORQUES)


def _angles_fit(one: Unit, goal: Unit) -> bool:
    """Tell whether an angle that `one` names has a place in `goal`; a radian may be left out, but not alone."""
    if not one.angle:
        return not goal.angle or any(goal.basis)
    if goal.turns:
        return one.angle == goal.turns
    return one.angle == goal.angle or (not goal.angle and _spins(goal) and one.angle < 0.0)


@lru_cache(4096)
def _readings(text: str) -> tuple[Unit, ...]:
    """Return every way to read a unit, the usual one first; none where there is no way."""
    plain = _spelled(text)
    tokens: list[_Token] = []
    at = 0
    while at < len(plain):
        found = _TOKEN.match(plain, at)
        if found is None or len(plain) > _LONGEST:
            return ()
        tokens.append((found.group().strip(), found.group() == found.group().lstrip()))
        at = found.end()
    return _quotients(tokens)


def _spelled(text: str) -> str:
    """Return a unit in plain signs: one for a product, one for minus, powers without superscripts, 1e-6 for 10^-6."""
    plain = re.sub(rf"\^?([{_HIGH}]+)", r"^\1", joined_groups(text).replace("**", "^"))
    for _ in range(2):  # some signs come out of the normal form, some would not survive it
        for sign, ours in _SIGNS.items():
            plain = plain.replace(sign, ours)
        plain = unicodedata.normalize("NFKC", plain)
    plain = re.sub(r"(?i)\br\.p\.m\.?", "rpm", without_marks(plain)).replace(" per ", "/")
    plain = re.sub(r"(?<![^\W\d_])k\s?min\s*\^?\(?-1\)?", "krpm", plain)  # a thousand a minute, no kilominute
    plain = re.sub(r"(?<![^\W\d_])(k?)(?:r|U|t)(?=/(?:min|s))", r"\1rev", plain)
    plain = re.sub(
        r"(?:(?<![\w.])[xX]\s*|\*\s*|(?<![\w.]))10(?:\^\(?(?=\d)|\^?\(?(?=[-+]))([-+]?\d+)\)?", r"*1e\1 ", plain
    )
    plain = re.sub(r"(?<=[^\W_])\.(?=[^\W\d_])", "*", plain)
    return re.sub(r"(?<=[^\W\d_])\.", "", plain).replace("sqrt", "\u221a").strip()


def _quotients(tokens: Sequence[_Token]) -> tuple[Unit, ...]:
    """Read tokens with their solidi: rpm/oz-in is rpm/(oz-in), but V*s/rad*A and V/rad/s are printed as well."""
    parts: list[list[tuple[Unit, ...]]] = []
    for part in _parts(tokens):
        factors = _factors(part)
        if factors is None or (not factors and parts):
            return ()
        parts.append(factors)
    all_below = [[1] * len(part) if k == 0 else [-1] * len(part) for k, part in enumerate(parts)]
    in_turn = [[1] * len(part) if k == 0 else [-1] + [1] * (len(part) - 1) for k, part in enumerate(parts)]
    nested = [[(-1) ** k] * len(part) for k, part in enumerate(parts)]
    ways: dict[Unit, None] = {}
    for signs in (all_below, in_turn, nested):
        made = [Unit()]
        for group, powers in zip(parts, signs, strict=True):
            for choices, power in zip(group, powers, strict=True):
                made = [one.times(other, power) for one in made for other in choices][:_MOST_WAYS]
        ways |= dict.fromkeys(made)
    return tuple(ways)


def _parts(tokens: Sequence[_Token]) -> Iterator[Sequence[_Token]]:
    """Cut tokens at each solidus outside of brackets."""
    depth, first = 0, 0
    for k, (token, _) in enumerate(tokens):
        depth += (token == "(") - (token == ")")
        if token == "/" and depth == 0:
            yield tokens[first:k]
            first = k + 1
    yield tokens[first:]


def _factors(tokens: Sequence[_Token]) -> list[tuple[Unit, ...]] | None:
    """Read a product: the ways to read each factor, None where there is none."""
    found: list[tuple[Unit, ...]] = []
    k, root = 0, 1.0
    while k < len(tokens):
        token = tokens[k][0]
        if token in "*-\u221a":
            root = 0.5 if token == "\u221a" else root
            k += 1
            continue
        end = _closing(tokens, k) + 1 if token == "(" else k + 1
        power, after = _power(tokens, end, token)
        if token == "(":
            ways = tuple(Unit().times(one, root * power) for one in _quotients(tokens[k + 1 : end - 1]))
        elif token[0].isdigit():
            scale = math.log10(float(token) or math.nan)
            ways = (Unit(float(token) ** (root * power)),) if scale.is_integer() else ()
        else:
            ways = tuple(_word(token, root * power, _MOST_SYMBOLS))
        if not ways:
            return None
        found.append(ways)
        k, root = after, 1.0
    return found


def _closing(tokens: Sequence[_Token], first: int) -> int:
    """Return where the bracket that opens at `first` closes; a bracket that is left open closes at the end."""
    depth = 0
    for k in range(first, len(tokens)):
        depth += (tokens[k][0] == "(") - (tokens[k][0] == ")")
        if depth == 0:
            return k
    return len(tokens)


def _power(tokens: Sequence[_Token], k: int, base: str) -> tuple[float, int]:
    """Return the power that stands at `k`, and what comes after it: ^-1, -1 or 2 that touch their symbol, ^(1/2)."""
    text = "".join(token for token, _ in tokens[k : k + 6])
    marked = re.match(r"\^\(?(-?\d+(?:\.\d+)?)(?:/(\d))?\)?" if text[:2] == "^(" else r"\^(-?\d+(?:\.\d+)?)()", text)
    touching = re.match(r"(-?[1-4])()(?![\d.e])", text) if k < len(tokens) and tokens[k][1] else None
    found = marked or (None if base[0].isdigit() else touching)
    if found is None:
        return 1.0, k
    length = 0
    while length < found.end():
        length += len(tokens[k][0])
        k += 1
    return float(found.group(1)) / float(found.group(2) or 1), k


def _word(word: str, power: float, symbols: int) -> Iterator[Unit]:
    """Yield every way to read a word: one symbol, or symbols run together, of which the last has the power."""
    whole = _symbol(word)
    yield from (one if power == 1.0 else Unit().times(one, power) for one in whole)
    if symbols == 1 or (whole and symbols == _MOST_SYMBOLS):  # mN is no m*N, but Nms is N*ms or N*m*s
        return
    for cut in range(1, len(word)):
        for one in _symbol(word[:cut]):
            for rest in _word(word[cut:], power, symbols - 1):
                yield Unit().times(one, 1.0).times(rest, 1.0)


@lru_cache(4096)
def _symbol(word: str) -> tuple[Unit, ...]:
    """Return what one symbol may mean, with its prefix; nothing where it is unknown."""
    name = _name(word)
    if name:
        return tuple(_unit(each) for each in (name, *_MEANT_TOO.get(name, ())))
    spelled = next((spelled for spelled in _SPELLED_OUT if word.lower().startswith(spelled)), "")
    prefix, rest = _SPELLED_OUT.get(spelled, word[0]), word[len(spelled or word[0]) :]
    prefixed = _name(rest) if prefix in _PREFIXES else ""
    if prefixed in _PREFIXED:
        size = Unit(_PREFIXES[prefix])
        return tuple(size.times(_unit(each), 1.0) for each in (prefixed, *_MEANT_TOO.get(prefixed, ())[:2]))
    return ()


def _name(word: str) -> str:
    """Return a symbol as our tables have it; words of two letters or more are met in capitals, too."""
    if word in _PREFIXED or word in _PLAIN:
        return word
    lowered = word.lower()
    if lowered in _ALSO:
        return _ALSO[lowered]
    return _CAPITALS.get(lowered, "") if len(word) > 1 else ""


def _unit(name: str) -> Unit:
    factor, basis, angle, turns = _PREFIXED[name] if name in _PREFIXED else _PLAIN[name]
    return Unit(factor, tuple(map(float, basis)), float(angle), float(turns), _ZERO.get(name, 0.0))


def _stranger(unit: str) -> str:
    """Return the first word of a unit that cannot be read, else the whole."""
    words = re.findall(r"[^\W\d_]+", _spelled(unit))
    return next((word for word in words if not list(_word(word, 1.0, _MOST_SYMBOLS))), unit)


_SHOUTED = "min Hz rpm rps rad rev deg hp lb oz lbf ozf in ft slug psi bar mph kph lpm gpm cfm atm torr cc"
_CAPITALS = {name.lower(): name for name in _SHOUTED.split()}
