"""Compare what a step costs with an older run: a continuous-integration gate that needs no hardware."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from firmloop.identify.regular_file import read_text
from firmloop.project.table import ProjectError
from firmloop.stages.verification import Outcome

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
    """Return every figure that both the old file and the new verdict of the same target have.

    The file is a verdict.json, or a cost.json, which has every target and every function.

    Raises
    ------
    ProjectError
        when the file is neither, or of targets that were not run now.
    """
    old = _read(baseline)
    new = cost_document(outcomes)["targets"]
    assert isinstance(new, Mapping)
    both = [name for name in new if name in old]
    if not both:
        raise ProjectError(f"--baseline {baseline}: is of target {', '.join(old)}, but what ran is {', '.join(new)}")
    found = []
    for name in both:
        before, now = _figures(old[name]), _figures(new[name])
        mark = f"{name}: " if len(both) > 1 else ""
        found += [Growth(mark + key, before[key], now[key], allowed) for key in before if key in now]
    return tuple(found)


def _figures(target: object) -> Mapping[str, float]:
    """Return the figures of one target that were measured: of the whole step, then of each function."""
    assert isinstance(target, Mapping)
    cost, functions = target["cost"], target.get("functions")
    parts = [("", cost)]
    if isinstance(functions, Mapping):
        parts += [(f"{name} ", part) for name, part in functions.items()]
    return {
        mark + figure: part[figure]
        for mark, part in parts
        if isinstance(part, Mapping)
        for figure in FIGURES
        if isinstance(part.get(figure), int | float)
    }


def check_baseline(baseline: Path, targets: Sequence[str]) -> None:
    """Say what is wrong with an older verdict before anything is run for it.

    Raises
    ------
    ProjectError
        when the file is no verdict, or of none of `targets`, which are names or paths of TOML files.
    """
    old = _read(baseline)
    asked = [Path(name).name.removesuffix(".toml") for name in targets]
    if not set(old) & set(asked):
        raise ProjectError(
            f"--baseline {baseline}: is of target {', '.join(old)}, but what is to run is {', '.join(asked)}: "
            "take the verdict of one of these, or give --target"
        )


def _read(path: Path) -> Mapping[str, object]:
    """Return the targets of an old cost.json, or the one of an old verdict.json."""
    wanted = "name the cost.json or verdict.json of an earlier run"
    try:
        document = json.loads(read_text(path))
    except OSError as error:
        raise ProjectError(f"--baseline {path}: cannot be read: {error.strerror}; {wanted}") from None
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise ProjectError(f"--baseline {path}: is not JSON from {where} on; {wanted}") from None
    except (UnicodeDecodeError, RecursionError):
        raise ProjectError(f"--baseline {path}: is not JSON; {wanted}") from None
    if isinstance(document, dict):
        one = {str(document["target"]): document} if "target" in document else document.get("targets")
        if isinstance(one, dict) and one and all(_has_cost(target) for target in one.values()):
            return one
    raise ProjectError(f"--baseline {path}: holds no costs; {wanted}")


def _has_cost(target: object) -> bool:
    return isinstance(target, Mapping) and isinstance(target.get("cost"), Mapping)


def cost_document(outcomes: Sequence[Outcome]) -> Mapping[str, object]:
    """Return cost.json: what a step takes on each target that counts, and each function of the controller there."""
    return {
        "schema": 1,
        "targets": {
            outcome.target: {
                "program_id": outcome.verdict.program_id,
                "compiler": outcome.verdict.compiler,
                "flags": list(outcome.verdict.flags),
                "cost": outcome.verdict.as_dict()["cost"],
                "functions": {
                    function.name: {
                        "instructions_max": outcome.verdict.cost.instructions_max
                        if function.name.endswith("_step")
                        else None,
                        "text_bytes": function.text_bytes,
                        "stack_bytes": function.stack_bytes,
                    }
                    for function in outcome.verdict.cost.functions
                },
            }
            for outcome in outcomes
            if outcome.verdict
        },
    }
