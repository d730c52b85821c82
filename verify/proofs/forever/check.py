"""Check every bound of a certificate: what it leaves out, or states too small, is refused by name.

By induction over the samples: while plant states and inputs have kept their bounds, what the plant's intervals add is
bounded; then so is the next sample; and while no limit is reached the program is the sum that was followed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from firmloop.verify.proofs.claims import Claims, ProofError
from firmloop.verify.proofs.forever.ring import REFERENCE, Ring, close
from firmloop.verify.proofs.forever.sampled import SampledPlants, sample
from firmloop.verify.proofs.forever.stated import Box, Matrix, ShownPart, Stated
from firmloop.verify.proofs.forever.sums import check_lyapunov, gains


@dataclass(frozen=True, slots=True)
class Reaches:
    """How far one line of the loop moves: by itself, for each unit of the reference, and of each bound of a level."""

    known: Fraction
    by_reference: Fraction
    by_level: Sequence[Fraction]

    def at(self, reach: Fraction, levels: Sequence[Fraction]) -> Fraction:
        """Return the bound."""
        return (
            self.known
            + self.by_reference * reach
            + sum((a * b for a, b in zip(self.by_level, levels, strict=True)), Fraction(0))
        )


@dataclass(frozen=True, slots=True)
class Followed:
    """The loop, and what was found of its levels, its error and the limits of the program."""

    ring: Ring
    levels: Sequence[Reaches]
    error: Reaches
    limits: Sequence[Reaches]


def plant_of_part(claims: Claims, stated: Stated, box: Box, modes: Matrix) -> SampledPlants:
    """Enclose the plants of a box at the period of the program."""
    try:
        return sample(stated.equations, box, Fraction(repr(claims.period)), modes)
    except OverflowError as error:
        raise ProofError(f"loop.json: {error}") from None


def follow(ring: Ring, lyapunov: Matrix, rate: Fraction, steps: int) -> Followed:
    """Bound every line of a loop."""
    lines = [*ring.levels, ring.error, *(limit.line for limit in ring.limits)]
    names = [name for name in ring.columns if _acts(ring, name)]
    found = gains(ring, lines, names, lyapunov, rate, steps)
    count = len(ring.levels)
    reaches = [_reaches(ring, gain, count) for gain in found.of]
    return Followed(ring, reaches[:count], reaches[count], reaches[count + 1 :])


def _acts(ring: Ring, name: str) -> bool:
    row, top = ring.by_levels.get(name, ((), Fraction(0)))
    return name == REFERENCE or bool(ring.fixed.get(name, top)) or any(row)


def _reaches(ring: Ring, gain: Mapping[str, Fraction], levels: int) -> Reaches:
    known, by_level = Fraction(0), [Fraction(0)] * levels
    for name, value in gain.items():
        if name in ring.by_levels:
            row, top = ring.by_levels[name]
            known += value * top
            by_level = [entry + value * factor for entry, factor in zip(by_level, row, strict=True)]
        elif name != REFERENCE:
            known += value * ring.fixed[name]
    return Reaches(known, gain.get(REFERENCE, Fraction(0)), by_level)


def check(claims: Claims, stated: Stated) -> None:
    """Check it.

    Raises
    ------
    ProofError
        at the first thing that does not hold.
    """
    if stated.program_id != claims.program_id:
        raise ProofError(
            f"loop.json is of program {stated.program_id}, proof.json of {claims.program_id}: one of them is stale"
        )
    if not claims.fixed:
        raise ProofError("loop.json is of a program in fixed point, and proof.json is not")
    for part in stated.parts:
        _check_part(claims, stated, part)


def _check_part(claims: Claims, stated: Stated, part: ShownPart) -> None:
    ring = close(claims, stated, part.rest, plant_of_part(claims, stated, part.box, part.modes))
    check_lyapunov(ring.matrix, part.lyapunov, part.rate)
    found = follow(ring, part.lyapunov, part.rate, part.steps)
    for k, (reaches, rest, level) in enumerate(zip(found.levels, ring.at_rest, part.levels, strict=True)):
        needed = rest + reaches.at(stated.reach, part.levels)
        if needed > level:
            what = f"plant state {k}" if k < len(stated.equations.entries["a"]) else "a plant input"
            raise ProofError(
                f"{what} is stated to stay within {float(level):.6g}; it is bounded by {float(needed):.6g}"
            )
    error = ring.error_at_rest + found.error.at(stated.reach, part.levels)
    if error > stated.error:
        raise ProofError(f"|error| is stated to stay within {float(stated.error):.6g}; bounded by {float(error):.6g}")
    for limit, reaches in zip(ring.limits, found.limits, strict=True):
        moved = reaches.at(stated.reach, part.levels)
        if moved > limit.margin or (limit.strict and moved == limit.margin):
            raise ProofError(
                f"{limit.says}: moves by up to {float(moved):.6g}, and another line holds from "
                f"{float(limit.margin):.6g}"
            )
