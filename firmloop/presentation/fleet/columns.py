"""Write the figures of a fleet as a table, a row for each figure of each recording: CSV, and Parquet where it can."""

from __future__ import annotations

import csv
import importlib
import importlib.util
import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from firmloop.stages.fleet.compare import Compared
    from firmloop.stages.fleet.member import Estimated, Member

TEXTS = ("machine", "recording", "verdict", "effects", "figure", "unit")
NUMBERS = ("value", "deviation", "beside_effects", "median", "z")
COLUMNS = (*TEXTS, *NUMBERS)


def fleet_rows(members: Sequence[Member], compared: Compared) -> list[Mapping[str, str | float | None]]:
    """Return the rows by column; None is what is not known."""
    typical = {one.figure: one for one in compared.typical}
    rows: list[Mapping[str, str | float | None]] = []
    for one in members:
        common = {
            "machine": one.machine,
            "recording": one.name,
            "verdict": one.verdict,
            "effects": " + ".join(one.effects),
        }
        figures: Mapping[str, Estimated | None] = one.figures or {"": None}
        for figure, each in figures.items():
            row: dict[str, str | float | None] = dict.fromkeys(COLUMNS)
            row |= {**common, "figure": figure, "unit": ""}
            if each is not None:
                beside = one.beside.get(figure)
                row |= {"unit": each.unit, "value": each.value, "deviation": each.deviation}
                row["beside_effects"] = beside.value if beside else None
            if each is not None and figure in typical:
                row |= {"median": typical[figure].centre, "z": typical[figure].z(each)}
            rows.append(row)
    return rows


def fleet_csv(members: Sequence[Member], compared: Compared) -> str:
    """Return fleet.csv."""
    stream = io.StringIO()
    table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(fleet_rows(members, compared))
    return stream.getvalue()


def fleet_parquet(members: Sequence[Member], compared: Compared) -> bytes | None:
    """Return fleet.parquet; None where pyarrow is not installed."""
    if importlib.util.find_spec("pyarrow") is None:
        return None
    arrow: Any = importlib.import_module("pyarrow")
    parquet: Any = importlib.import_module("pyarrow.parquet")
    rows = fleet_rows(members, compared)
    types = {**dict.fromkeys(TEXTS, arrow.string()), **dict.fromkeys(NUMBERS, arrow.float64())}
    columns = {name: arrow.array([row[name] for row in rows], types[name]) for name in COLUMNS}
    stream = io.BytesIO()
    parquet.write_table(arrow.table(columns), stream)
    return stream.getvalue()
