"""Random laws of every kind are proven a second time; `python -m bench.proofs.random_laws` takes 200 of them."""

from __future__ import annotations

import itertools
import json

from bench.proofs.random_laws import SEED, draws
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.checker import check_proof


def test_random_laws_are_proven_again() -> None:
    seen = set()
    for draw in itertools.islice(draws(SEED), 7):
        if draw.law is None:
            assert draw.refused
            continue
        seen.add(draw.kind)
        program = lower(draw.law, "fixed32")
        checked = check_proof(json.loads(json.dumps(proof(program, draw.law.reasons))))
        assert checked is not None and checked.operations == len(program.body)
    assert len(seen) >= 4


def test_the_same_seed_draws_the_same_laws() -> None:
    one, other = (list(itertools.islice(draws(7), 7)) for _ in range(2))
    assert [draw.law.says if draw.law else draw.refused for draw in one] == [
        draw.law.says if draw.law else draw.refused for draw in other
    ]
