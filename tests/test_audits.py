"""The audits of the two motor studies: every figure has a verdict, and the contradictions are found by computing."""

from __future__ import annotations

import ast
import math
from pathlib import Path
from types import CodeType

import numpy as np
import pytest

from examples.audit_table import (
    NOT_REPRODUCED,
    OFFERED,
    REPRODUCED,
    STATED,
    Row,
    compared,
    damping_of,
    document,
    overshoot,
    repeated,
    rounding,
    second_order_step,
    step_figures,
)
from examples.baldor_l3510 import audit as l3510_audit
from examples.baldor_l3510 import datasheet_rows, model_rows, text_rows
from examples.baldor_l3510 import motor as l3510
from examples.maxon_re15 import audit as re15


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return [*datasheet_rows.rows(), *model_rows.rows(), *text_rows.rows(), *re15.rows()]


def found(rows: list[Row], figure: str) -> Row:
    (row,) = [row for row in rows if row.figure == figure]
    return row


def test_every_figure_has_a_verdict_and_a_reason(rows: list[Row]) -> None:
    assert len(rows) > 100
    assert len({(row.where, row.figure) for row in rows}) == len(rows)
    assert all(row.why and row.published for row in rows)
    assert {row.verdict for row in rows if row.where != OFFERED} == {REPRODUCED, NOT_REPRODUCED, STATED}
    assert 30 < sum(row.reproduced for row in rows) < len(rows)
    text = document("Audit", ["note"], rows)
    assert text.count("\n| ") == len(rows) + 1
    assert all(line.count(" | ") == 5 for line in text.splitlines() if line.startswith("| ") and "---" not in line)


def reaches_beyond_itself(code: CodeType) -> bool:
    """Tell whether a computation reads anything but literals that stand in it."""
    return bool(code.co_names or code.co_freevars or code.co_argcount)


def fiats(rows: list[Row]) -> list[str]:
    """Name the rows whose verdict is typed: without a computation, or with one that holds nothing but literals."""
    return [
        row.figure
        for row in rows
        if row.verdict in (REPRODUCED, NOT_REPRODUCED)
        and (row.computed is None or not reaches_beyond_itself(row.computed.__code__))  # type: ignore[attr-defined]
    ]


def test_no_verdict_is_typed(rows: list[Row]) -> None:
    assert fiats(rows) == []
    typed = [
        compared("a", "two literals", "306", "uF", lambda: 0.9 * 340, "why"),
        Row("a", "no computation", "1", "1", REPRODUCED, "why"),
    ]
    assert fiats(typed) == ["two literals", "no computation"]


def typed_verdicts(source: str) -> list[int]:
    """Return the lines that give a verdict by hand: Row(...) itself, or judged() whose statement is a literal."""
    found = []
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        name = call.func.id if isinstance(call.func, ast.Name) else ""
        if name == "Row":
            found.append(call.lineno)
        for held in call.args[3:4] if name == "judged" else []:
            body = held.body if isinstance(held, ast.Lambda) else None
            if isinstance(body, ast.Tuple) and not any(isinstance(n, ast.Name) for n in ast.walk(body.elts[-1])):
                found.append(held.lineno)
    return found


def test_no_row_is_given_its_verdict_by_hand() -> None:
    folder = Path(re15.__file__).parents[1]
    for path in [*folder.glob("maxon_re15/*.py"), *folder.glob("baldor_l3510/*.py")]:
        assert typed_verdicts(path.read_text(encoding="utf-8")) == [], path.name
    assert typed_verdicts('judged("a", "b", "c", lambda: (f"{x}", 1 < 2), "d")') == [1]
    assert typed_verdicts('Row("a", "b", "c", "d", "reproduced", "e")') == [1]


def test_a_computation_gives_the_same_again(rows: list[Row]) -> None:
    for row in rows:
        if row.computed is None:
            continue
        again = row.computed()
        if isinstance(again, tuple):
            assert again == (row.ours, row.reproduced), row.figure
        elif isinstance(again, str):
            assert again == row.ours and row.verdict == STATED, row.figure
        else:
            printed = row.published.split()[0]
            assert row.reproduced == math.isclose(float(printed), again, rel_tol=0, abs_tol=1.0001 * rounding(printed))


def test_the_same_figure_again_proves_nothing() -> None:
    assert repeated("a", "b", "2.9 %", "2.9 %", "table 1").verdict == STATED
    assert repeated("a", "b", "3.1 %", "2.9 %", "table 1").verdict == NOT_REPRODUCED


def test_the_report_names_the_figure_that_the_circuit_misses_most() -> None:
    name, share = datasheet_rows.worst_fitted()
    assert all(abs(ours / float(printed) - 1) <= share for printed, _, ours in datasheet_rows.fitted().values())
    assert f"by up to {share:.0%} ({name})" in l3510_audit.notes()[0]


@pytest.mark.parametrize(
    ("figure", "ours"),
    [
        ("L_main", "1.138 mH"),  # twice the printed value
        ("rotor inertia J", "0.008554 kg m^2"),  # a tenth of it
        ("overshoot of G2", "1.516 %"),
        ("5 % settling of G1", "0.5992 s"),
        ("zeta at C - 10 %", "0.759"),
        ("K = V_in/w_ss", "0.6274 V/(rad/s)"),
        ("47 % against conventional d-q", "76.62 %"),
        ("open loop, order 1: overshoot", "0 %"),
        ("full-load torque", "3.001 lb-ft"),
        ("overshoot reduced by more than 80 %", "69 % and 88 %"),
    ],
)
def test_a_contradiction_is_shown_with_a_consistent_value(rows: list[Row], figure: str, ours: str) -> None:
    row = found(rows, figure)
    assert not row.reproduced
    assert row.ours == ours


@pytest.mark.parametrize(
    "figure", ["X_c", "slip", "stall torque", "tau_m", "kVA code", "full-load power factor", "settling error of G1"]
)
def test_what_is_right_is_reproduced(rows: list[Row], figure: str) -> None:
    assert found(rows, figure).reproduced


def test_a_simulated_start_does_not_do_what_the_study_says_of_the_capacitor() -> None:
    inertia = l3510.inertia_of_start()
    assert l3510.settled(inertia) == pytest.approx(0.85, abs=0.003)
    _, natural, whole = l3510.second_order_fit(*l3510.start_up(inertia))
    _, slower, aged = l3510.second_order_fit(*l3510.start_up(inertia, 306e-6))
    assert aged < whole and slower < natural


def test_figures_of_a_step() -> None:
    time = np.arange(0.0, 20.0, 1e-4)
    shown = step_figures(time, second_order_step(time, 2.0, 0.5), 1.0)
    assert shown["overshoot"] == pytest.approx(overshoot(0.5), abs=1e-3)
    assert damping_of(overshoot(0.35)) == pytest.approx(0.35)
    assert shown["settling_5"] < shown["settling_2"]
    for constant, right in ((0.32645, True), (0.3267, False)):
        assert compared("a", "b", "0.326", "", lambda found=constant: found, "").reproduced == right
