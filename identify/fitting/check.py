"""A Check: one question to a fit and its recordings, and the sentences of its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from firmloop.identify.fitting.evidence import Evidence


@dataclass(frozen=True, slots=True)
class Remark:
    """What a check found; `says` is one sentence that ends with the way out."""

    check: str
    says: str


@dataclass(frozen=True, slots=True)
class Check:
    """`look` returns a sentence for each thing found, none where all is sound.

    `silences` names the checks that are not asked where this one has found something: they would see its consequences.
    So do those that `silenced_by` names to this one, which knows what its finding may follow from.
    `refuses` names the verbs that cannot go on beside it: what is found is of the log, whatever the plant.
    """

    name: str
    look: Callable[[Evidence], tuple[str, ...]]
    silences: tuple[str, ...]
    needs_fit: bool
    refuses: tuple[str, ...] = ()
    silenced_by: tuple[str, ...] = ()
