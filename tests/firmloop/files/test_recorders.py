"""Exports of recorders and scopes whose settings, stamps or terminals tell the time read like the plain file."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

import numpy as np
import pytest

from tests.firmloop.columns.plain_file import HEADER, HEAT, PLAIN, ROWS, TIME, VOLT, rows_of


def joined(head: str, *columns: np.ndarray, mark: str = ",", begin: str = "", end: str = "") -> str:
    """The lines of `head`, and rows with what stands before and behind each."""
    return "\n".join([head, *(begin + row for row in rows_of(*columns, mark=mark, end=end))])


def clocked(form: str, begin: str = "2024-05-01T23:59:58") -> list[str]:
    """One stamp a row, with FFF for its milliseconds."""
    at = [datetime.fromisoformat(begin) + timedelta(seconds=round(float(t), 2)) for t in TIME]
    return [each.strftime(form).replace("FFF", f"{each.microsecond // 1000:03d}") for each in at]


def beside(form: str, mark: str) -> list[str]:
    """Rows of a recorder: a number, the stamp, the values and two words."""
    rows = zip(clocked(form), rows_of(VOLT, HEAT, mark=mark), strict=True)
    return [f"{k}{mark}{at}{mark}{row}{mark}LLLLLLLLLL{mark}LLLL" for k, (at, row) in enumerate(rows)]


def quoted(row: str) -> str:
    """The same with a comma in each value."""
    return ",".join(f'"{cell.replace(".", ",")}"' if "." in cell else cell for cell in row.split(","))


def equal(columns: dict[str, np.ndarray], volt: str) -> None:
    """What is simulated keeps the name that the file has for its input, unless its unit is another."""
    np.testing.assert_allclose(columns["time_s"], TIME, atol=1e-6)
    np.testing.assert_allclose(columns[volt if volt in columns else "voltage_V"], VOLT, rtol=1e-9)


COUNT = np.arange(60)
YOKOGAWA = (
    '"Model Name","DL850EV"\n"BlockNumber",1\n"TraceName","CH1","CH2"\n"BlockSize",60,60\n"VUnit","V","degC"\n'
    '"HResolution",5.0E-02,5.0E-02\n"HOffset",0.0E+00,0.0E+00\n"HUnit","s","s"\n"Date","2024/05/01"\n'
    '"Time","12:00:00.000"\n'
)
HANTEK = "# CHANNEL:{}\n# CLOCK=50.0mS\n# SIZE=60\n# UNITS:V\n"
INFINIIUM = (
    "Revision:,0\nType:,Raw\nPoints:,60\nXInc:,5.00000000E-02\nXOrg:,0.0E+00\nXUnits:,second\nYUnits:,Volt\n"
    "Date:,01 MAY 2024\nTime:,12:00:00:00\nData:"
)
FLUKE = (
    "Title,Input A\nID,1\nType,Waveform\nDate,5/1/2024\nX At 0%,0.0\nX Resolution,5.0E-02\nX Size,60\nX Unit,s\n"
    "Y Resolution,0.04\nY Unit,V\nY Counter,1"
)
GRAPHTEC = (
    "Vendor,GRAPHTEC Corporation\nModel,GL820\nSampling,50ms\nStart time,2024-05-01,23:59:58\nAMP Settings\n"
    'CH,Signal name,Input,Range,Filter,Span\nCH1, " CH 1",DC,5V,5,70.0,20.0,V\nData\n'
    "Number,Date&Time,ms,CH1,CH2,Alarm1-10,AlarmOut\nNO.,Time,ms,V,degC,A1234567890,A1234"
)
OWON = "Channel   :,CH1\nPK-PK   :,Vpp=1.2V\nTime interval   :,50.00mS\n\nindex,CH1_Voltage(mV)"
LECROY = (
    "LECROYWR64Xi-A,51244,Waveform\nSegments,1,SegmentSize,60\nSegment,TrigTime,TimeSinceSegment1\n"
    "#1,01-May-2024 14:17:14,0     \nTime,Ampl"
)
GRAPHTEC_980 = "Vendor,GRAPHTEC Corporation\nSampling interval,50ms\nData\nNumber,Date,Time,ms,CH3,CH4,Alarm,AlarmOut"
ALMEMO = [f"{at};{v:+.3f};{h:+.3f}" for at, v, h in zip(clocked("%H:%M:%S.FFF"), VOLT, HEAT, strict=True)]
NIGHTS = ['"01.05.24"' if t < 2.0 else '"02.05.24"' for t in TIME]
ROS = "header.stamp.sec,header.stamp.nanosec,header.frame_id,u,y"
SINCE_1970 = [
    f"{1714550400 + int(t)},{round(t % 1 * 1e9)},base,{v},{h}" for t, v, h in zip(TIME, VOLT, HEAT, strict=True)
]
# file, what is voltage_V, what is time_s where the file does not say so itself, what is told
RECORDERS: dict[str, tuple[str, str, str, str]] = {
    "Yokogawa": (joined(YOKOGAWA, VOLT, HEAT, begin=","), "CH1", "", "0.05 s a row"),
    "Yokogawa, a comma at each end": (
        joined(YOKOGAWA.replace('"', "").replace("\n", ",\n"), VOLT, HEAT, begin=",", end=","),
        "CH1",
        "",
        "0.05 s a row",
    ),
    "Yokogawa with the times": (joined(YOKOGAWA, TIME, VOLT, HEAT), "CH1", "", "settings"),
    "Hantek, one channel": (joined("#CHANNEL:CH1\n#CLOCK=0.05S\n#UNITS:V\n", VOLT), "CH1", "", "0.05 s a row"),
    "Hantek, two below one another": (
        joined(HANTEK.format("CH1"), VOLT) + "\n\n" + joined(HANTEK.format("CH2"), HEAT),
        "CH1",
        "",
        "2 blocks of rows one below the other",
    ),
    "Hantek without names": (joined("#CLOCK=50mS\n#SIZE=60\n#VOLTDIV=5", HEAT, VOLT), "column_2", "", "settings"),
    "Owon": (joined(OWON, COUNT, VOLT * 1e3), "CH1_Voltage(mV)", "", "0.05 s a row"),
    "Agilent Infiniium": (joined(INFINIIUM, VOLT), "column_1", "", "0.05 s a row"),
    "Agilent InfiniiVision with a calculated channel": (
        joined("x-axis,1,MATH\nsecond,Volt,Ampere", TIME, VOLT, HEAT),
        "1",
        "x-axis",
        "line of units",
    ),
    "Fluke": (joined(FLUKE, TIME, VOLT), "Input A", "", "settings"),
    "LeCroy": (joined(LECROY, TIME, VOLT), "Ampl", "Time", "the header is line 5"),
    "Rohde & Schwarz": (joined("in s,CH1 in V,CH2 in V", TIME, VOLT, HEAT), "CH1 in V", "in s", ""),
    "Rigol with times": (joined("Time(s),CH1V,CH2V,", TIME, VOLT, HEAT, end=","), "CH1V", "Time(s)", "delimiter"),
    "PicoScope": (joined("Time,Channel A,Channel B\n(ms),(V),(V)\n", TIME * 1e3, VOLT, HEAT), "Channel A", "Time", ""),
    "Graphtec": ("\n".join([GRAPHTEC, *beside("%Y-%m-%d %H:%M:%S,FFF", ",")]), "CH1", "Date&Time", "in the column ms"),
    "Graphtec, quoted decimal commas": (
        "\n".join([GRAPHTEC_980, *(quoted(row) for row in beside("%d/%m/%Y,%H:%M:%S,FFF", ","))]),
        "CH3",
        "Time",
        "decimal commas",
    ),
    "Almemo": (
        "\n".join(
            ['"ALMEMO";"BEREICH:";"DIGI";"NTC"\n"DATUM:";"ZEIT:";"M00: V";"M01: \u00b0C"']
            + [f"{'' if 0 < k < 40 else at};{row}" for k, (at, row) in enumerate(zip(NIGHTS, ALMEMO, strict=True))]
        ),
        "M00: V",
        "ZEIT:",
        "read as seconds from the first",
    ),
    "a header of ROS": ("\n".join([ROS, *SINCE_1970]), "u", "header.stamp.sec", "added to header.stamp.sec"),
    "Tektronix with a column that is empty": (
        joined("Model,TBS1102B\nSample Interval,5.0E-02\nLabel,\nTIME,CH1,CH1 Peak Detect", TIME, VOLT, end=","),
        "CH1",
        "TIME",
        "the header is line 4",
    ),
    "a rate above the names": (joined("# Sample rate: 20 Hz\nu,temp", VOLT, HEAT), "u", "", "0.05 s a row"),
    "an interval in German": (
        joined("Abtastintervall;0,05\nu;temp", VOLT, HEAT, mark=";").replace(".", ","),
        "u",
        "",
        "0.05 s a row",
    ),
    "PuTTY": (f"=~=~=~= PuTTY log 2024.05.01 14:24:47 =~=~=~=\n{PLAIN}", "voltage_V", "", "the header is line 2"),
    "a separator for spreadsheets": (
        f"sep=;\n{PLAIN.replace(',', ';').replace('.', ',')}",
        "voltage_V",
        "",
        "decimal commas",
    ),
}
SHORT = "u,temp"
VALUES = [row.partition(",")[2] for row in ROWS]
STAMPED: dict[str, list[str]] = {
    "a header too": [f"{at} -> {line}" for at, line in zip(clocked("%H:%M:%S.FFF"), VALUES, strict=True)],
    "brackets": [f"[{at}] {line}" for at, line in zip(clocked("%Y-%m-%d %H:%M:%S.FFF"), VALUES, strict=True)],
    "tabs": [f"{at} -> {line}".replace(",", "\t") for at, line in zip(clocked("%H:%M:%S.FFF"), VALUES, strict=True)],
    "a date and a blank": [f"{at} {line}" for at, line in zip(clocked("%Y-%m-%d %H:%M:%S.FFF"), VALUES, strict=True)],
    "names before the values": [
        f"{at} -> u:{line.replace(',', ',temp:')}" for at, line in zip(clocked("%H:%M:%S.FFF"), VALUES, strict=True)
    ],
}
DATES = {
    "a year of two digits": "%d.%m.%y %H:%M:%S.FFF",
    "milliseconds behind a colon": "%d.%m.%Y %H:%M:%S:FFF",
    "day first in a column of its own": "%d.%m.%Y,%H:%M:%S.FFF",
    "milliseconds in a column of their own": "%Y-%m-%d,%H:%M:%S,FFF",
}
Bench = Callable[..., tuple[int, dict[str, np.ndarray], str]]


def renamed(volt: str, time: str) -> str:
    """The lines of [recordings.rename] for the columns that are voltage_V and time_s; blank where none is needed."""
    unit = ', unit = "mV"' if "(mV)" in volt else ""
    units = "" if volt == "voltage_V" else f'"{volt}" = {{ name = "voltage_V"{unit} }}\n'
    units += f'"{time}" = "time_s"\n' if time else ""
    return f"[recordings.rename]\n{units}" if units else ""


@pytest.mark.parametrize("maker", RECORDERS)
def test_a_recorders_export_reads_like_the_plain_file(maker: str, bench: Bench) -> None:
    content, volt, time, told = RECORDERS[maker]
    status, columns, said = bench(content, renamed(volt, time))
    assert status == 0, said
    assert told in said
    equal(columns, volt)


@pytest.mark.parametrize("way", STAMPED)
@pytest.mark.parametrize("head", ["", "[2024-05-01 23:59:58.000] "])
def test_the_stamps_of_a_terminal_are_the_time_where_no_column_is(way: str, head: str, bench: Bench) -> None:
    header = [] if way.startswith("names") else [head + (SHORT.replace(",", "\t") if way == "tabs" else SHORT)]
    content = "\n".join([*header, *STAMPED[way]])
    status, _, said = bench(content, '[recordings.rename]\nu = "voltage_V"')
    assert status == 2 and 'stamp = { name = "time_s", unit = "s" }' in said, said
    status, columns, said = bench(content, '[recordings.rename]\nu = "voltage_V"\nstamp = "time_s"')
    assert status == 0, said
    assert "a stamp of the terminal before every line, which is in the column stamp" in said
    equal(columns, "u")


@pytest.mark.parametrize("way", DATES)
def test_dates_and_times_in_other_ways_are_seconds_from_the_first(way: str, bench: Bench) -> None:
    form = DATES[way]
    head = "Datum," * (form.count(",") > 0) + HEADER.replace(",", ",ms,", form.endswith(",FFF"))
    rows = [f"{at},{line}" for at, line in zip(clocked(form), VALUES, strict=True)]
    status, columns, said = bench("\n".join([head, *rows]))
    assert status == 0, said
    equal(columns, "voltage_V")
    assert "Datum" not in columns


def test_minutes_beside_a_date_are_no_seconds(bench: Bench) -> None:
    rows = [f"2024-05-01 {12 + k // 60}:{k % 60:02d},{line}" for k, line in enumerate(VALUES)]
    status, columns, said = bench("\n".join([HEADER, *rows]))
    assert status == 0, said
    np.testing.assert_allclose(columns["time_s"], 60.0 * COUNT)


def test_a_reading_beyond_the_range_of_a_scope_is_told_as_one(bench: Bench) -> None:
    lines = joined("Time,Channel A\n(s),(V)\n", TIME, VOLT).splitlines()
    lines[12] = lines[12].partition(",")[0] + ",\u221e"
    names = '[recordings.rename]\nTime = "time_s"\n"Channel A" = "voltage_V"'
    status, _, said = bench("\n".join(lines), names)
    assert status == 2
    assert "line 13, column voltage_V: is inf, which stands for an overload" in said


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (joined(HANTEK.format("CH1"), VOLT) + "\n" + joined(HANTEK.format("CH1"), HEAT), "line 71: is the first row"),
        (joined(YOKOGAWA.replace("5.0E-02,5.0E-02", "5.0E-02,1.0E-02"), VOLT, HEAT, begin=","), "0.01 s and 0.05 s"),
    ],
)
def test_blocks_and_rates_that_do_not_go_together_are_refused(content: str, told: str, bench: Bench) -> None:
    status, _, said = bench(content)
    assert status == 2 and told in said and "file of its own" in said


def test_two_rows_that_are_exchanged_where_a_file_begins_are_no_recording(bench: Bench) -> None:
    status, _, said = bench("\n".join([HEADER, ROWS[1], ROWS[0], *ROWS[2:]]))
    assert status == 2
    assert "sort the rows by time if the logger has swapped them" in said and "begins anew" not in said
