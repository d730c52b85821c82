"""Give ports in tests more time than on a desk: what answers at once may have to wait for a processor here."""

from __future__ import annotations

import pytest

from verify.links import live, uart

PATIENCE = 30.0  # s


@pytest.fixture(autouse=True)
def patient_ports(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uart, "PORT_TIMEOUT", PATIENCE)
    monkeypatch.setattr(live, "PORT_TIMEOUT", PATIENCE)
