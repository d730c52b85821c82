"""Readings that have their unit behind them in every cell read like the plain file, or one sentence says the cure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.plain_file import HEADER, HEAT, TIME, VOLT, alike

NAMES = "t,u,temp"
OURS = '[recordings.rename]\nt = "time_s"\nu = "voltage_V"\ntemp = "temperature_C"'


def written(row: str, mark: str = ",", names: str = NAMES) -> str:
    """A row for each sample, with its time, voltage and temperature as a, b and c."""
    rows = (row.format(a=a, b=b, c=c) for a, b, c in zip(TIME, VOLT, HEAT, strict=True))
    return "\n".join([names.replace(",", mark), *rows, ""])


def ranging(volt: float) -> str:
    return f"{volt:.3f} V" if abs(volt) > 1.0 else f"{volt * 1e3:.0f} mV"


LINES = {
    "commas": written("{a:.2f} s,{b:.3f} V,{c:.3f} \u00b0C"),
    "semicolons and decimal commas": written("{a:.2f} s;{b:.3f} V;{c:.3f} \u00b0C", ";").replace(".", ","),
    "tabs": written("{a:.2f}s\t{b:.3f}V\t{c:.3f}\u00b0C", "\t"),
    "quoted decimal commas": written('"{a:.2f} s";"{b:.3f} V";"{c:.3f} \u00b0C"').replace(".", ",").replace(";", ","),
    "blanks": written("{a:.2f}s {b:.3f}V {c:.3f}degC", " "),
    "blanks before the units, too": written("{a:.2f} s {b:.3f} V {c:.3f} degC", " "),
    "exponents": written("{a:.6e} s;{b:.6e} V;{c:.3e} K".replace(" K", " \u00b0C"), ";"),
    "an instrument": written("{a:+.5E}SEC;{b:+.6E}VDC;{c:+.5E}Celsius", ";"),
    "blanks that do not break": written("{a:.2f}\u00a0s;{b:.3f}\u00a0V;{c:.3f}\u00a0\u00b0C", ";"),
    "brackets": written("{a:.2f} [s],{b:.3f} [V],{c:.3f} [degC]"),
    "other units": written("{a:.6f} s,{b:.6f} V,{c:.3f} \u00b0C").replace(" V", "e3 mV"),
    "one column": written("{a:.2f},{b:.3f} V,{c:.3f}"),
    "lines above": f"Logger 3\nfirmware 1.2\n\n{written('{a:.2f} s,{b:.3f} V,{c:.3f} degC')}",
    "a meter that changes its range": "\n".join(
        [NAMES, *(f"{a:.2f} s,{ranging(b)},{c} degC" for a, b, c in zip(TIME, VOLT, HEAT, strict=True))]
    ),
    "objects": "\n".join(
        json.dumps({"t": f"{a:.2f} s", "u": f"{b} V", "temp": f"{c} degC"})
        for a, b, c in zip(TIME, VOLT, HEAT, strict=True)
    ),
}
Bench = Callable[..., tuple[int, dict[str, np.ndarray], str]]


@pytest.mark.parametrize("way", LINES)
def test_readings_with_their_unit_read_like_the_plain_file(way: str, bench: Bench) -> None:
    status, columns, said = bench(LINES[way], OURS)
    assert status == 0, said
    assert "a unit behind each reading, which is taken" in said
    alike(columns, volt="u")


def test_a_name_in_another_unit_than_its_readings_is_refused_with_the_line(bench: Bench) -> None:
    status, _, said = bench(written("{a},{b} mV,{c}", names=HEADER))
    assert status == 2 and 'voltage_V = { name = "voltage_V", unit = "mV" }' in said, said
    status, columns, said = bench(
        written("{a},{b} mV,{c}", names=HEADER), '[recordings.rename]\nvoltage_V = { name = "voltage_V", unit = "mV" }'
    )
    assert status == 0, said
    np.testing.assert_allclose(columns["voltage_V"], VOLT / 1e3)


SLIPS = {
    "no unit": (" V", "", "is '1.137' in column 2, without the unit of its other readings, V; write V behind it"),
    "another kind": (" V", " A", "is in A, and the first reading of column 2 in V; write one quantity a column"),
    "an overload": ("1.137 V", "OL V", "column u: is 'OL', not a number"),
    "a torn row": (",1.137 V,", ",", "has 2 values where the header names 3 columns"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_reading_that_is_unlike_the_others_is_named(slip: str, bench: Bench) -> None:
    lines = LINES["commas"].splitlines()
    place = next(k for k, line in enumerate(lines) if ",1.137 V" in line)
    one, other, told = SLIPS[slip]
    lines[place] = lines[place].replace(one, other)
    status, _, said = bench("\n".join(lines), OURS)
    assert status == 2 and f"line {place + 1}" in said and told in said, said


def test_a_row_torn_at_the_end_keeps_the_units_of_the_others(bench: Bench) -> None:
    status, _, said = bench(LINES["commas"] + "3.00 s,1.2", OURS)
    assert status == 2 and "line 62: has 2 values where the header names 3 columns" in said, said


@pytest.mark.parametrize("behind", ["counts", "k", "ticks"])
def test_what_is_no_unit_behind_the_numbers_is_told_with_a_cure_that_keeps_them(
    behind: str, bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cure = "take out what stands behind its numbers, and give what it stands for as unit or scale in [recordings.rename"
    text = written(f"{{a}},{{b}} {behind},{{c}}")
    status, _, said = bench(text, OURS)
    assert status == 2 and f"{behind}'; {cure}" in said, said
    (tmp_path / "a.csv").write_text(text)
    assert main(["init", str(tmp_path / "a.csv"), "--out", str(tmp_path / "p.toml")]) == 2
    assert cure in capsys.readouterr().err
    status, columns, said = bench(
        text.replace(f" {behind}", ""), OURS.replace('u = "voltage_V"', 'u = { name = "voltage_V", scale = 1000 }')
    )
    assert status == 0, said
    np.testing.assert_allclose(columns["u" if "u" in columns else "voltage_V"], 1e3 * VOLT)
