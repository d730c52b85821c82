"""Draw projects that are nearly right: an example of the manual with some of its values, keys and lines odd."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

ROOT = Path(__file__).parents[2]
PAGES = ("controllers", "plants", "effects")
ARITHMETIC = '\n[arithmetic]\nnumber = "fixed"\nbits = 32\n'
TOKEN = re.compile(r'"[^"\n]*"|(?<![\w.])-?\d[\w.+-]*|\b(?:true|false)\b')
QUANTITY = re.compile(r'"-?\d[\d.eE+-]* ([^"]+)"')
NUMBERS = (
    *("0", "-0.0", "1", "-1", "2", "3", "1e39", "1.7e308", "5e-324", "1e-300", "-1e30", "1e30", "1e-30", "-1e-30"),
    *("1e12", "1e-12", "1e9", "-1e9", "1e6", "1e-6", "nan", "inf", "-inf", "9007199254740992", "2147483647", "65536"),
    *("-2147483648", "9223372036854775807", "18446744073709551616", "1000000", "0.1", "1e-15", "1e15", "255", "1e400"),
)
OTHERS = (
    *('""', '"x"', '"a.csv"', '"/"', '"."', '"\\u2028"', '"\\u001b[2J"', '"NaN"', "true", "false", "[]", "{}", "[[]]"),
    *("[1.0]", "[1, 2, 3]", "[nan]", "[inf]", "[1e300, 1e-300]", "1979-05-27", f'"{"n" * 300}"', f'"{"long" * 2000}"'),
)


@cache
def examples() -> tuple[str, ...]:
    """Every whole project of the reference pages and of the examples' folder."""
    pages = [(ROOT / "docs" / "reference" / f"{page}.md").read_text() for page in PAGES]
    blocks = [block for page in pages for block in re.findall(r"```toml\n(.*?)```", page, re.DOTALL)]
    own = [f'schema = 1\nname = "x"\n\n{block}{ARITHMETIC}' for block in blocks if "[controller]" in block]
    return (*own, *(path.read_text() for path in sorted((ROOT / "examples").glob("*/*.toml"))))


def odd(draw: st.DrawFn, text: str, counts: tuple[int, ...]) -> str:
    """Put odd values into a project; a number in front of a unit, as a data sheet prints it, is a number, too."""
    for _ in range(draw(st.sampled_from(counts))):
        place = draw(st.sampled_from(list(TOKEN.finditer(text))))
        quantity = QUANTITY.fullmatch(place.group())
        number = quantity is not None or not place.group().startswith('"')
        value = draw(
            st.sampled_from(NUMBERS) if number and draw(st.integers(0, 4)) else st.sampled_from(OTHERS + NUMBERS)
        )
        if quantity is not None and value in NUMBERS:
            value = f'"{value} {quantity[1]}"'
        text = text[: place.start()] + value + text[place.end() :]
    return text


@st.composite
def odd_projects(draw: st.DrawFn) -> str:
    """Draw one example with one to three odd values, and sometimes a line lost or said twice."""
    text = odd(draw, draw(st.sampled_from(examples())), (1, 1, 2, 3))
    lines = text.splitlines()
    change = draw(st.integers(0, 11))
    at = draw(st.integers(0, len(lines) - 1))
    if change == 0:
        del lines[at]
    elif change == 1:
        lines.insert(at, draw(st.sampled_from(lines)))
    return "\n".join(lines) + "\n"
