"""A pile of names that one shape says more than gives way to the fewest that leave no shape."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from firmloop.diagnose import completion


def _tried(*names: str, score: float) -> SimpleNamespace:
    return SimpleNamespace(fitted=SimpleNamespace(terms=names), score=score)


@pytest.mark.parametrize(
    ("left", "kept"),
    [
        pytest.param({("weight",): 10.0, ("weight", "step"): 5.0}, ("weight",), id="the one that leaves next to none"),
        pytest.param(
            {("weight",): 300.0, ("weight", "step"): 5.0}, ("weight", "step"), id="two, where one leaves some"
        ),
        pytest.param({("weight",): 300.0, ("weight", "step"): 200.0}, None, id="none, where all leave some"),
    ],
)
def test_the_fewest_names_that_leave_no_shape_stand_for_more(
    left: dict[tuple[str, ...], float], kept: tuple[str, ...] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = [_tried("weight", score=-900.0), _tried("step", score=-100.0), _tried("weight", "step", score=-950.0)]
    best = _tried("weight", "step", "wave", score=-980.0)
    found = completion.Search(None, _tried(score=0.0), best, (tuple(few),), (), ())  # type: ignore[arg-type]
    monkeypatch.setattr(completion, "best_shape", lambda _, each: SimpleNamespace(gain=left[each.fitted.terms]))
    fewer = completion._fewer(found)
    assert (None if fewer is None else fewer.best.fitted.terms) == kept
