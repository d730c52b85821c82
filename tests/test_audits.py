"""The audits of the two motor studies: every figure has a verdict, and the contradictions are found by computing."""

from __future__ import annotations

import pytest

from examples.audit_table import Row, compared, damping_of, document, overshoot, second_order_step, step_figures
from examples.baldor_l3510 import datasheet_rows, model_rows, text_rows
from examples.baldor_l3510 import motor as l3510
from examples.maxon_re15 import audit as re15

np = pytest.importorskip("numpy")


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
    assert 30 < sum(row.reproduced for row in rows) < len(rows)
    text = document("Audit", ["note"], rows)
    assert text.count("\n| ") == len(rows) + 1
    assert all(line.count(" | ") == 5 for line in text.splitlines() if line.startswith("| ") and "---" not in line)


@pytest.mark.parametrize(
    ("figure", "ours"),
    [
        ("L_main", "1.138 mH"),  # twice the printed value
        ("rotor inertia J", "0.008554 kg m^2"),  # a tenth of it
        ("overshoot of G2", "1.52 %"),
        ("5 % settling of G1", "0.599 s"),
        ("zeta at C - 10 %", "0.759"),
        ("K = V_in/w_ss", "1.594 rad/s/V"),
        ("47 % against conventional d-q", "76.6 %"),
        ("open loop, order 1: overshoot", "0 %"),
        ("overshoot reduced by more than 80 %", "69 % and 88 %"),
    ],
)
def test_a_contradiction_is_shown_with_a_consistent_value(rows: list[Row], figure: str, ours: str) -> None:
    row = found(rows, figure)
    assert not row.reproduced
    assert row.ours == ours


@pytest.mark.parametrize(
    "figure", ["X_c", "slip", "stall torque", "tau_m", "kVA code", "full-load current", "settling error of G1"]
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
    assert compared("a", "b", 0.326, 0.32645, "", 3, "").reproduced
    assert not compared("a", "b", 0.326, 0.3267, "", 3, "").reproduced
