"""Files as loggers, scopes and spreadsheets write them are read as they are meant, or refused with the cure."""

from __future__ import annotations

import csv
import gzip
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

TIME = np.round(np.arange(60) * 0.05, 2)
VOLT = np.round(3.0 * np.sin(TIME) + 0.25, 3)
HEAT = np.round(2.0 * np.cos(TIME), 3)
HEADER = "time_s,voltage_V,temperature_C"
ROWS = [f"{t:.2f},{u:.3f},{y:.3f}" for t, u, y in zip(TIME, VOLT, HEAT, strict=True)]
PLAIN = "\n".join([HEADER, *ROWS, ""])


@pytest.fixture
def bench(project: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, dict[str, np.ndarray], str]]:
    """Read a file by a project with more lines in [recordings]; return status, columns and what was said."""

    def read(content: str | bytes, lines: str = "", name: str = "r.csv") -> tuple[int, dict[str, np.ndarray], str]:
        file = project.parent / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        given = project.with_name("given.toml")
        given.write_text(project.read_text().replace("\n[plant]\n", f"\n{lines}\n[plant]\n", 1))
        out = project.parent / "out.csv"
        out.unlink(missing_ok=True)
        capsys.readouterr()
        status = main(["simulate", str(given), str(file), "--out", str(out)])
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        if status:
            assert not out.exists()
            return status, {}, said.err
        with out.open() as stream:
            head, *rows = csv.reader(stream)
        columns = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
        return status, columns, said.out

    return read


def alike(columns: dict[str, np.ndarray], *, time: str = "time_s", volt: str = "voltage_V") -> None:
    np.testing.assert_allclose(columns[time], TIME, atol=1e-12)
    np.testing.assert_allclose(columns[volt], VOLT, rtol=1e-12)


def comma(text: str) -> str:
    """The same numbers, as a continental spreadsheet writes them."""
    return text.replace(",", ";").replace(".", ",")


