"""What is known ahead, a reference or a disturbance, and what stands in where a search finds nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from firmloop.design.kinds.mpc.kind import design
from firmloop.design.law import DesignError, Law
from firmloop.identify.signal import Signal
from tests.design.kinds.test_mpc import ANGLE, REFERENCE, SERVO, SPEED, VOLT, Running, request, servo, table

LOAD = Signal("load", "V", -3.0, 3.0)
STEPS = 160


def wanted(k: int) -> float:
    """Up and down ramps with corners, rad."""
    return float(np.interp(k, [0, 20, 50, 70, 110, 140, STEPS], [0, 0, 1, 1, -1, 0, 0]))


def law_of(inputs: tuple[Signal, ...], **keys: object) -> Law:
    return design(request(table(servo(), **SERVO | {"horizon": 12}, **keys), inputs)).law


def tracked(law: Law, ahead: int, delay: int = 0, load: Callable[[int], float] | None = None) -> np.ndarray:
    """Angles minus those wanted; the reference, and the load, are given `ahead` samples before they are due."""
    running, x, away, way = Running(law), np.zeros(2), [], [0.0] * delay
    for k in range(STEPS):
        given = {"reference": wanted(k + ahead) if load is None else 0.0, "angle": x[0], "speed": x[1]}
        u, flags = running.step(given | ({} if load is None else {"load": load(k + ahead)}))
        assert not any(flags) and abs(u[0]) <= VOLT.high
        away.append(x[0] - (wanted(k) if load is None else 0.0))
        way.append(float(u[0]))
        x = servo()[0] @ x + servo()[1][:, 0] * (way.pop(0) - (0.0 if load is None else load(k)))
    return np.array(away)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("delay", [0, 3])
def test_a_reference_that_is_known_ahead_is_followed_closer(delay: int) -> None:
    inputs = (REFERENCE, ANGLE, SPEED)
    blind = tracked(law_of(inputs, delay_periods=delay), 0, delay)
    seen = tracked(law_of(inputs, delay_periods=delay, preview=12), 12, delay)
    assert rms(seen) < 0.35 * rms(blind)


def test_a_preview_that_the_horizon_does_not_use_changes_nothing() -> None:
    """A reference given ahead that has always stood, and will, is the same as one that is not."""
    inputs = (REFERENCE, ANGLE, SPEED)
    plain, ahead = Running(law_of(inputs)), Running(law_of(inputs, preview=12))
    given = {"reference": 0.5, "angle": 0.45, "speed": 0.3}
    for _ in range(12):
        ahead.step(given)
    assert ahead.step(given)[0][0] == pytest.approx(plain.step(given)[0][0], abs=1e-9)


@pytest.mark.parametrize(("preview", "delay"), [(0, 0), (8, 2)])
def test_a_known_disturbance_is_met_and_leaves_no_offset(preview: int, delay: int) -> None:
    inputs, entry = (LOAD, ANGLE, SPEED), (-servo()[1]).tolist()
    law = law_of(inputs, disturbances=["load"], E=entry, preview=preview, delay_periods=delay)

    def load(k: int) -> float:
        return 2.0 if 30 <= k < 140 else 0.0

    away = tracked(law, preview, delay, load)
    unknown = tracked(law_of((LOAD, ANGLE, SPEED), states=["angle", "speed"], delay_periods=delay), 0, delay, load)
    assert abs(away[135]) < 1e-6 < 1e-2 < abs(unknown[135]), "no offset, where there is one without the signal"
    worst = np.max(np.abs(away))
    assert worst < (1e-6 if preview >= delay else 0.5 * np.max(np.abs(unknown))), "seen in time, it moves nothing"


def test_an_observer_is_told_of_a_known_disturbance() -> None:
    keys = {"C": [[1.0, 0.0]], "observer": "luenberger", "observer_poles": [0.3, 0.4]}
    law = law_of((LOAD, ANGLE), disturbances=["load"], E=(-servo()[1]).tolist(), **keys)
    running, x = Running(law), np.zeros(2)
    for k in range(60):
        load = 1.5 if k > 20 else 0.0
        assert abs(float(running.state[0][0]) - x[0]) < 1e-9 and abs(float(running.state[1][0]) - x[1]) < 1e-9
        u, _ = running.step({"load": load, "angle": x[0]})
        x = servo()[0] @ x + servo()[1][:, 0] * (u[0] - load)


def test_where_a_search_finds_nothing_the_last_plan_goes_on_for_one_sample_and_then_the_saturated_lqr() -> None:
    own = table(servo(), horizon=8, Q=[200.0, 0.1], R=0.01, x_max=[0.5, np.inf], x_min=[-0.5, -np.inf])
    law = design(request(own, (ANGLE, SPEED))).law
    assert law.solve is not None
    running, near, lost = Running(law), {"angle": 0.05, "speed": 2.0}, {"angle": 0.6, "speed": 20.0}
    _, flags = running.step(near)
    plan, planned = (float(x[0]) for x in running.state)
    assert flags == (False, False) and planned == 1.0
    x = servo()[0] @ [near["angle"], near["speed"]] + servo()[1][:, 0] * Running(law).step(near)[0][0]
    following = Running(law).step({"angle": x[0], "speed": x[1]})[0][0]
    assert plan == pytest.approx(following, rel=0.1), "what a new plan would say one sample later"
    u, flags = running.step(lost)
    assert flags == (False, True) and u[0] == plan
    problem = law.solve.quadratic
    free = float(np.clip(problem.slope[0] @ list(lost.values()) * problem.scale[0], -6, 6))
    u, flags = running.step(lost)
    assert flags == (False, True) and u[0] == free != plan
    assert running.step(near)[1] == (False, False)


WRONG = {
    "preview beyond the horizon": ({"preview": 13}, r"controller.preview = 13 is out of range; .* from 0 to 12"),
    "nothing to look at": ({"preview": 3}, r"controller.preview = 3 has nothing to look ahead at"),
    "E alone": ({"E": [[1.0], [0.0]]}, r"controller.E is how known disturbances enter"),
    "twice": ({"disturbances": ["speed"], "states": ["angle", "speed"]}, r"name 'speed' 2 times"),
}


def test_a_disturbance_without_its_entry_is_refused() -> None:
    with pytest.raises(DesignError, match=r"controller.E is missing"):
        law_of((LOAD, ANGLE, SPEED), disturbances=["load"])


@pytest.mark.parametrize("case", WRONG)
def test_bad_keys_are_refused_with_the_number(case: str) -> None:
    keys, says = WRONG[case]
    with pytest.raises(DesignError, match=says):
        law_of((ANGLE, SPEED), **keys)
