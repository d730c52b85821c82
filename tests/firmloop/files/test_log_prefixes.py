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