UNITS = "\n".join(["time_s;voltage_V;temperature_C", "s;V;°C", *ROWS, ""]).replace(",", ";")
DIALECTS: dict[str, tuple[str | bytes, str]] = {
    "semicolons": (PLAIN.replace(",", ";"), "semicolons"),
    "semicolons and decimal commas": (comma(PLAIN), "decimal commas"),
    "tabs": (PLAIN.replace(",", "\t"), "tabs"),
    "tabs and decimal commas": (comma(PLAIN).replace(";", "\t"), "decimal commas"),
    "quoted decimal commas": (
        "\n".join([HEADER, *(",".join(f'"{x.replace(".", ",")}"' for x in row.split(",")) for row in ROWS)]),
        "decimal commas",
    ),
    "a line of units": (UNITS, "line of units"),
    "units in brackets": (PLAIN.replace(HEADER, f"{HEADER}\n[s],[V],[°C]"), "line of units"),
    "a boot line": (f"Booting v1.2\n{PLAIN}", "1 line is left aside, the header is line 2"),
    "boot lines with commas": (f"rst:0x1,boot:0x13\nload:0x3fff,len:4\n\n{PLAIN}", "2 lines are left aside"),
    "boot line with as many commas": (f"logger,v1.2,bench\n{PLAIN}", "the header is line 2"),
    "a comment with the date": (f"# 2024-05-01 12:00:00, bench 3\n{PLAIN}", "left aside"),
    "a word below the header": (PLAIN.replace(HEADER, f"{HEADER}\nReady"), "left aside"),
    "comma at every end": (PLAIN.replace("\n", ",\n"), "every line ends with a delimiter"),
    "comma at the ends of rows only": ("\n".join([HEADER, *(f"{row}," for row in ROWS)]), "ends with a delimiter"),
    "two commas at every end": (PLAIN.replace("\n", ",,\n"), "delimiters"),
    "semicolon at every end": (comma(PLAIN).replace("\n", ";\n"), "ends with a delimiter"),
    "tab at every end": (PLAIN.replace(",", "\t").replace("\n", "\t\n"), "ends with a delimiter"),
    "UTF-16": (PLAIN.encode("utf-16"), "UTF-16"),
    "UTF-16, big end first": (b"\xfe\xff" + PLAIN.encode("utf-16-be"), "UTF-16"),
    "UTF-16 without its mark": (PLAIN.encode("utf-16-le"), "UTF-16"),
    "BOM, semicolons and a line of units": ("\ufeff" + UNITS, "line of units"),
    "Windows-1252": (UNITS.encode("cp1252"), "Windows-1252"),
    "CRLF, tabs": (PLAIN.replace(",", "\t").replace("\n", "\r\n"), "tabs"),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_reads_like_the_plain_file_and_is_told(dialect: str, bench: Callable[..., tuple]) -> None:
    content, told = DIALECTS[dialect]
    status, columns, said = bench(content)
    assert status == 0, said
    alike(columns)
    (note,) = [line for line in said.splitlines() if told in line]
    assert note.startswith("note: r.csv ")


def test_a_packed_dialect_reads_alike(bench: Callable[..., tuple]) -> None:
    status, columns, _ = bench(gzip.compress(comma(PLAIN).encode()), name="r.csv.gz")
    assert status == 0
    alike(columns)


def test_a_plain_file_is_read_without_a_note(bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(PLAIN)
    assert status == 0 and "note" not in said
    alike(columns)


def rows_of(*columns: np.ndarray, mark: str = ",", end: str = "") -> list[str]:
    return [mark.join(f"{value:.9g}" for value in row) + end for row in zip(*columns, strict=True)]


TDS = [
    f"{head},,{row}," for head, row in zip(["Record Length,60", "Source,CH1", "Vertical Units,V"], ROWS, strict=False)
]
LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t{decimal}\n"
    "Multi_Headings\tYes\nX_Columns\t{columns}\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t60\t60\t\nX_Dimension\tTime\tTime\t\nX0\t0\t0\t\nDelta_X\t0.05\t0.05\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tVolt\tHeat\tComment\n"
)
EXPORTS: dict[str, tuple[str, str, str]] = {  # file, [recordings.rename], what is told
    "Tektronix TDS": (
        "\n".join(
            f"{head},{t:.9g},{u:.9g},"
            for head, t, u in zip(
                ["Record Length,60,", "Sample Interval,0.05,", "Source,CH1,", *[",,"] * 57], TIME, VOLT, strict=True
            )
        ),
        'CH1 = "voltage_V"',
        "Tektronix",
    ),
    "Tektronix MSO": (
        "Model,MSO54\nFirmware Version,1.28\n\nHorizontal Units,s\nSample Interval,0.05\nLabels,,\nTIME,CH1\n"
        + "\n".join(rows_of(TIME, VOLT)),
        'TIME = "time_s"\nCH1 = "voltage_V"',
        "the header is line 7",
    ),
    "Rigol DS1000": (
        "X,CH1,CH2,Start,Increment,\nSequence,VOLT,VOLT,0,5.0e-2,\n"
        + "\n".join(rows_of(np.arange(60), VOLT, HEAT, end=",")),
        'CH1 = "voltage_V"',
        "Rigol",
    ),
    "Rigol DS1000Z": (
        "X,CH1,Start,Increment,\nSequence,Volt,0.0,5.0e-2,\n" + "\n".join(rows_of(np.arange(60), VOLT, end=",,")),
        'X = "time_s"\nCH1 = "voltage_V"',
        "Rigol",
    ),
    "Rigol MSO5000": (
        "CH1V,CH2V,t0 =0.0, tInc = 5.0e-2,\n" + "\n".join(rows_of(VOLT, HEAT, end=",")),
        'CH1V = "voltage_V"',
        "Rigol",
    ),
    "Siglent": (
        "Record Length,Analog:60\nSample Interval(s),5.0e-2\nVertical Scale,CH1:1.00\nSource,CH1\nSecond,Volt\n"
        + "\n".join(rows_of(TIME, VOLT)),
        'Source = "time_s"\nCH1 = "voltage_V"',
        "line of units",
    ),
    "Saleae": (
        "Time [s],Channel 0\n" + "\n".join(rows_of(TIME, VOLT)),
        '"Time [s]" = "time_s"\n"Channel 0" = "voltage_V"',
        "",
    ),
    "LabVIEW": (
        LVM.format(decimal=".", columns="One") + "\n".join(rows_of(TIME, VOLT, HEAT, mark="\t")),
        'Volt = "voltage_V"',
        "LabVIEW",
    ),
    "LabVIEW, decimal commas": (
        LVM.format(decimal=",", columns="One") + "\n".join(rows_of(TIME, VOLT, HEAT, mark="\t")).replace(".", ","),
        'Volt = "voltage_V"',
        "LabVIEW",
    ),
    "LabVIEW without X": (
        LVM.format(decimal=".", columns="No").replace("X_Value\t", "") + "\n".join(rows_of(VOLT, HEAT, mark="\t")),
        'Volt = "voltage_V"',
        "LabVIEW",
    ),
}


@pytest.mark.parametrize("maker", EXPORTS)
def test_an_instruments_export_reads_like_the_plain_file(maker: str, bench: Callable[..., tuple]) -> None:
    content, rename, told = EXPORTS[maker]
    name = "r.lvm" if maker.startswith("LabVIEW") else "r.csv"
    status, columns, said = bench(content, f"[recordings.rename]\n{rename}", name)
    assert status == 0, said
    names = {line.split(" = ")[1].strip('"'): line.split(" = ")[0].strip('"') for line in rename.splitlines()}
    alike(columns, time="time_s" if "time_s" in columns else names["time_s"], volt=names["voltage_V"])
    assert told in said


REFUSED: dict[str, tuple[str | bytes, tuple[str, ...]]] = {
    "decimal commas between commas": (PLAIN.replace(".", ","), ("decimal commas", ";")),
    "thousands or fractions": (
        "time_s;voltage_V;a_V\n" + "\n".join(f"{k};1,{k + 100};2,{k + 200}" for k in range(40)),
        ("two ways", "1,100", "thousands"),
    ),
    "no header": ("\n".join(ROWS), ("has no header", "time_s, column_2, column_3")),
    "no header, semicolons": ("\n".join(ROWS).replace(",", ";"), ("has no header",)),
    "header again in the middle": ("\n".join([HEADER, *ROWS[:30], HEADER, *ROWS[30:]]), ("line 32", "header again")),
    "semicolons, one row short": (
        PLAIN.replace(",", ";").replace(ROWS[40].replace(",", ";"), "2.0;1"),
        ("line 42", "2 values"),
    ),
    "a name in other units than its line of units": (
        PLAIN.replace(HEADER, f"{HEADER}\nms,V,°C"),
        ("time_s is named in s", "ms", 'time_s = { name = "time_s", unit = "ms" }'),
    ),
    "foreign time": (PLAIN.replace("time_s", "Time (ms)"), ('"Time (ms)" = { name = "time_s", unit = "ms" }',)),
    "LabVIEW with a time each": (
        LVM.format(decimal=".", columns="Multi") + "\n".join(ROWS),
        ("a time column for each",),
    ),
    "UTF-16 cut in the middle of a sign": (PLAIN.encode("utf-16")[:-1], ("is not text",)),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_fits_two_ways_or_none_is_refused_with_the_cure(case: str, bench: Callable[..., tuple]) -> None:
    content, words = REFUSED[case]
    status, _, said = bench(content)
    assert status == 2
    for word in words:
        assert word in said, said


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
    "two recordings in one file": ([*ROWS, *ROWS], "holds 2 recordings: split it before line 62"),
    "rows swapped": ([*ROWS[:20], ROWS[21], ROWS[20], *ROWS[22:]], "sort the rows"),
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
        ('[recordings.rename]\na = { name = "voltage_V", factor = 2 }', "'factor'"),
        ('[recordings.rename]\na = "voltage_V"\nb = { name = "voltage_V" }', "'a'"),
        ("period_s = 0", "more than 0"),
        ("start_s = 1", "period_s"),
    ],
)
def test_wrong_columns_of_a_project_are_named(lines: str, words: str, bench: Callable[..., tuple]) -> None:
    status, _, said = bench(PLAIN, lines)
    assert status == 2 and "given.toml:" in said and words in said, said


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
