"""Decide which names may become C identifiers; nothing else of a user's text reaches the C as code."""

from __future__ import annotations

import re

from firmloop.codegen.bundle import CodegenError

LONGEST = 31  # significant initial characters of an external identifier, C99 5.2.4.1

# C99 and C11 keywords, those C++ adds, and what <stdint.h>, <stdbool.h> and the generated functions occupy.
RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while asm
    alignas alignof and and_eq atomic bitand bitor bool catch class compl concept consteval constexpr constinit
    const_cast co_await co_return co_yield decltype delete dynamic_cast explicit export false friend mutable namespace
    new noexcept not not_eq nullptr operator or or_eq private protected public reinterpret_cast requires static_assert
    static_cast template this thread_local throw true try typeid typename typeof using virtual wchar_t xor xor_eq
    int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t intptr_t uintptr_t intmax_t uintmax_t
    self in out init step main errno assert near far interrupt linux unix
    """.split()
)


def check_identifier(name: str, what: str) -> str:
    """Return `name` if it may stand in C as it is.

    Raises
    ------
    CodegenError
        when it is not letters, digits and single underscores starting with a lower case letter, is longer than 31
        characters, or is taken by C, C++ or the generated code. `what` says what the name names: capitals may stand in
        that of a signal, behind an underscore, for units have them (current_A).
    """
    capitals = "A-Z" if what == "signal" else ""
    if not re.fullmatch(rf"[a-z][a-z0-9]*(_[a-z0-9{capitals}]+)*", name, flags=re.ASCII):
        ends = "or a unit behind an underscore, such as 'current_A'" if capitals else "such as 'wheel_speed'"
        raise CodegenError(
            f"{what} {name!r} cannot be a C name: use lower case letters, digits and single underscores, "
            f"starting with a letter, {ends}"
        )
    if len(name) > LONGEST:
        raise CodegenError(f"{what} {name!r} has {len(name)} characters; C guarantees {LONGEST}: choose a shorter one")
    if name in RESERVED or name.startswith(("fl_", "uint", "int_")):
        raise CodegenError(f"{what} {name!r} is taken by C, C++ or the generated code: choose another name")
    return name
