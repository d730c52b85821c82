"""A `wraps` that makes a leap of every fall of the counter is refused with the one that fits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.firmloop.columns.plain_file import HEAT, TIME, VOLT, rows_of
from tests.firmloop.columns.test_columns import pasted

COUNTED = {  # counts in the file, what stands in the project beside wraps, what fits
    "16 bits of milliseconds": ((65000 + 1e3 * TIME) % 2**16, 'unit = "ms"', 65536),
    "16 bits, twice": ((TIME * 5e4) % 2**16, "scale = 2e-5", 65536),
    "24 bits of microseconds": ((2**24 - 10**6 + TIME * 1e6) % 2**24, 'unit = "us"', 16777216),
}


def named(counts: np.ndarray) -> str:
    return "\n".join(["n,voltage_V,temperature_C", *rows_of(np.round(counts, 6), VOLT, HEAT), ""])


@pytest.mark.parametrize("wraps", [2**32, 2**25])
@pytest.mark.parametrize("case", COUNTED)
def test_a_wrong_wraps_is_refused_with_the_one_that_fits(case: str, wraps: int, bench: Callable[..., tuple]) -> None:
    counts, way, fits = COUNTED[case]
    k = int(np.argmax(np.diff(counts) < 0))
    rename = f'[recordings.rename]\nn = {{ name = "time_s", {way}, wraps = {wraps} }}'
    status, _, said = bench(named(counts), rename)
    assert status == 2 and f"line {k + 3}, column n: falls by {counts[k] - counts[k + 1]:.0f}, from" in said, said
    assert f"{fits} fits every fall, which is 2^{fits.bit_length() - 1} ticks" in said and "missing" not in said
    status, columns, said = bench(named(counts), pasted(said))
    assert status == 0, said
    np.testing.assert_allclose(columns["time_s"] - columns["time_s"][0], TIME, atol=1e-6)


def test_a_pause_across_the_fall_of_a_counter_leaves_its_wraps_right(bench: Callable[..., tuple]) -> None:
    time = TIME + np.where(TIME > 1.0, 20.0, 0.0)
    counts = (64000 + 1e3 * time) % 2**16
    rename = '[recordings.rename]\nn = { name = "time_s", unit = "ms", wraps = 65536 }'
    status, columns, said = bench(named(counts), rename)
    assert status == 0 and "rows are missing" in said, said
    np.testing.assert_allclose(columns["time_s"] - columns["time_s"][0], time, atol=1e-6)
