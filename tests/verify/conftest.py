"""Give far ends in tests more time than on a desk: what answers at once may have to wait for a processor here."""

from __future__ import annotations

import pytest

from firmloop.verify.links import live, pty, semihosting, uart

PATIENCE = 300.0  # s


@pytest.fixture(autouse=True)
def patient_links(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name in (
        (uart, "PORT_TIMEOUT"),
        (live, "PORT_TIMEOUT"),
        (uart, "QEMU_TIMEOUT"),
        (semihosting, "TIMEOUT"),
        (semihosting, "OPENING"),
        (pty, "OPENING"),
    ):
        monkeypatch.setattr(module, name, PATIENCE)
