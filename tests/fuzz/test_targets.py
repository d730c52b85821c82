"""Strangers' bytes, up to 500 cases a door; `bench/host/fuzz.py` draws as many as it is asked for."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzz.targets import TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_odd_bytes_are_read_or_told(name: str) -> None:
    target = TARGETS[name]

    @settings(max_examples=target.in_tests, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(target.draw)
    def attempt(drawn: object) -> None:
        target.attempt(drawn)

    attempt()
