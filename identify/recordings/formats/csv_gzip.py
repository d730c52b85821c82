"""Read comma-separated text packed by gzip."""

from __future__ import annotations

import zlib

from firmloop.identify.recordings.extent import unzipped
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.formats.csv_text import read_csv
from firmloop.identify.recordings.table import Misread, RawTable


def read_csv_gzip(content: bytes) -> RawTable | Misread:
    """Unpack, then parse as CSV."""
    try:
        text = unzipped(content)
    except (EOFError, zlib.error) as error:
        return Misread("", f"is not a complete gzip file ({error})", "pack it again with gzip, or give the plain .csv")
    return text if isinstance(text, Misread) else read_csv(text)


FORMAT = Format((".csv.gz",), read_csv_gzip)
