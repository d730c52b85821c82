"""A timer that counts down is no recording of one row each, and no file that stands the last row first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.firmloop.columns.plain_file import HEADER, ROWS, TIME, VOLT
from tests.firmloop.columns.test_columns import pasted

DOWN = {  # counts in the file, its name, [recordings.rename] before
    "24 bits at 16 MHz": ((2**24 - 1 - TIME * 16e6) % 2**24, "n", f'n = {{ name = "time_s", scale = {1 / 16e6!r} }}'),
    "16 bits of 50 us": ((5000 - TIME * 2e4) % 2**16, "n", 'n = { name = "time_s", scale = 5e-5 }'),
    "seconds of a minute": ((1.5 - TIME) % 60.0, "time_s", ""),
    "milliseconds to go": (9000.0 - TIME * 1e3, "left_ms", 'left_ms = { name = "time_s", unit = "ms" }'),
    "cycles that have not yet wrapped": (
        2.0**32 - 1.0 - TIME * 84e6,
        "n",
        f'n = {{ name = "time_s", scale = {1 / 84e6!r} }}',
    ),
}


def written(case: str) -> tuple[str, str]:
    counts, name, rename = DOWN[case]
    rows = (f"{n!r},{row.partition(',')[2]}" for n, row in zip(counts.tolist(), ROWS, strict=True))
    return "\n".join([HEADER.replace("time_s", name), *rows]), f"[recordings.rename]\n{rename}" if rename else ""


@pytest.mark.parametrize("case", DOWN)
def test_a_timer_that_counts_down_is_named_and_the_cure_keeps_every_row(case: str, bench: Callable[..., tuple]) -> None:
    content, rename = written(case)
    status, _, said = bench(content, rename)
    assert status == 2 and "the clock counts down" in said and "split it" not in said, said
    status, columns, said = bench(content, pasted(said))
    assert status == 0, said
    np.testing.assert_allclose(columns["time_s"] - columns["time_s"][0], TIME, atol=1e-6)
    np.testing.assert_allclose(columns["voltage_V"], VOLT, rtol=1e-12)


def test_a_wrong_end_of_a_timer_that_counts_down_is_refused_with_the_right_one(bench: Callable[..., tuple]) -> None:
    content, _ = written("16 bits of 50 us")
    line = 'n = { name = "time_s", unit = "s", scale = -5e-05, wraps = WRAPS }'
    status, _, said = bench(content, f"[recordings.rename]\n{line.replace('WRAPS', '131072')}")
    assert status == 2 and line.replace("WRAPS", "65536") in said, said
    status, columns, said = bench(content, f"[recordings.rename]\n{line.replace('WRAPS', '65536')}")
    assert status == 0, said
    np.testing.assert_allclose(np.diff(columns["time_s"]), 0.05, atol=1e-9)
