"""Filtering by a triangular system gives what scipy.signal gives."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from firmloop.identify.simulation.linear_filter import filtered


@pytest.mark.parametrize("above, below", [([2.0], [1.0]), ([1.0, -0.4, 0.1], [1.0]), ([0.5, 0.2], [1.0, -1.5, 0.7])])
@pytest.mark.parametrize("shape", [(200,), (200, 3), (2,), (1, 2), (0,)])
def test_rows_pass_as_through_scipy(above: list[float], below: list[float], shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(1).normal(size=shape)
    expected = scipy.signal.lfilter(above, below, values, axis=0) if len(values) else values
    np.testing.assert_allclose(filtered(np.array(above), np.array(below), values), expected, rtol=1e-12, atol=1e-12)
