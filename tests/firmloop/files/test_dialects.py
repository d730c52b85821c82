"""Files as loggers, scopes and spreadsheets write them are read as they are meant, or refused with the cure."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from random import Random

import numpy as np
import pytest

from firmloop.identify.error import IdentifyError
from firmloop.identify.recordings.columns import Column
from firmloop.identify.recordings.recording import read_recording
from tests.firmloop.columns.plain_file import HEADER, HEAT, PLAIN, ROWS, TIME, VOLT, alike, rows_of


def comma(text: str) -> str:
    """The same numbers, as a continental spreadsheet writes them."""
    return text.replace(",", ";").replace(".", ",")


UNITS = "\n".join(["time_s;voltage_V;temperature_C", "s;V;°C", *ROWS, ""]).replace(",", ";")
DIALECTS: dict[str, tuple[str | bytes, str]] = {
    "semicolons": (PLAIN.replace(",", ";"), "semicolons"),
    "semicolons and decimal commas": (comma(PLAIN), "decimal commas"),
    "tabs": (PLAIN.replace(",", "\t"), "tabs"),
    "tabs and decimal commas": (comma(PLAIN).replace(";", "\t"), "decimal commas"),
    "bars": (PLAIN.replace(",", "|"), "bars"),
    "bars and decimal commas": (comma(PLAIN).replace(";", "|"), "decimal commas"),
    "a table of a web page": (
        "\n".join(f"| {line.replace(',', ' | ')} |" for line in [HEADER, "---,---,---", *ROWS]),
        "bars between columns",
    ),
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
    "spaces": (
        "\n".join(" ".join(f"{cell:>15}" for cell in row.split(",")) for row in [HEADER, *ROWS]),
        "spaces between columns",
    ),
    "spaces, the header a comment": ("\n".join([f"# {HEADER}", *ROWS]).replace(",", " "), "spaces between columns"),
    "a column of words": (
        "\n".join([f"mode,{HEADER}", *("RUN," + row for row in ROWS[:-1]), "STOP," + ROWS[-1]]),
        "a column without numbers, left aside: 'STOP'",
    ),
    "an empty column and a column of words": (
        "\n".join([f",{HEADER},state", *(f",{row},OK" for row in ROWS)]).replace(",", ";"),
        "2 columns without numbers, left aside: empty, 'OK'",
    ),
    "a column that is mostly empty": (
        "\n".join([f"{HEADER},a_C", *(f"{row},{'' if k % 9 else 1}" for k, row in enumerate(ROWS))]),
        "has empty cells, for its columns are read at different times",
    ),
    "a column that is mostly empty beside one of words": (
        "\n".join([f"{HEADER},a_C,frame", *(f"{row},{'' if k % 9 else 1},base" for k, row in enumerate(ROWS))]),
        "has empty cells, for its columns are read at different times",
    ),
    "UTF-16": (PLAIN.encode("utf-16"), "UTF-16"),
    "UTF-16, big end first": (b"\xfe\xff" + PLAIN.encode("utf-16-be"), "UTF-16"),
    "UTF-16 without its mark": (PLAIN.encode("utf-16-le"), "UTF-16"),
    "BOM, semicolons and a line of units": ("\ufeff" + UNITS, "line of units"),
    "BOM twice, semicolons": ("\ufeff\ufeff" + PLAIN.replace(",", ";"), "semicolons"),
    "Windows-1252": (UNITS.encode("cp1252"), "Windows-1252"),
    "noise of a board that starts": (
        b"\xff\x8c\x00l\xe3\r\n\x9e\x02rst\x00\r\n" + PLAIN.encode(),
        "first 2 lines are left",
    ),
    "noise that begins like UTF-16": (b"\xff\xfe\x00\x80garb\r\n" + PLAIN.encode(), "its first line is left"),
    "stamps of the Arduino terminal": (
        "\n".join(f"12:34:{k % 60:02d}.789 -> {line}" for k, line in enumerate([HEADER, *ROWS])),
        "a stamp of the terminal before every line",
    ),
    "stamps of a terminal in brackets": (
        "\n".join(f"[2024-05-01 12:34:{k % 60:02d}.789] {line}" for k, line in enumerate([HEADER, *ROWS])),
        "a stamp of the terminal before every line",
    ),
    "CRLF, tabs": (PLAIN.replace(",", "\t").replace("\n", "\r\n"), "tabs"),
}


def stamped(form: str, begin: str, zone: tuple[str, str] = ("", ""), header: str = HEADER, mark: str = ",") -> str:
    """The same rows with dates and times of day, the second half of them in another zone."""
    first, lines = datetime.fromisoformat(begin), [header.replace(",", mark)]
    for k, (t, row) in enumerate(zip(TIME, ROWS, strict=True)):
        at = first + timedelta(seconds=round(float(t), 2) + 3600.0 * (k >= 30) * bool(zone[0]))
        stamp = at.strftime(form).replace("FF", f"{at.microsecond // 10000:02d}")
        lines.append((f"{stamp}{zone[k >= 30]}" + row[row.index(",") :]).replace(",", mark))
    return "\n".join(lines)


NIGHT = "2024-12-31T23:59:58.5"  # the rows go past midnight, and into another year
STAMPS = {
    "ISO 8601": stamped("%Y-%m-%dT%H:%M:%S.FF", NIGHT),
    "ISO 8601, a change of zone": stamped("%Y-%m-%d %H:%M:%S.FF", NIGHT, ("+01:00", "+02:00")),
    "time of day": stamped("%H:%M:%S.FF", NIGHT),
    "date of Excel, AM and PM": stamped("%m/%d/%Y %I:%M:%S.FF %p", NIGHT),
    "day first, decimal commas": stamped("%d.%m.%Y %H:%M:%S.FF", NIGHT, mark=";").replace(".FF", ","),
    "a column for the date": stamped("%d.%m.%Y,%H:%M:%S.FF", NIGHT, header=f"Date,{HEADER}"),
    "quoted": stamped('"%Y-%m-%d %H:%M:%S.FF"', NIGHT),
    "tabs": stamped("%Y/%m/%d %H:%M:%S.FF", NIGHT, mark="\t"),
}


@pytest.mark.parametrize("case", STAMPS)
def test_dates_and_times_of_day_are_seconds_from_the_first(case: str, bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(STAMPS[case])
    assert status == 0, said
    assert "read as seconds from the first" in said
    np.testing.assert_allclose(columns["time_s"], TIME, atol=1e-9)
    np.testing.assert_allclose(columns["voltage_V"], VOLT, rtol=1e-12)


def test_a_broken_row_among_words_or_stamps_loses_no_rows(bench: Callable[..., tuple]) -> None:
    worded = [f"mode,{HEADER}", *("RUN," + row for row in ROWS)]
    lines = stamped("%H:%M:%S.FF", NIGHT).splitlines()
    for rows in (worded, lines):
        status, _, said = bench("\n".join([*rows[:20], rows[20][:8], *rows[21:]]))
        assert status == 2 and "line 21" in said, said


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


def test_commas_at_the_ends_of_some_rows_are_no_values(bench: Callable[..., tuple]) -> None:
    status, columns, said = bench("\n".join([HEADER, *(row + "," * (k % 3 > 0) for k, row in enumerate(ROWS))]))
    assert status == 0, said
    alike(columns)


def test_a_minus_of_typesetters_is_a_minus(bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(
        PLAIN.replace(HEADER, f"u,{HEADER}").replace("\n", "\n\u22121,").removesuffix("\u22121,")
    )
    assert status == 0, said
    alike(columns)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_plain_file_is_read_without_a_note(end: str, bench: Callable[..., tuple]) -> None:
    status, columns, said = bench(PLAIN.replace("\n", end).encode())
    assert status == 0 and "note" not in said
    alike(columns)


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
    "Siglent of two channels": (
        "Record Length,Analog:60,,,\nSample Interval,Analog:5.0E-02,,,\nVertical Units,CH1:V,CH2:V,,\nSource,CH1,CH2,\n"
        "Second,Volt,Volt\n" + "\n".join(rows_of(TIME, VOLT, HEAT)),
        'Source = "time_s"\nCH1 = "voltage_V"',
        "line of units",
    ),
    "a rule between names and units": (
        "time volt heat\n---- ---- ----\ns V degC\n" + "\n".join(rows_of(TIME, VOLT, HEAT, mark=" ")),
        'time = "time_s"\nvolt = "voltage_V"',
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
    "LabVIEW with an equal time each": (
        LVM.format(decimal=".", columns="Multi").replace("Volt\tHeat", "Volt\tX_Value\tHeat")
        + "\n".join(rows_of(TIME, VOLT, TIME, HEAT, mark="\t")),
        'Volt = "voltage_V"',
        "LabVIEW",
    ),
    "a serial plotter": (
        "\n".join(f"t_ms:{t * 1e3:.0f},u:{u:.9g},heat:{y:.9g}" for t, u, y in zip(TIME, VOLT, HEAT, strict=True)),
        't_ms = { name = "time_s", unit = "ms" }\nu = "voltage_V"',
        "a name before each value",
    ),
    "Keysight": (
        "x-axis,1,2\nsecond,Volt,Volt\n" + "\n".join(rows_of(TIME, VOLT, HEAT)),
        'x-axis = "time_s"\n1 = "voltage_V"',
        "line of units",
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
    "decimal commas in some of the columns": (
        "\n".join([HEADER, *(f"{0.01 * k:.4f},{k % 3},{0.3 * k:.3f}".replace(".", ",") for k in range(40))]),
        ("line 2", "'0000': decimal commas between commas", "export it with ;"),
    ),
    "thousands or fractions": (
        "time_s;voltage_V;a_V\n" + "\n".join(f"{k};1,{k + 100};2,{k + 200}" for k in range(40)),
        ("two ways", "1,100", "thousands"),
    ),
    "no header": ("\n".join(ROWS), ("has no header", "time_s, column_2, column_3")),
    "rows of an older run above the header": ("\n".join([*ROWS[:5], PLAIN]), ("line 6: is the header", "lines 1 to 5")),
    "a time of day": (PLAIN.replace("\n0.", "\n12:00:0."), ("line 2", "write seconds", "period_s")),
    "a header one name short": (
        "\n".join([HEADER, *(f"{k},{row}" for k, row in enumerate(ROWS))]),
        ("line 1: has 3 names above 4 values in every row", "keep the rows"),
    ),
    "no header, the first row torn in half": (
        "\n".join(["1.5,2", *(f"{row},{k}" for k, row in enumerate(ROWS))]),
        ("has no header: line 1, above its rows, is a row that is not whole", "a name for each of the 4 columns"),
    ),
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
        LVM.format(decimal=".", columns="Multi").replace("Volt\tHeat", "Volt\tX_Value\tHeat")
        + "\n".join(rows_of(TIME, VOLT, TIME + 0.01, HEAT, mark="\t")),
        ("a time column for each",),
    ),
    "a time that is mostly empty": (
        "\n".join([HEADER, *(f",{row.partition(',')[2]}" if k % 9 else row for k, row in enumerate(ROWS))]),
        ("column time_s is the time, but", "give the time between rows"),
    ),
    "a column of no numbers": ("\n".join([f"{HEADER},a", *(f"{row},nan" for row in ROWS)]), ("leave the column out",)),
    "words where numbers belong": (
        "\n".join([HEADER, *(row.replace(",", ",0x", 1) for row in ROWS)]),
        ("column voltage_V is no column of numbers, it holds '0x",),
    ),
    "the mark of an instrument for an overload": (
        PLAIN.replace(ROWS[7].split(",")[1], "9.91E+37"),
        ("line 9", "9.91e+37", "overload"),
    ),
    "digits of another script": (
        PLAIN.translate({ord(digit): 0x660 + int(digit) for digit in "0123456789"}),
        ("line 2, column time_s: is '", "write numbers there"),
    ),
    "a counter that wraps within two rows": (
        "\n".join([HEADER, *(f"{k * 0.05 % 0.065536:.6f},{row.partition(',')[2]}" for k, row in enumerate(ROWS))]),
        ("sorting would tear the recording", "recordings.period_s"),
    ),
    "another unit": (PLAIN.replace("voltage_V", "voltage_mV"), ('voltage_mV = { name = "voltage_V", unit = "mV" }',)),
    "one empty cell": (PLAIN.replace(ROWS[7], f"{ROWS[7].partition(',')[0]},,1"), ("line 9", "or delete the row")),
    "a line that is garbled": (
        PLAIN.encode().replace(ROWS[30].encode(), b"\xff\x00\x81"),
        ("line 32: is not text", "delete the line"),
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


def test_damaged_files_are_read_or_refused_but_break_nothing(tmp_path: Path) -> None:
    random = Random(7)
    seeds = [each[0] for cases in (DIALECTS, EXPORTS, REFUSED) for each in cases.values()]
    read = 0
    for _ in range(600):
        content = bytearray(seed.encode() if isinstance(seed := random.choice(seeds), str) else seed)
        for _ in range(random.randint(1, 6)):
            at = random.randrange(len(content) + 1)
            change = random.randrange(4)
            if change == 0:
                content[at : at + 1] = random.choice(
                    [b",", b";", b"\t", b'"', b"\n", b"\r", b"\x00", b"\xff", b"e", b"["]
                )
            elif change == 1:
                del content[at : at + random.randint(1, 40)]
            elif change == 2:
                content[at:at] = content[at // 2 : at // 2 + random.randint(1, 60)]
            else:
                del content[at:]
        (tmp_path / "r.csv").write_bytes(bytes(content))
        try:
            read += len(read_recording(tmp_path / "r.csv", {"TIME": Column("time_s")}).time) >= 3
        except IdentifyError as refused:
            assert str(tmp_path) in str(refused)
    assert read > 10
