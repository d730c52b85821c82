"""Columns become ours in name, unit and scale; time that does not rise is named with a cure that keeps the rows."""

from __future__ import annotations

import tomllib
from collections.abc import Callable

import numpy as np
import pytest

from tests.firmloop.columns.plain_file import HEADER, HEAT, PLAIN, ROWS, TIME, VOLT, alike, rows_of


def pasted(said: str) -> str:
    """Return the lines below the complaint, as TOML."""
    block = "\n".join(line.strip() for line in said.splitlines()[1:])
    assert tomllib.loads(block), said
    return block.removeprefix("[recordings]\n")


LOST: dict[str, tuple[np.ndarray, str]] = {  # printed stamps of rows 0.05 s apart
    "one digit": (np.round(10.0 + TIME, 1), "{:.1f}"),
    "whole seconds": (np.floor(TIME), "{:.0f}"),
    "six digits from 9.9 s": (9.9999 + np.arange(60) * 5e-5, "{:.6g}"),
    "six digits of an epoch": (1.7e9 + TIME, "{:.10g}"),
}


@pytest.mark.parametrize("case", LOST)
def test_stamps_that_lost_digits_are_named_and_the_cure_keeps_every_row(case: str, bench: Callable[..., tuple]) -> None:
    stamps, form = LOST[case]
    content = "\n".join(
        [HEADER, *(f"{form.format(t)},{row.partition(',')[2]}" for t, row in zip(stamps, ROWS, strict=True))]
    )
    status, _, said = bench(content)
    assert status == 2 and "lost digits" in said and "delete" not in said
    status, columns, said = bench(content, pasted(said))
    assert status == 0 and "recordings.period_s" in said
    period = 5e-5 if case.startswith("six digits from") else 0.05
    np.testing.assert_allclose(
        np.diff(columns["time_s"]), period, atol=1e-6 * period + 3e-7 * (columns["time_s"][0] > 1e6)
    )
    np.testing.assert_allclose(columns["voltage_V"], VOLT, rtol=1e-12)


WRAPS: dict[str, tuple[np.ndarray, str, str]] = {  # counts in the file, its name, [recordings.rename] before
    "micros as seconds": ((2**32 - 10**6 + TIME * 1e6) % 2**32 / 1e6, "time_s", ""),
    "micros as they are": ((2**32 - 10**6 + TIME * 1e6) % 2**32, "t_us", 't_us = { name = "time_s", unit = "us" }'),
    "16 bits of milliseconds": ((65000 + TIME * 1e3) % 2**16, "t_ms", 't_ms = { name = "time_s", unit = "ms" }'),
    "16 bits, twice": ((TIME * 5e4) % 2**16, "n", 'n = { name = "time_s", scale = 2e-5 }'),
    "32 bits with a sign": (
        (2**31 - 10**6 + TIME * 1e6 + 2**31) % 2**32 - 2**31,
        "micros",
        'micros = { name = "time_s", unit = "us" }',
    ),
    "seconds of a minute": ((58.5 + TIME) % 60.0, "time_s", ""),
    "seconds of a day, as milliseconds": (
        (86398.5 + TIME) % 86400.0 * 1e3,
        "t",
        't = { name = "time_s", unit = "ms" }',
    ),
    "cycles at 84 MHz": ((50.1 + TIME) % (2.0**32 / 84e6), "time_s", ""),
    "10 bits of milliseconds": ((0.2 + TIME) % 1.024, "time_s", ""),
    "16 bits of 32 us": ((0.6 + TIME) % (2.0**21 / 1e6), "time_s", ""),
    "24 bits at 72 MHz": ((0.1 + TIME) % (2.0**24 / 72e6), "time_s", ""),
    "24 bits of a crystal at 32768 Hz": ((510.6 + TIME) % 512.0, "time_s", ""),
    "32 bits of 4 us": ((2.0**34 / 1e6 - 1.02 + TIME) % (2.0**34 / 1e6), "time_s", ""),
    "four digits of milliseconds": ((9000 + TIME * 1e3) % 1e4, "t_ms", 't_ms = { name = "time_s", unit = "ms" }'),
    "two digits of seconds": ((98.5 + TIME) % 100.0, "time_s", ""),
    "milliseconds of a second": ((0.35 + TIME) % 1.0, "time_s", ""),
    "seconds of a week": ((604798.5 + TIME) % 604800.0, "time_s", ""),
    "cycles at 168 MHz": ((24.6 + TIME) * 168e6 % 2**32, "n", f'n = {{ name = "time_s", scale = {1 / 168e6!r} }}'),
}


