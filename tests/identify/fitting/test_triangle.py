"""A least-squares triangle taken in by blocks of rows is that of all rows at once."""

from __future__ import annotations

import numpy as np

from firmloop.identify.fitting.least_squares import triangle, triangle_of


def test_the_triangle_by_blocks_is_that_of_the_tall_matrix() -> None:
    random = np.random.default_rng(5)
    tall = random.normal(size=(70_001, 5)) * np.array([1.0, 1e-6, 1e6, 1.0, 3.0])
    whole = np.linalg.qr(tall, mode="r")
    sizes = np.linalg.norm(whole, axis=0)
    by_columns = triangle(tall[:, :2], tall[:, 2:])
    by_rows = triangle_of(tall[first : first + 20_000] for first in range(0, len(tall), 20_000))
    for found in (by_columns, by_rows):
        np.testing.assert_allclose(np.abs(found) / sizes, np.abs(whole) / sizes, rtol=0, atol=1e-12)
