"""Compare what a step costs with an older verdict: a continuous-integration gate that needs no hardware."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.pipeline import Outcome
from firmloop.table import ProjectError

FIGURES = (
    "instructions_max",
    "instructions_mean",
    "cycles_max",
    "text_bytes",
    "data_bytes",
    "bss_bytes",
    "stack_bytes",
)


@dataclass(frozen=True, slots=True)
class Growth:
    """One figure, before and now; None where it was not measured."""

    figure: str
    before: float
    now: float
    allowed: float  # %

    @property
    def too_much(self) -> bool:
        """Whether it grew by more than is allowed."""
        return self.now > self.before * (1.0 + self.allowed / 100.0)

    def says(self) -> str:
        """Return the line that tells it."""
        change = 100.0 * (self.now / self.before - 1.0) if self.before else float(self.now > 0) * 100.0
        mark = f"  MORE THAN {self.allowed:g} % ALLOWED" if self.too_much else ""
        return f"{self.before:g} -> {self.now:g} ({change:+.1f} %){mark}"


def growths(baseline: Path, allowed: float, outcomes: Sequence[Outcome]) -> tuple[Growth, ...]:
    """Return every figure that both the old verdict and the new one of the same target have.

    Raises
    ------
    ProjectError
        when the file is no verdict, or of a target that was not run now.
    """
    old = _read(baseline)
    verdicts = [outcome.verdict for outcome in outcomes if outcome.verdict]
    matching = [verdict for verdict in verdicts if verdict.target == old["target"]]
    if not matching:
        ran = ", ".join(verdict.target for verdict in verdicts)
        raise ProjectError(f"--baseline {baseline}: is of target {old['target']}, but what ran is {ran}")
    new, before = matching[0].as_dict()["cost"], old["cost"]
    assert isinstance(new, Mapping) and isinstance(before, Mapping)
    pairs = [(figure, before.get(figure), new.get(figure)) for figure in FIGURES]
    return tuple(
        Growth(figure, was, now, allowed)
        for figure, was, now in pairs
        if isinstance(was, int | float) and isinstance(now, int | float)
    )


def check_baseline(baseline: Path, targets: Sequence[str]) -> None:
    """Say what is wrong with an older verdict before anything is run for it.

    Raises
    ------
    ProjectError
        when the file is no verdict, or of none of `targets`, which are names or paths of TOML files.
    """
    old = _read(baseline)["target"]
    asked = [Path(name).name.removesuffix(".toml") for name in targets]
    if old not in asked:
        raise ProjectError(
            f"--baseline {baseline}: is of target {old}, but what is to run is {', '.join(asked)}: "
            "take the verdict of one of these, or give --target"
        )


def _read(path: Path) -> Mapping[str, object]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise ProjectError(f"--baseline {path}: cannot be read: {error}") from None
    if not isinstance(document, dict) or not isinstance(document.get("cost"), dict) or "target" not in document:
        raise ProjectError(f"--baseline {path}: is no verdict.json of an earlier run")
    return document