@pytest.mark.parametrize("case", WRAPS)
def test_a_counter_that_wraps_is_named_and_the_cure_keeps_every_row(case: str, bench: Callable[..., tuple]) -> None:
    counts, name, rename = WRAPS[case]
    content = "\n".join(
        [
            HEADER.replace("time_s", name),
            *(f"{n!r},{r.partition(',')[2]}" for n, r in zip(counts.tolist(), ROWS, strict=True)),
        ]
    )
    status, _, said = bench(content, f"[recordings.rename]\n{rename}" if rename else "")
    assert status == 2 and "counter that wraps" in said and "sort" not in said, said
    status, columns, said = bench(content, pasted(said))
    assert status == 0, said
    np.testing.assert_allclose(columns["time_s"] - columns["time_s"][0], TIME, atol=1e-6)
    np.testing.assert_allclose(columns["voltage_V"], VOLT, rtol=1e-12)


STANDS: dict[str, tuple[list[str], str]] = {
    "a row written twice": ([*ROWS[:20], ROWS[19], *ROWS[20:]], "delete the second"),
    "every row written twice": ([row for row in ROWS for _ in range(2)], f"{len(ROWS)} rows are written twice"),
    "every row written thrice": ([row for row in ROWS for _ in range(3)], "up to 3 times, the same in every column"),
    "rows swapped in pairs": ([row for k in range(0, 60, 2) for row in (ROWS[k + 1], ROWS[k])], "sort the rows"),
    "two recordings in one file": ([*ROWS, *ROWS], "holds 2 recordings: split it before line 62"),
    "rows from the last to the first": (ROWS[::-1], "turn the rows around"),
    "two recordings of ten seconds": (
        [f"{k * 0.1 % 10.0:.1f},{VOLT[k % 100 % 60]:.9g},1" for k in range(200)],
        "holds 2 recordings: split it before line 102",
    ),
    "three recordings of a second": (ROWS[:20] * 3, "holds 3 recordings: split it before line 22"),
    "rows swapped": ([*ROWS[:20], ROWS[21], ROWS[20], *ROWS[22:]], "sort the rows"),
    "a fall that no power of two explains": (
        [f"{k * 65.5 % 65.536:.3f},1,1" for k in range(40)],
        "goes back 38 times",
    ),
    "two recordings of a minute": (
        [f"{k * 0.5 % 60.0:.1f},{VOLT[k % 60]:.9g},1" for k in range(240)],
        "holds 2 recordings: split it before line 122",
    ),
    "two runs with a pause, the clock anew a moment after": (
        [f"{k % 480 * 0.00208 + k // 480 * 0.0027:.6f},{k / 480:.9g},1" for k in range(960)],
        "holds 2 recordings: split it before line 482",
    ),
    "one stamp 0": ([*ROWS[:20], f"0,{ROWS[20].partition(',')[2]}", *ROWS[21:]], "one stamp is wrong"),
    "one stamp without its point": ([*ROWS[:20], ROWS[20].replace(".", "", 1), *ROWS[21:]], "one stamp is wrong"),
    "one stamp wrong": ([*ROWS[:20], f"0.95,{ROWS[20].partition(',')[2]}", *ROWS[21:]], "one stamp is wrong"),
}


@pytest.mark.parametrize("case", STANDS)
def test_time_that_does_not_rise_for_another_reason_is_not_called_a_counter(
    case: str, bench: Callable[..., tuple]
) -> None:
    rows, words = STANDS[case]
    status, _, said = bench("\n".join([HEADER, *rows]))
    assert status == 2 and words in said and "counter that wraps" not in said and "lost digits" not in said, said


@pytest.mark.parametrize(
    ("name", "ours", "unit"),
    [
        ("t_ms", "time_s", "ms"),
        ("t_min", "time_s", "min"),
        ("speed_rpm", "speed_rad_s", "rpm"),
        ("i_mA", "current_A", "mA"),
        ('"Time (ms)"', "time_s", "ms"),
        ('"Speed [rpm]"', "speed_rad_s", "rpm"),
        ("u_mV", "voltage_V", "mV"),
        ("rpm", "speed_rad_s", "rpm"),
        ("micros", "time_s", "us"),
        ("angle_deg", "position_rad", "deg"),
        ("x_mm", "position_m", "mm"),
        ('"T (°F)"', "temperature_C", "°F"),
        ("u_V", "current_A", "V"),
    ],
)
def test_a_unit_in_a_foreign_name_is_asked_for_with_the_line(
    name: str, ours: str, unit: str, bench: Callable[..., tuple]
) -> None:
    status, _, said = bench(PLAIN, f'[recordings.rename]\n{name} = "{ours}"')
    assert status == 2 and "given.toml:" in said
    line = f'{name} = {{ name = "{ours}", unit = "{unit}" }}'
    assert line in said, said
    status, _, said = bench(PLAIN, f"[recordings.rename]\n{line}")
    assert status == (2 if name == "u_V" else 0), said  # a voltage is no current


