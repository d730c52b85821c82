"""A Judge: a program that proves a claim on a delivered controller, or refutes it, and imports nothing it judges."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, Judgement
from firmloop.verify.proofs.claims import Claims, ProofError

IMAGES = "images"  # the folder of linked images, beside proof.json
PROGRAM, LOOP = "program", "loop"  # what a judge may judge besides images
RANGES = "every operation, store and first value keeps its range and word, from every state a word can hold"


@dataclass(frozen=True, slots=True)
class Delivered:
    """What is judged: the claims of proof.json, the folder of the C beside it, and loop.json; None where it is not."""

    claims: Claims
    folder: Path | None
    loop: Mapping[str, Any] | None = None

    @property
    def images(self) -> tuple[Path, ...]:
        """The linked images beside the C, by the names of their targets."""
        return () if self.folder is None else tuple(sorted((self.folder.parents[1] / IMAGES).glob("*.elf")))


@dataclass(frozen=True, slots=True)
class Judge:
    """One judge. `version` is None where it is not installed; `run` gives the result, and words on it."""

    name: str
    claim: str
    install: str
    own: bool  # comes with firmloop or what it depends on, so that it is always asked
    floats: bool  # has something to say of floating point
    version: Callable[[], str | None]
    run: Callable[[Delivered], tuple[str, str]]
    of: str = PROGRAM  # or IMAGES, or LOOP: judges these, and nothing else

    def asked(self, delivered: Delivered) -> bool:
        """Tell whether it is asked of what is delivered where nobody names judges."""
        there = {PROGRAM: True, IMAGES: bool(delivered.images), LOOP: delivered.loop is not None}[self.of]
        return there and (self.floats or delivered.claims.fixed) and (self.own or self.version() is not None)

    def judge(self, delivered: Delivered) -> Judgement:
        """Judge the claim, if the judge is there."""
        version = self.version()
        if version is None:
            says = f"{self.name} is not installed; install it with: {self.install}"
            return Judgement(self.claim, self.name, "", NOT_RUN, 0.0, says)
        if not (self.floats or delivered.claims.fixed):
            return Judgement(self.claim, self.name, version, NOT_RUN, 0.0, "it judges fixed point alone")
        start = time.perf_counter()
        result, says = self.run(delivered)
        return Judgement(self.claim, self.name, version, result, time.perf_counter() - start, says)


def result_of(check: Callable[[Claims], None], delivered: Delivered) -> tuple[str, str]:
    """Return what a check says that raises ProofError at the first claim that does not hold."""
    try:
        check(delivered.claims)
    except ProofError as error:
        return REFUTED, str(error)
    return PROVEN, ""
