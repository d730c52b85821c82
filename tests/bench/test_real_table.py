"""The table of the real machines says where an improved project is worse than the plain refit."""

from __future__ import annotations

from bench.diagnose.real import harms, table, told

FIGURES = {
    "machine": "arm", "seconds": 2.0, "names": ["backlash"], "unit": "rad", "refit_says": "", "verdict": "explained",
    "judged": {"given": 3.0, "refit": 2.0, "after": 1.0}, "bar": 1.5, "says": "", "met": True,
}  # fmt: skip


def with_after(after: float) -> dict[str, object]:
    return {**FIGURES, "rows": [["test", "r.csv", "position_rad", 3.0, 2.0, after]]}


def test_one_worse_output_is_harm() -> None:
    assert harms(with_after(2.01)) == 0
    assert harms(with_after(2.03)) == 1
    assert harms(with_after(float("nan"))) == 1
    assert any(line.endswith("WORSE") for line in told(with_after(2.03)))
    assert not any(line.endswith("WORSE") for line in told(with_after(1.0)))
    assert table([with_after(2.03), with_after(1.0)]) == [
        "met: 2 of 2; a project no worse than the plain refit anywhere: 1 of 2"
    ]


def test_a_refused_machine_is_neither_met_nor_unharmed() -> None:
    refused = {
        **FIGURES,
        "rows": [],
        "met": False,
        "verdict": "refused",
        "judged": {},
        "names": [],
        "says": "a sentence",
    }
    assert told(refused)[0].endswith("a sentence")
    assert "0 of 1; a project no worse than the plain refit anywhere: 0 of 1" in table([refused])[0]