@pytest.mark.parametrize("name", ["v_in", "u_V", "omega", "motor_voltage", "speed_min", "u_pu"])
def test_a_foreign_name_without_another_unit_is_only_a_name(name: str, bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(PLAIN.replace("voltage_V", name), f'[recordings.rename]\n{name} = "voltage_V"')
    assert status == 0, said
    alike(columns, volt=name)


@pytest.mark.parametrize(
    ("column", "values"),
    [
        ('unit = "mV"', VOLT * 1e3),
        ("scale = 0.5, offset = -1", (VOLT + 1) / 0.5),
        ('unit = "mV", scale = 2, offset = 10', (VOLT * 1e3 - 10) / 2),
        ('unit = "kV"', VOLT / 1e3),
        ("scale = -1", -VOLT),
        ("wraps = 4", VOLT % 4),
    ],
)
def test_a_column_is_unwrapped_scaled_shifted_and_converted(
    column: str, values: np.ndarray, bench: Callable[..., tuple]
) -> None:
    content = "\n".join(["time_s,raw,temperature_C", *rows_of(TIME, np.round(values, 9), HEAT)])
    status, columns, said = bench(content, f'[recordings.rename]\nraw = {{ name = "voltage_V", {column} }}')
    assert status == 0, said
    np.testing.assert_allclose(columns["voltage_V"], VOLT, atol=1e-8)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('[recordings.rename]\na = { unit = "V" }', "'name' is missing"),
        ('[recordings.rename]\na = { name = "voltage_V", unit = "furlong" }', "furlong"),
        ('[recordings.rename]\na = { name = "voltage_V", unit = "rpm" }', "no V"),
        ('[recordings.rename]\na = { name = "tacho", unit = "rpm" }', "ends in no unit"),
        ('[recordings.rename]\na = { name = "voltage_V", scale = 0 }', "must not be 0"),
        ('[recordings.rename]\na = { name = "voltage_V", wraps = -1 }', "more than 0"),
        ('[recordings.rename]\na = { name = "voltage_V", unit = "mV", scale = 1e-3 }', "turns mV into V, as unit does"),
        ('[recordings.rename]\na = { name = "voltage_V", factor = 2 }', "'factor'"),
        ('[recordings.rename]\na = "voltage_V"\nb = { name = "voltage_V" }', "'a'"),
        ("period_s = 0", "more than 0"),
        ("start_s = 1", "period_s"),
    ],
)
def test_wrong_columns_of_a_project_are_named(lines: str, words: str, bench: Callable[..., tuple]) -> None:
    status, _, said = bench(PLAIN, lines)
    assert status == 2 and "given.toml:" in said and words in said, said


def test_a_counter_that_leaves_its_range_is_named(bench: Callable[..., tuple]) -> None:
    content = "\n".join(["n_us,voltage_V,temperature_C", *rows_of(TIME * 1e6 % 2**16, VOLT, HEAT)])
    status, _, said = bench(content, '[recordings.rename]\nn_us = { name = "time_s", unit = "us", wraps = 0.065536 }')
    assert status == 2 and "a counter that wraps at 0.065536 stays within so much" in said, said


def test_a_unit_that_the_files_own_name_contradicts_is_told(bench: Callable[..., tuple]) -> None:
    content = "\n".join(["time_s,u_mV,temperature_C", *rows_of(TIME, VOLT / 1e3, HEAT)])
    status, columns, said = bench(content, '[recordings.rename]\nu_mV = { name = "voltage_V", unit = "kV" }')
    assert status == 0 and "u_mV is read in kV, as [recordings.rename] has it, though the file says mV" in said
    alike(columns)


