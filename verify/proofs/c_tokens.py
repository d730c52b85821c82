"""Take C apart into tokens in which two texts that say the same are the same: layout gone, numbers read."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from firmloop.verify.proofs.claims import ProofError

COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
TOKEN = re.compile(
    r'(?P<space>[ \t]+)|(?P<end>\n)|(?P<text>"[^"\n\\]*")|(?P<name>[A-Za-z_]\w*)'
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[A-Za-z]*)|(?P<mark>->|<<|>>|<=|>=|==|!=|&&|\|\||[^\sA-Za-z0-9_\"\\])",
    re.ASCII,
)
NUMBER = re.compile(r"([0-9.]+(?:[eE][+-]?\d+)?)([A-Za-z]*)")
OPENS = ("(", "{", ",", "[", "=")


@dataclass(frozen=True, slots=True)
class Token:
    """`value` is the text, or of a number its type and exact value; `says` is what stands there, in line `line`."""

    value: str
    line: int
    says: str = field(compare=False)


def tokens(text: str, name: str) -> list[Token]:
    """Return the tokens of a C file; the end of a line counts behind a line that starts with #.

    Raises
    ------
    ProofError
        where the text holds what no generated C holds.
    """
    if "\\\n" in text or "??/" in text:  # joins two lines before the compiler sees a comment
        raise ProofError(f"{name}: a line that goes on behind a backslash; generated C has none")
    plain = COMMENT.sub(lambda m: " " + "\n" * m[0].count("\n"), text)
    found: list[Token] = []
    line, place, directive = 1, 0, False
    while place < len(plain):
        match = TOKEN.match(plain, place)
        if match is None:
            raise ProofError(f"{name}, line {line}: {plain[place]!r} stands in no generated C")
        place, kind, said = match.end(), match.lastgroup, match[0]
        if kind == "end":
            if directive:
                found.append(Token("\n", line, ""))
            line, directive = line + 1, False
        elif kind != "space":
            directive = directive or said == "#"
            found.append(Token(_read(said) if kind == "number" else said, line, said))
    return _signed(found)


def _read(text: str) -> str:
    """Return a number by its type and value: `i 5`, `u 30`, `f` and `d` with the bits of what the compiler stores."""
    match = NUMBER.fullmatch(text)
    try:
        digits, suffix = (match[1], match[2]) if match else (text, "?")
        if suffix in ("", "U") and digits.isdigit() and (digits == "0" or digits[0] != "0"):
            return f"{'u' if suffix else 'i'} {int(digits)}"
        if suffix in ("", "F"):
            value = float(digits)
            return f"f {struct.pack('>f', value).hex()}" if suffix else f"d {struct.pack('>d', value).hex()}"
    except (ValueError, OverflowError):
        pass
    return f"? {text}"


def _signed(found: Sequence[Token]) -> list[Token]:
    """Join a minus with the number behind it, with or without parentheses; -2147483647 - 1 is one number."""
    joined: list[Token] = []
    k = 0
    while k < len(found):
        values = [token.value for token in found[k : k + 6]]
        before = joined[-1].value if joined else ""
        if before in OPENS and values[0] == "-" and values[1:2] == ["i 2147483647"] and values[2:4] == ["-", "i 1"]:
            joined.append(Token("i -2147483648", found[k].line, "-2147483648"))
            k += 4
        elif before in OPENS and values[0] == "-" and len(values) > 1 and _is_number(values[1]):
            joined.append(Token(_negative(values[1]), found[k].line, f"-{found[k + 1].says}"))
            k += 2
        else:
            joined.append(found[k])
            k += 1
        if (
            len(joined) > 2
            and joined[-1].value == ")"
            and joined[-3].value == "("
            and _is_number(joined[-2].value)
            and not (len(joined) > 3 and re.fullmatch(r"[A-Za-z_]\w*", joined[-4].value))
        ):
            joined[-3:] = [joined[-2]]  # (-5), unless it is what a function is called with
    return joined


def _is_number(value: str) -> bool:
    return value[:2] in ("i ", "f ", "d ")


def _negative(value: str) -> str:
    kind, digits = value.split()
    if kind == "i":
        return f"i {-int(digits)}"
    form = ">f" if kind == "f" else ">d"
    return f"{kind} {struct.pack(form, -struct.unpack(form, bytes.fromhex(digits))[0]).hex()}"
