"""A text whose marks do not fit is refused by what stands in it: the mark, the column, the cell as it is written."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.firmloop.columns.plain_file import HEADER, HEAT, PLAIN, ROWS, TIME, VOLT, alike, rows_of

STAMPED = [f"00:{t:04.1f};{row}" for t, row in zip(10 * TIME, rows_of(VOLT, HEAT, mark=";"), strict=True)]
GROUPED = [f"{t:.3f};{u:.3f};{k + 1},{567 + k},{k:02d}" for k, (t, u) in enumerate(zip(TIME, VOLT, strict=True))]
SEMICOLONS = PLAIN.replace(",", ";")
REFUSED = {
    "minutes and seconds": (
        "\n".join(["t;voltage_V;temperature_C", *STAMPED]),
        "line 2, column t: is '00:00.0', not a number; write seconds",
    ),
    "minutes, seconds and decimal commas": (
        "\n".join(["t;voltage_V;temperature_C", *STAMPED]).replace(".", ","),
        "line 2, column t: is '00:00,0', not a number; write seconds",
    ),
    "minutes and seconds between tabs": (
        "\n".join(["t;voltage_V;temperature_C", *STAMPED]).replace(";", "\t"),
        "line 2, column t: is '00:00.0', not a number; write seconds",
    ),
    "commas for thousands and for the fraction": (
        "\n".join([SEMICOLONS.splitlines()[0], *(row.replace(".", ",") for row in GROUPED)]),
        "column temperature_C: is '1,567,00', not a number: only one of its marks can be the decimal one; save the "
        "file without marks for thousands; keep the rows",
    ),
    "a header with another mark": (
        "\n".join([HEADER, *(row.replace(",", ";") for row in ROWS)]),
        "line 1: is the header and has commas between its names, where rows have semicolons; write the same between "
        "names: time_s;voltage_V;temperature_C; keep the rows",
    ),
    "a header with another mark, delimiters at the ends": (
        "\n".join([HEADER, *(row.replace(",", ";").replace(".", ",") + ";;" for row in ROWS)]),
        "line 1: is the header and has commas between its names, where rows have semicolons",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_marks_that_do_not_fit_are_named_as_the_file_has_them(case: str, bench: Callable[..., tuple]) -> None:
    content, words = REFUSED[case]
    status, _, said = bench(content)
    assert status == 2 and words in said, said


@pytest.mark.parametrize("header", [HEADER.replace(",", ";"), HEADER.replace(",", ";") + ";;"])
def test_several_delimiters_at_every_end_lose_no_column(header: str, bench: Callable[..., tuple]) -> None:
    rows = [row.replace(",", ";").replace(".", ",") + ";;" for row in ROWS]
    status, columns, said = bench("\n".join([header, *rows]))
    assert status == 0 and "every line ends with delimiters; no column is lost" in said, said
    alike(columns)


def test_points_for_thousands_beside_decimal_commas_are_read(bench: Callable[..., tuple]) -> None:
    heat = 1000.0 * HEAT
    cells = [f"{y:,.2f}".translate({44: 46, 46: 44}) for y in heat]
    rows = [f"{t:.2f};{u:.3f};".replace(".", ",") + y for t, u, y in zip(TIME, VOLT, cells, strict=True)]
    status, columns, said = bench("\n".join([HEADER.replace(",", ";"), *rows]))
    assert status == 0, said
    alike(columns)


@pytest.mark.parametrize("mark", [",", ";"])
def test_a_one_in_a_line_of_units_is_a_unit(mark: str, bench: Callable[..., tuple]) -> None:
    share = np.round(0.5 + 0.4 * np.sin(TIME), 4)
    header, units = f"t{mark}u{mark}temperature_C{mark}voltage_V", f"s{mark}1{mark}°C{mark}V"
    content = "\n".join([header, units, *rows_of(TIME, share, HEAT, VOLT, mark=mark)])
    status, columns, said = bench(content, '[recordings.rename]\nt = "time_s"\nu = "heater_percent"')
    assert status == 0 and "which is taken: s, 1, °C, V" in said, said
    assert "u is converted from 1 by its line of units" in said
    np.testing.assert_allclose(columns["u"], 100.0 * share, rtol=1e-12)


def test_percent_that_begins_a_line_of_units_is_no_sign_of_a_comment(bench: Callable[..., tuple]) -> None:
    content = "\n".join(["u,time_s,temperature_C,voltage_V", "%,s,°C,V", *rows_of(50 * HEAT, TIME, HEAT, VOLT)])
    status, _, said = bench(content, '[recordings.rename]\nu = "heater_percent"')
    assert status == 0 and "which is taken: %, s, °C, V" in said, said