def test_two_columns_that_fit_one_name_are_both_named(bench: Callable[..., tuple]) -> None:
    content = "\n".join(["time_s,voltage_V,u", *ROWS])
    status, _, said = bench(content, '[recordings.rename]\nu = "voltage_V"')
    assert status == 2 and "'voltage_V' (column 2)" in said and "'u' (column 3, renamed)" in said
    status, _, said = bench("\n".join(["time_s,voltage_V,voltage_V", *ROWS]))
    assert status == 2 and "(column 2)" in said and "(column 3)" in said


def test_a_file_without_time_takes_the_period(bench: Callable[..., tuple]) -> None:
    content = "\n".join(row.partition(",")[2] for row in PLAIN.splitlines())
    status, _, said = bench(content)
    assert status == 2 and "period_s" in said
    status, columns, said = bench(content, "period_s = 0.05\nstart_s = 0")
    assert status == 0, said
    alike(columns)


def test_a_stamp_that_repeats_on_a_grid_as_wide_as_a_row_is_a_digit_lost(bench: Callable[..., tuple]) -> None:
    stamps = np.arange(60)
    stamps[19:] += 1  # the rows drift by half a place and back
    stamps[30:] -= 1
    stamps[47:] += 1
    rows = [f"{stamp * 0.05:.2f},{row.partition(',')[2]}" for stamp, row in zip(stamps, ROWS, strict=True)]
    status, _, said = bench("\n".join([HEADER, *rows, ""]))
    assert status == 2 and "has lost digits: 1 of 60 stamps repeats, but the rows are even, 0.05 s apart" in said, said
    status, columns, said = bench("\n".join([HEADER, *rows, ""]), pasted(said))
    assert status == 0, said
    alike(columns)


@pytest.mark.parametrize(
    ("rows", "says", "offered"),
    [
        ([*ROWS[:40], ROWS[20], *ROWS[40:]], "this row is one too many, for without it the clock goes on", False),
        ([*ROWS[:40], *ROWS[39:]], "written twice, so delete the second", False),
        ([*ROWS[:40], f"{ROWS[39].partition(',')[0]},0.5,0.5", *ROWS[40:]], "this row is one too many", False),
        ([*ROWS[:40], f"0.50,{ROWS[40].partition(',')[2]}", *ROWS[41:]], "one stamp is wrong: correct it", True),
        ([*ROWS[:40], f"0.50,{ROWS[40].partition(',')[2]}", *ROWS[44:]], "one stamp is wrong: correct it", False),
    ],
)
def test_a_period_is_offered_only_where_it_leaves_the_other_rows_in_place(
    rows: list[str], says: str, offered: bool, bench: Callable[..., tuple]
) -> None:
    status, _, said = bench("\n".join([HEADER, *rows, ""]))
    assert status == 2 and "line 42, column time_s" in said and says in said
    assert ("period_s" in said) == offered
    if offered:
        status, columns, said = bench("\n".join([HEADER, *rows, ""]), "period_s = 0.05")
        assert status == 0, said
        alike(columns)


DATES = {  # stamps of rows 0.05 s apart that a project takes for seconds, and how a file prints them
    "ms": (1.7e12 + TIME * 1e3, "{:.0f}"),
    "us": (1.7e15 + TIME * 1e6, "{:.0f}"),
    "days": (45352.375 + TIME / 86400.0, "{:.12f}"),
}


@pytest.mark.parametrize("unit", DATES)
def test_a_clock_that_counts_since_a_day_is_not_read_as_seconds(unit: str, bench: Callable[..., tuple]) -> None:
    stamps, form = DATES[unit]
    rows = [f"{form.format(t)},{row.partition(',')[2]}" for t, row in zip(stamps, ROWS, strict=True)]
    content = "\n".join(["stamp,voltage_V,temperature_C", *rows])
    status, _, said = bench(content, '[recordings.rename]\nstamp = "time_s"')
    assert status == 2 and "are read as seconds" in said
    status, columns, _ = bench(content, pasted(said))
    assert status == 0
    np.testing.assert_allclose(np.diff(columns["time_s"]), 0.05, atol=1e-6)


@pytest.mark.parametrize("start", [40000.0, 45352.375, 730500.25])
def test_a_clock_of_seconds_that_runs_for_long_is_one_of_seconds(start: float, bench: Callable[..., tuple]) -> None:
    rows = [f"{start + t:.3f},{row.partition(',')[2]}" for t, row in zip(TIME, ROWS, strict=True)]
    status, columns, said = bench("\n".join([HEADER, *rows]))
    assert status == 0, said
    np.testing.assert_allclose(np.diff(columns["time_s"]), 0.05, atol=1e-6)
