"""Hold generated C against the claims of its proof.json: the same statements, in the same order, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable

from firmloop.verify.proofs.c_tokens import Token, tokens
from firmloop.verify.proofs.claims import Claims, ProofError
from firmloop.verify.proofs.stated_c import Statement, Writer

SHOWN = 12  # tokens of what the file says instead


def check_source(claims: Claims, text: str) -> int:
    """Return how many statements of the .c file are those of the proof.

    Raises
    ------
    ProofError
        at the first that is not.
    """
    return _compare(f"{claims.name}.c", Writer(claims).source(), text)


def check_header(claims: Claims, text: str) -> int:
    """Return how many statements of the .h file are those of the proof.

    Raises
    ------
    ProofError
        at the first that is not.
    """
    return _compare(f"{claims.name}.h", Writer(claims).header(), text)


def support_files(claims: Claims) -> tuple[str, ...]:
    """Return the names of the files that the .c file includes besides its own header."""
    return (*Writer(claims).supports, *(str(table["support"]) for table in claims.tables))


def _compare(name: str, statements: Iterable[Statement], text: str) -> int:
    found, place, count = tokens(text, name), 0, 0
    for what, stated in statements:
        wanted = tokens(f"= {stated}", what)[1:]  # as behind a statement: a sign in front belongs to a number
        there = found[place : place + len(wanted)]
        if [token.value for token in there] != [token.value for token in wanted]:
            line = there[0].line if there else "its end"
            raise ProofError(f"{name}, line {line}: {what}: the proof says `{_text(wanted)}`, the C `{_text(there)}`")
        place, count = place + len(wanted), count + 1
    if place < len(found):
        raise ProofError(f"{name}, line {found[place].line}: `{_text(found[place:])}` is in no claim of the proof")
    return count


def _text(part: list[Token]) -> str:
    text = " ".join(token.says for token in part[:SHOWN] if token.says)
    return f"{text} ..." if len(part) > SHOWN else text
