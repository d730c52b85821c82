"""Tell in words what was generated."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from firmloop.stages.making import Generated
    from firmloop.verify.proofs.limit_cycles import AtRest, ZeroInput


def quantity(value: float, unit: str, endless: str = "no limit") -> str:
    """Write a figure that is known to three digits; `endless` says what it means that there is no end to it."""
    if math.isnan(value):
        return "none"
    return endless if math.isinf(value) else in_unit(f"{value:.3g}", unit)


def figure(value: float | None, form: str) -> str:
    """Write a figure in a format; one that is not known, or has no end, is none."""
    return "none" if value is None or not math.isfinite(value) else f"{value:{form}}"


def percent(value: float, form: str) -> str:
    """Write a share in %, likewise."""
    return f"{figure(value, form)} %" if math.isfinite(value) else "none"


def in_unit(figure: str, unit: str) -> str:
    """Put the unit behind a figure; a pure number has none."""
    return figure if unit in ("", "1") else f"{figure} {unit}"


def about_code(generated: Generated) -> list[str]:
    """Files with their size, and what the numbers are."""
    program, files = generated.program, generated.bundle.files
    sizes = ", ".join(f"{name} ({len(text.encode())} bytes)" for name, text in files.items())
    lines = [f"C: {program.arithmetic}, {len(program.body)} operations, program {program.id}", f"  {sizes}"]
    if generated.checked is not None:
        again = f"{generated.checked.operations} operations and {generated.checked.stores} stores"
        lines.append(f"  no overflow: {again} proven twice, by interval rules and by z3")
    spans = {v.name: (v.high - v.low) * 2.0**-v.number.fraction for v in program.outputs}
    bounded = {r: f"{r.output} {in_unit(f'{r.bound:.3g}', r.unit)}" for r in program.rounding if math.isfinite(r.bound)}
    said = [text for r, text in bounded.items() if r.bound < spans[r.output]]
    if said:
        lines.append(f"  rounding, proven: at most {', '.join(said)} off the law in one step")
    nothing = [text for r, text in bounded.items() if r.bound >= spans[r.output]]
    if nothing:
        lines.append(
            f"  rounding: the bound, {', '.join(nothing)}, is as wide as the output's whole range and says nothing"
        )
    unbounded = [r.output for r in program.rounding if not math.isfinite(r.bound)]
    if unbounded:
        lines.append(f"  rounding: no bound is proven for {', '.join(unbounded)}")
    lines += [
        f"  search: cut short at a work of {dict(table.sizes)['FL_QP_BUDGET']:,}; then the last plan's next move, then "
        "the saturated LQR stands in"
        for table in program.tables
        if table.form == "fl_qp_t"
    ]
    return lines + (about_still(generated.still) if generated.still else [])


def about_unused_safe(generated: Generated, safe: Sequence[float | None]) -> list[str]:
    """Say that `safe_output` acts in no sample of fixed point, and what stands for it."""
    if not any(each is not None for each in safe) or not generated.program.arithmetic.startswith("fixed"):
        return []
    pairs = [(value, each) for value, each in zip(generated.program.outputs, safe, strict=True) if each is not None]
    told = " and ".join(f"{value.name} = {in_unit(f'{each:g}', value.unit)}" for value, each in pairs)
    return [
        "  safe_output acts in no sample: in fixed point every input is a number, and the code has no such status bit; "
        f"where a reading may be none, command {told} in place of step(), before it is converted"
    ]


def about_still(still: ZeroInput) -> list[str]:
    """Limit cycles and dead bands, output by output; where starts were still moving, that it was not found out."""
    tried = f"{'all ' if still.exhaustive else ''}{still.starts} start{'' if still.starts == 1 else 's'}"
    if still.unsettled:
        those = "all" if still.unsettled == still.starts else f"not found out for {still.unsettled} of them,"
        tried += f", {those} still moving after {still.steps} steps"
    lines = []
    for row in still.outputs:
        if row.bound is None:
            lines.append(f"  inputs still: {row.output}: a limit acts at rest, so nothing is bounded there")
            continue
        moves = f"roundings alone move it by at most {in_unit(f'{row.bound:.3g}', row.unit)}"
        bound = moves if math.isfinite(row.bound) else "how far roundings alone move it has no bound"
        lines.append(f"  inputs still: {row.output}: {_found_still(still, row)} ({tried}); {bound}")
    return lines


def _found_still(still: ZeroInput, row: AtRest) -> str:
    """Tell what the starts that came to rest or to a cycle say of an output; that there is none, only where all did."""
    if still.unsettled == still.starts:
        return "whether it comes to rest was not found out"
    found = "" if still.exhaustive and not still.unsettled else " found"
    cycle = f"a limit cycle of {in_unit(f'{row.cycle:.3g}', row.unit)}" if row.cycle else f"no limit cycle{found}"
    away = f"rests up to {in_unit(f'{row.offset:.3g}', row.unit)} away" if row.offset else f"no dead band{found}"
    return f"{cycle}, {away}"
