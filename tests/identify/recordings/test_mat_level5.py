"""MATLAB files of level 5: what scipy writes is read to the bit, and damage is told or gives other numbers."""

from __future__ import annotations

import io

import numpy as np
import pytest
import scipy.io

from firmloop.identify.recordings.formats.mat import read_mat
from firmloop.identify.recordings.mat_level5 import mat_variables
from firmloop.identify.recordings.table import Misread

KINDS = ("f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8")


def saved(packed: bool, **arrays: object) -> bytes:
    buffer = io.BytesIO()
    scipy.io.savemat(buffer, arrays, do_compression=packed)
    return buffer.getvalue()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_number_keeps_its_bits(kind: str) -> None:
    column, matrix = np.arange(5).astype(kind), np.arange(6).astype(kind).reshape(2, 3)
    cells = np.array([1, "a"], dtype=object)
    others = {"note": "bench 3", "wave": column * 1j, "inside": {"x": column}, "cells": cells}
    found = mat_variables(saved(False, t=column, a_longer_name_than_others=matrix, **others)).values
    assert set(found) == {"t", "a_longer_name_than_others", "inside"}
    assert np.array_equal(found["inside"]["x"], column[None, :])
    for array, expected in ((found["t"], column[None, :]), (found["a_longer_name_than_others"], matrix)):
        assert array.dtype == expected.dtype and np.array_equal(array, expected)


def test_values_that_matlab_stores_in_fewer_bytes_are_widened() -> None:
    """MATLAB writes whole doubles as bytes, in a small element where they are few."""
    plain = saved(False, t=np.array([1.0, 2.0]))
    at = plain.index(np.array([1.0, 2.0]).tobytes()) - 8
    small = plain[:at] + b"\1\0\2\0\1\2\0\0"  # kind 1 (int8), 2 bytes
    small = small[:132] + (len(small) - 136).to_bytes(4, "little") + small[136:]
    ((name, values),) = mat_variables(small).values.items()
    assert name == "t" and values.dtype == np.float64 and values.tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize("packed", [False, True], ids=["plain", "packed"])
def test_no_damaged_byte_and_no_cut_ends_the_process(packed: bool) -> None:
    sound = saved(packed, time_s=np.arange(3.0), voltage_V=np.arange(3.0))
    told = 0
    for at in range(len(sound)):
        told += isinstance(read_mat(sound[:at]), Misread)
        for value in (0, 1, 9, 14, 0x7F, 0x80, 0xFF):
            read_mat(sound[:at] + bytes([value]) + sound[at + 1 :])
    assert told > len(sound) // 2
