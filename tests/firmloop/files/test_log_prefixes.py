"""What a logging library or a terminal puts before every line, and sums to check lines by, are no part of the table."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.firmloop.columns.plain_file import HEADER, PLAIN, ROWS, alike

LINES = [HEADER, *ROWS]
SPACED = [HEADER.replace("temperature_C", "Temperature of the block (C)"), *ROWS]
PREFIXED = {
    "ESP-IDF": [f"I ({312 + k}) LOG: {line}" for k, line in enumerate(LINES)],
    "ESP-IDF in colours": [f"\x1b[0;32mI ({312 + k}) LOG: {line}\x1b[0m" for k, line in enumerate(LINES)],
    "ESP-IDF that says something else, too": [
        "I (290) wifi: state: run",
        *(f"I ({312 + k}) LOG: {line}" for k, line in enumerate(LINES)),
        "I (900) main: done",
    ],
    "Zephyr": [f"[00:00:{k:02d}.210,000] <inf> main: {line}" for k, line in enumerate(LINES)],
    "Python": [f"2024-05-01 12:00:{k:02d},310 INFO {line}" for k, line in enumerate(LINES)],
    "Python with dashes": [f"2024-05-01 12:00:{k:02d},310 - root - INFO - {line}" for k, line in enumerate(LINES)],
    "Python without a stamp": [f"INFO:root:{line}" for line in LINES],
    "a word": [f"DATA: {line}" for line in LINES],
    "a word before rows alone": [HEADER, *(f"DATA: {line}" for line in ROWS)],
    "a prompt": [f"motor> {line}" for line in LINES],
    "a prompt without a word": [f"> {line}" for line in LINES],
    "a prompt before rows alone": [HEADER, *(f">>> {line}" for line in ROWS)],
    "names with blanks": [f"I ({312 + k}) LOG: {line}" for k, line in enumerate(SPACED)],
    "semicolons": [f"DATA: {line}".replace(",", ";") for line in LINES],
    "blanks": [f"DATA: {line}".replace(",", " ") for line in LINES],
}


@pytest.mark.parametrize("case", PREFIXED)
def test_what_a_log_puts_before_each_line_is_left_aside(case: str, bench: Callable[..., tuple]) -> None:
    content = "\n".join(PREFIXED[case])
    rename = (
        '[recordings.rename]\n"Temperature of the block (C)" = "temperature_C"' if "Temperature of" in content else ""
    )
    status, columns, said = bench(content, rename)
    assert status == 0, said
    alike(columns)
    assert "what a log puts before each line, left aside" in said


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_column_of_words_is_no_prefix(mark: str, bench: Callable[..., tuple]) -> None:
    lines = [f"mode,{HEADER}", *(f"in state RUN,{row}" for row in ROWS)]
    status, columns, said = bench("\n".join(line.replace(",", mark) for line in lines))
    assert status == 0 and "what a log puts" not in said, said
    assert "a column without numbers, left aside: 'in state RUN' (mode)" in said
    alike(columns)


@pytest.mark.parametrize("name", ["", "sum"])
def test_a_sum_that_checks_each_line_is_no_column(name: str, bench: Callable[..., tuple]) -> None:
    rows = [f"{row},*{37 * k % 256:02X}" for k, row in enumerate(ROWS)]
    status, columns, said = bench("\n".join([f"{HEADER},{name}", *rows]))
    assert status == 0, said
    alike(columns)
    assert "a column without numbers, left aside" in said
    assert len(columns) == len(PLAIN.split("\n")[0].split(","))


FRAMED = {
    "a list": ("[{}]", ", "),
    "a list of numpy": ("[{}]", "  "),
    "a tuple": ("({})", ", "),
    "markers of a serial line": ("<{}>", ","),
    "a beginning": ("${};", ";"),
    "a sum at the end": ("${}*5A", ","),
}


@pytest.mark.parametrize("case", FRAMED)
@pytest.mark.parametrize("header", [True, False], ids=["header, too", "rows alone"])
def test_marks_around_each_row_are_left_aside(case: str, header: bool, bench: Callable[..., tuple]) -> None:
    frame, mark = FRAMED[case]
    name = (frame if header else "{}").format(HEADER.replace(",", mark))
    status, columns, said = bench("\n".join([name, *(frame.format(row.replace(",", mark)) for row in ROWS)]))
    assert status == 0, said
    alike(columns)
    assert "around its rows, left aside" in said


@pytest.mark.parametrize("place", [0, 1, -1])
def test_words_between_blanks_are_a_column_left_aside(place: int, bench: Callable[..., tuple]) -> None:
    def line(text: str, word: str) -> str:
        cells = text.split(",")
        cells.insert(len(cells) if place < 0 else place, word)
        return " ".join(cells)

    status, columns, said = bench("\n".join([line(HEADER, "state"), *(line(row, "RUN") for row in ROWS)]))
    assert status == 0, said
    alike(columns)
    assert "a column without numbers, left aside: 'RUN' (state)" in said


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["Booting v1.2", *ROWS], "no header: line 1, above its rows, names no columns: 'Booting v1.2'; write one"),
        ([HEADER.replace(",", " "), *ROWS], "line 1: is the header and has spaces between its names, where rows have"),
        ([HEADER, *(f"{row.rpartition(',')[0]},{300 + k:x}" for k, row in enumerate(ROWS))], "looks hexadecimal"),
    ],
)
def test_no_row_is_blamed_for_what_is_wrong_in_all(lines: list[str], words: str, bench: Callable[..., tuple]) -> None:
    status, _, said = bench("\n".join(lines))
    assert status == 2 and words in said, said
    assert "delete" not in said


@pytest.mark.parametrize("sign", [" ", "[", ">", "*5A"])
def test_a_line_of_many_marks_is_refused_at_once(sign: str, bench: Callable[..., tuple]) -> None:
    """A pattern that tries every split of 20,000 blanks took minutes."""
    status, _, said = bench("\n".join([HEADER, *(f"1,2{sign * 20000}x" for _ in range(3))]))
    assert status == 2 and "line 1: has 3 names above 2 values in every row" in said
