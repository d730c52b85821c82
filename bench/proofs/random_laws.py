"""Prove the ranges of every example and of random laws a second time, in both fixed-point words.

    python -m bench.proofs.random_laws          200 laws from one seed; a number takes another count

A draw that design or quantize refuses is counted with its reason and drawn again. Exit status 1 when an operation of
a law that was accepted is not proven.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from firmloop.design.kinds import design, kinds
from firmloop.design.law import DesignError, Law
from firmloop.design.models.anti_windup import MODES
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import ProofError, check_proof

LAWS = 200
SEED = 4
Table = dict[str, object]
Random = np.random.Generator


@dataclass(frozen=True, slots=True)
class Draw:
    """One law, or why there is none."""

    kind: str
    law: Law | None
    refused: str


def pid_table(random: Random) -> Table:
    """Return gains over three decades, every form and mode."""
    kp = _decades(random, -3, 0)
    table: Table = {"kp": kp, "ki": kp * _decades(random, -1, 2), "b": random.uniform(0, 1), "c": random.uniform(0, 1)}
    if random.random() < 0.6:
        table |= {"kd": kp * _decades(random, -3, -1), "tf_s": _decades(random, -3, -1)}
    table["anti_windup"] = str(random.choice([mode.name for mode in MODES.values() if mode.why]))
    table["form"] = str(random.choice(["default", "tustin"]))
    if random.random() < 0.3:
        table["rate_limit_per_s"] = _decades(random, 1, 4)
    return table


def tuned_table(random: Random) -> Table:
    """Return a PID whose gains can be tuned within a random factor."""
    table = pid_table(random)
    names = [name for name in ("kp", "ki", "kd") if name in table and random.random() < 0.7] or ["kp"]
    ranges = {name: [0.0, float(str(table[name])) * random.uniform(1, 10)] for name in names}
    return {**table, "tunable": names, "ranges": ranges}


def schedule_table(random: Random) -> Table:
    """Return two to four PIDs of one form over the measurement."""
    first = pid_table(random)
    count = int(random.integers(2, 5))
    moved = [
        {**first, **{k: float(str(first[k])) * random.uniform(0.3, 3) for k in ("kp", "ki")}} for _ in range(count)
    ]
    points = np.sort(random.uniform(-300, 300, count)).tolist()
    return {"schedule_on": "measurement", "points": points, "controllers": moved}


def space_table(random: Random) -> Table:
    """Return a stable system of one to five states."""
    n = int(random.integers(1, 6))
    a = random.normal(size=(n, n))
    a *= random.uniform(0.05, 0.98) / max(abs(np.linalg.eigvals(a)))
    b, c = random.normal(size=(n, 2)) * _decades(random, -3, 1), random.normal(size=(1, n)) * _decades(random, -3, 1)
    return {"A": a.tolist(), "B": b.tolist(), "C": c.tolist(), "D": random.normal(size=(1, 2)).tolist()}


def function_table(random: Random) -> Table:
    """Return real poles and pairs inside the circle, zeros anywhere near."""
    pairs = [random.uniform(0.1, 0.98) * np.exp(1j * random.uniform(0, np.pi)) for _ in range(random.integers(1, 3))]
    poles = [root for pair in pairs for root in (pair, np.conj(pair))] + random.uniform(-0.9, 0.97, 1).tolist()
    zeros = random.uniform(-1.2, 1.2, int(random.integers(0, len(poles) + 1)))
    numerator = np.atleast_1d(np.poly(zeros)) * _decades(random, -3, 0)
    return {"numerator": numerator.tolist(), "denominator": np.real(np.poly(poles)).tolist(), "domain": "z"}


def lead_table(random: Random) -> Table:
    """Return a lead or lag."""
    return {"gain": _decades(random, -2, 1), "zero_rad_s": _decades(random, 0, 3), "pole_rad_s": _decades(random, 0, 3)}


def notch_table(random: Random) -> Table:
    """Return a notch below Nyquist."""
    return {"frequency_hz": random.uniform(5, 450), "damping": random.uniform(0.05, 1), "depth": random.uniform(0, 1)}


def blend_table(random: Random) -> Table:
    """Return two or three filters or systems over the measurement, each drawn by itself."""
    made = [("state_space", space_table), ("transfer_function", function_table), ("lead_lag", lead_table)]
    chosen = [made[int(k)] for k in random.integers(0, len(made), int(random.integers(2, 4)))]
    points = np.sort(random.uniform(-300, 300, len(chosen))).tolist()
    controllers = [{"kind": kind, **table(random)} for kind, table in chosen]
    return {"schedule_on": "measurement", "points": points, "controllers": controllers}


KINDS: tuple[tuple[str, Callable[[Random], Table]], ...] = (
    ("pid", pid_table),
    ("pid", tuned_table),
    ("gain_schedule", schedule_table),
    ("state_space", space_table),
    ("transfer_function", function_table),
    ("lead_lag", lead_table),
    ("notch", notch_table),
    ("gain_schedule", blend_table),
)


def draws(seed: int) -> Iterator[Draw]:
    """Draw laws of every kind in turn, over ranges of their own, without end."""
    random = np.random.default_rng(seed)
    while True:
        for kind, table in KINDS:
            span, limit = (400.0 if kind == "gain_schedule" else _decades(random, -1, 3)), _decades(random, -1, 3)
            wires = tuple(Signal(name, "rad/s", -span, span) for name in ("reference", "measurement"))
            output = (Signal("output", "V", -limit, limit),)
            try:
                law = design(kind, "random_law", table(random), 0.001, wires, output, None).law
                yield Draw(kind, law, "")
            except DesignError as error:
                yield Draw(kind, None, str(error))


def _decades(random: Random, low: float, high: float) -> float:
    return float(10.0 ** random.uniform(low, high))


def examples() -> Iterator[Draw]:
    """Give every example of every kind."""
    for kind in kinds().values():
        for name, request in kind.examples.items():
            yield Draw(f"example {name}", kind.design(request).law, "")


def main() -> int:
    """Print a line per example and kind, and every refusal once."""
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else LAWS
    proven: Counter[str] = Counter()
    laws: Counter[str] = Counter()
    refused: Counter[str] = Counter()
    failed = 0
    start = time.perf_counter()
    own = tuple(examples())
    for draw in chain(own, draws(SEED)):
        if sum(laws.values()) == wanted + len(own):
            break
        if draw.law is None:
            refused[f"{draw.kind}: {draw.refused}"] += 1
            continue
        laws[draw.kind] += 1
        for arithmetic in ("fixed32", "fixed16"):
            try:
                program = lower(draw.law, arithmetic)
            except QuantizeError as error:
                refused[f"{draw.kind} {arithmetic}: {error}"] += 1
                continue
            try:
                checked = check_proof(json.loads(json.dumps(proof(program, draw.law.reasons))))
                assert checked is not None, "fixed point is always checked"
                proven[draw.kind] += checked.operations + checked.stores
            except ProofError as error:
                failed += 1
                print(f"NOT PROVEN: {draw.kind} {arithmetic}: {error}", flush=True)
    for kind in laws:
        print(f"{kind:32} {laws[kind]:4} laws, {proven[kind]:6,} operations and stores proven again")
    print(f"{sum(laws.values())} laws, {sum(proven.values()):,} proven, {failed} programs not: {_wall(start)}")
    for reason, count in refused.most_common():
        print(f"  refused {count}: {reason}")
    return 1 if failed else 0


def _wall(start: float) -> str:
    return f"{time.perf_counter() - start:.0f} s"


if __name__ == "__main__":
    sys.exit(main())
