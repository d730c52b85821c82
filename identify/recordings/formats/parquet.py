"""Read Parquet tables through pyarrow, which is installed on request only."""

from __future__ import annotations

import io

import numpy as np

from firmloop.identify.extras import extra
from firmloop.identify.recordings.extent import MOST_BYTES, is_too_large
from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.table import Misread, RawTable, table_of_arrays


def read_parquet(content: bytes) -> RawTable | Misread:
    """Take every column as numbers; a missing value becomes NaN and is refused later with its row."""
    arrow = extra("pyarrow", "parquet", "a Parquet table")
    parquet = extra("pyarrow.parquet", "parquet", "a Parquet table")
    try:
        claims = parquet.ParquetFile(io.BytesIO(content)).metadata
        groups = [claims.row_group(k).total_byte_size for k in range(claims.num_row_groups)]
        size = max(sum(groups), 8 * claims.num_rows * claims.num_columns)
        if size > MOST_BYTES:
            return is_too_large(size)
        table = parquet.read_table(io.BytesIO(content))
        arrays = tuple((str(name), np.asarray(table.column(name).to_numpy())) for name in table.column_names)
    except (OSError, ValueError, TypeError, KeyError, arrow.ArrowException) as error:
        reason = str(error).partition("\n")[0][:80]
        return Misread("", f"is not a Parquet table ({reason})", "write it again, or save as CSV")
    return table_of_arrays(arrays)


FORMAT = Format((".parquet", ".pq"), read_parquet)
