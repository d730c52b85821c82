"""A Judgement: what one judge says of a claim on every input and state."""

from __future__ import annotations

from dataclasses import dataclass

PROVEN, REFUTED, NOT_RUN = "proven", "refuted", "not run"
UNKNOWN, TIMEOUT, OUT_OF_MEMORY = "unknown", "timeout", "out of memory"  # none of them says anything of the claim


@dataclass(frozen=True, slots=True)
class Judgement:
    """The result of one judge for one claim; `says` is what refutes it, or why there is no result."""

    claim: str
    judge: str
    version: str  # empty where the judge is not installed
    result: str
    seconds: float
    says: str = ""

    def as_dict(self) -> dict[str, object]:
        """Return the entry of verdict.json."""
        return {
            "claim": self.claim,
            "judge": self.judge,
            "version": self.version or None,
            "result": self.result,
            "seconds": round(self.seconds, 3),
            "says": self.says or None,
        }
