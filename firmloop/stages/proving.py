"""Judge a delivered proof.json, and hold the C beside it against what it claims."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from firmloop.codegen.emit import with_included
from firmloop.codegen.environment import text_of
from firmloop.identify.regular_file import read_text
from firmloop.project.table import ProjectError
from firmloop.verify.judgement import PROVEN, REFUTED, Judgement
from firmloop.verify.proofs.c_checker import check_header, check_source, support_files
from firmloop.verify.proofs.claims import Claims, ProofError
from firmloop.verify.proofs.judge import Delivered, Judge
from firmloop.verify.proofs.judges import every_judge
from firmloop.verify.proofs.reading import read_claims

CERTIFICATE = "loop.json"  # beside proof.json
MOST_BYTES = 64 * 2**20  # of a file; a generated controller has a thousandth of it
RANGES, COMPARED = ("intervals", "z3"), "compared with the proof, word by word"
Judged = list[tuple[str, str]]  # claim, and who judged it
NOT_JUDGED = (
    "the rounding bounds and the search for limit cycles in proof.json: `firmloop verify` measures them",
    "the program id by itself: that proof.json, header and manifest.json name the same one is compared",
    "what explains: units, fractions, margins, arguments in words, comments; the test, the vectors, the build files",
)


def _say_claims(claims: Claims, who: str, judged: Judged) -> None:
    """Say what the judges of the ranges have proven."""
    if claims.fixed:
        judged.append((f"{len(claims.operations)} operations: ranges, words, constants, shift counts", who))
        judged.append((f"{len(claims.state) + len(claims.outputs)} stores: within the ranges of state and output", who))
        judged.append((f"{len(claims.state)} state words that hold anything: nothing overflows, all is in range", who))
        judged += [(f"table {one['name']}: every sum of its search fits", "intervals alone") for one in claims.tables]
    else:
        judged.append(
            (f"{len(claims.operations)} operations: nothing is claimed of words in floating point", "no judge")
        )
    judged.append((f"{len(claims.state)} first values: within the range of their state", who))
    if claims.parameters:
        names = ", ".join(name for name, *_ in claims.parameters)
        judged.append((f"setters of {names}: within the range of their state, kept by a step", who))


def _judge_c(claims: Claims, folder: Path, judged: Judged) -> None:
    """Compare the files beside the proof with it, and the support files with those of this firmloop."""
    sources = folder / claims.name / "src"
    for name, check in ((f"{claims.name}.h", check_header), (f"{claims.name}.c", check_source)):
        count = check(claims, _text(sources / name))
        judged.append((f"{name}: {count} statements, no others", COMPARED))
    try:
        supports = with_included(support_files(claims))
    except FileNotFoundError as error:
        raise ProofError(f"{Path(str(error.filename)).name} is no file that this firmloop generates") from None
    for name in supports:
        if _text(sources / name) != text_of(f"support/{name}"):
            raise ProofError(
                f"{name} is not the file that this firmloop generates: its functions are not those proven of"
            )
        judged.append(
            (f"{name}: its functions and loops", "the bytes of this firmloop's own file; not derived from the proof")
        )
    manifest = folder / "manifest.json"
    if manifest.exists():
        told = _document(manifest).get("program_id")
        if told != claims.program_id:
            raise ProofError(
                f"manifest.json names program {told}, proof.json {claims.program_id}: one of them is stale"
            )
        judged.append(("manifest.json: the same program id", "compared"))


def _document(path: Path) -> Mapping[str, Any]:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) != len(pairs):
            raise ValueError("a key stands twice in one place")
        return found

    def refuse(word: str) -> float:
        raise ValueError(f"{word} is no number of JSON")

    try:
        found = json.loads(_text(path), object_pairs_hook=once, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise ProjectError(f"{path}: is no JSON document ({str(error)[:100]}); generate it again") from None
    if not isinstance(found, dict):
        raise ProjectError(f"{path}: holds no claims; generate it again")
    return found


def _check_links(folder: Path, paths: Iterable[Path]) -> None:
    """Refuse a link that leads out of a delivery: what is proven would not be what was delivered."""
    for path in paths:
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
            raise ProjectError(f"{path}: is a link out of the folder; put the file itself there")


def _text(path: Path) -> str:
    if not path.is_file():
        raise ProjectError(f"{path}: no such file; give the folder that `firmloop generate` wrote")
    if path.stat().st_size > MOST_BYTES:
        raise ProjectError(f"{path}: has {path.stat().st_size} bytes, no generated file has more than {MOST_BYTES}")
    try:
        return read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        raise ProjectError(f"{path}: cannot be read ({error})") from None


@dataclass(frozen=True, slots=True)
class Proving:
    """What was judged and by whom, what each judge said, and what was refuted; empty where nothing was.

    `absent` are judges that nobody named and that are not installed.
    """

    claims: Claims
    judged: Judged
    judgements: tuple[Judgement, ...]
    absent: tuple[Judgement, ...]
    refuted: str

    @property
    def undecided(self) -> tuple[Judgement, ...]:
        """What was asked and not decided."""
        return tuple(one for one in self.judgements if one.result not in (PROVEN, REFUTED))


def chosen(names: Sequence[str]) -> tuple[Judge, ...]:
    """Return the judges of these names.

    Raises
    ------
    ProjectError
        when there is no judge of a name.
    """
    known = every_judge()
    for name in names:
        if name not in known:
            raise ProjectError(f"judge {name[:40]!r} is unknown; known: {', '.join(known)}")
    return tuple(known[name] for name in dict.fromkeys(names))


def judged(named: Sequence[Judge], what: str) -> bool:
    """Tell whether a judge of IMAGES or of a LOOP is asked: one of `named`, or without names one that is installed."""
    asked = named or [judge for judge in every_judge().values() if judge.version() is not None]
    return any(judge.of == what for judge in asked)


def prove(folder: Path, named: Sequence[Judge]) -> Proving:
    """Prove FOLDER/proof.json again, and that the C in FOLDER states what it proves.

    Without names, all judges are asked that are installed and have something to say.

    Raises
    ------
    ProjectError
        when there is no such proof.
    """
    _check_links(folder, (folder / "proof.json",))
    document = _document(folder / "proof.json")
    try:
        claims = read_claims(document)
    except ProofError as error:
        raise ProjectError(f"{folder / 'proof.json'}: {error}") from None
    loop, parts = folder / CERTIFICATE, folder / claims.name
    _check_links(folder, (loop, folder / "manifest.json", parts, *parts.rglob("*")))
    delivered = Delivered(claims, parts / "src", _document(loop) if loop.exists() else None)
    rest = [judge for judge in every_judge().values() if not (named or judge.asked(delivered))]
    judgements = tuple(judge.judge(delivered) for judge in named or every_judge().values() if judge not in rest)
    absent = tuple(judge.judge(delivered) for judge in rest if judge.version() is None)
    judged: Judged = []
    ranged = [one for one in judgements if one.result == PROVEN and one.judge in RANGES]
    if ranged:
        _say_claims(claims, "; ".join(f"{one.judge} {one.version}" for one in ranged), judged)
    refuted = [one.says for one in judgements if one.result == REFUTED]
    try:
        if not refuted:
            _judge_c(claims, folder, judged)
    except ProofError as error:
        refuted.append(str(error))
    return Proving(claims, judged, judgements, absent, refuted[0] if refuted else "")
