"""Gain schedules of other kinds than pid: shared states, wires, and a transfer without a bump."""

from __future__ import annotations

import numpy as np

from firmloop.design.kinds import design
from firmloop.design.kinds.gain_schedule import FEEDBACK, FILTERS, MATRICES
from firmloop.design.kinds.gain_schedule import design as schedule
from firmloop.design.law import Law
from firmloop.identify.signal import Signal
from tests.kind_formulas import FORMULAS

R, Y = Signal("reference", "m", -1.0, 1.0), Signal("measurement", "m", -1.0, 1.0)
ANGLE, SPEED = Signal("angle", "rad", -1.0, 1.0), Signal("speed", "rad/s", -4.0, 4.0)
LEVEL = Signal("level", "1", 0.0, 10.0)
U = Signal("output", "V", -12.0, 12.0)


def outputs(law: Law, rows: np.ndarray) -> np.ndarray:
    return np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[1]).T


def test_points_that_differ_in_their_outputs_alone_share_one_state() -> None:
    law = schedule(MATRICES).law
    assert [signal.name for signal in law.state] == ["x_1", "x_2"]
    one, other = MATRICES.table["controllers"]
    a, b = np.array(one["A"]), np.array(one["B"])[:, 0]
    rows = np.random.default_rng(1).uniform([-1, 0], [2, 100], size=(300, 2))
    x, expected = np.zeros(2), []
    for y, s in rows:
        share = np.clip((s - 20.0) / 60.0, 0, 1)
        expected.append(((1 - share) * np.array(one["C"]) + share * np.array(other["C"])) @ x)
        x = a @ x + b * y
    np.testing.assert_allclose(outputs(law, rows), np.clip(expected, [-2, -2.5], [2, 2.5]), atol=1e-12)


def test_an_observer_is_shared_where_only_the_gains_differ() -> None:
    one, _ = FEEDBACK.table["controllers"]
    table = {**FEEDBACK.table, "controllers": [one, {**one, "Q": [100.0, 0.1, 0.01]}]}
    law = design("gain_schedule", "x", table, FEEDBACK.period, FEEDBACK.inputs, FEEDBACK.outputs, None).law
    assert [signal.name for signal in law.state] == ["x_1_est", "x_2_est", "x_3_est", "integral"]
    assert len(schedule(FEEDBACK).law.state) == 7


def test_a_gain_may_follow_a_state_that_it_weighs() -> None:
    points = [{"at": at, "kind": "state_feedback", "K": [k]} for at, k in ((-2.0, [1.0, 2.0]), (2.0, [3.0, 1.0]))]
    law = design("gain_schedule", "x", {"schedule_on": "speed", "points": points}, 0.01, (ANGLE, SPEED), (U,), None).law
    assert law.states == (0, 1)
    rows = np.array([[0.5, -3.0], [0.5, -1.0], [-0.7, 2.0], [0.1, 4.0]])
    expected = [-(k[0] * x + k[1] * w) for (x, w), k in zip(rows, ([1, 2], [1.5, 1.75], [3, 1], [3, 1]), strict=True)]
    np.testing.assert_allclose(outputs(law, rows)[:, 0], expected, atol=1e-12)


def test_the_signal_is_an_input_where_a_column_stands_for_it() -> None:
    made = [{"kind": "state_space", "A": [[0.5]], "B": [[1.0, -1.0, c]], "C": [[k]]} for c, k in ((0, 1), (0.1, 2))]
    table = {"schedule_on": "level", "points": [2.0, 8.0], "controllers": made}
    law = design("gain_schedule", "x", table, 0.01, (R, Y, LEVEL), (U,), None).law
    assert [signal.name for signal in law.state] == ["x_1_p1", "x_1_p2"]
    assert law.rest == (0.0, 0.0, 0.0)
    fewer = {**table, "controllers": [{**each, "B": [[1.0, -1.0]]} for each in made]}
    assert design("gain_schedule", "x", fewer, 0.01, (R, Y, LEVEL), (U,), None).law.rest == (0.0, 0.0, 5.0)


def test_the_output_moves_no_further_than_the_signal_asks() -> None:
    """From any state: |du| is at most the slope of the blend, |v_1 - v_0| over the distance of the points, times ds."""
    law = schedule(FEEDBACK).law
    names = [signal.name for signal in law.last.named]
    random = np.random.default_rng(2)
    low, high = (np.array([getattr(s, end) for s in law.state]) / 50 for end in ("low", "high"))
    x = random.uniform(low, high, size=(400, len(low)))
    z = random.uniform([-0.4, -0.5, 0.0], [0.4, 0.5, 99.0], size=(400, 3))
    step = law.last.function.map(400)
    _, before, _, named = (np.array(part) for part in step(x.T, z.T))
    after = np.array(step(x.T, (z + np.array([0.0, 0.0, 1.0])).T)[1])
    apart = np.abs(named[names.index("point_1")] - named[names.index("point_2")])
    assert np.all(np.abs(after - before)[0] <= apart / 80.0 + 1e-12)
    assert np.max(np.abs(after - before)) > 0.01


def test_the_formula_tells_one_point_from_another() -> None:
    """The blend is not what any of its controllers alone puts out."""
    rows = np.random.default_rng(3).uniform(-3, 3, size=(200, 2))
    found = outputs(schedule(FILTERS).law, rows)
    np.testing.assert_allclose(found, FORMULAS["gain_schedule"](FILTERS, rows), atol=1e-9)
    for table in FILTERS.table["controllers"]:
        own = {key: value for key, value in table.items() if key != "kind"}
        alone = design(table["kind"], "x", own, FILTERS.period, FILTERS.inputs, FILTERS.outputs, None).law
        assert np.max(np.abs(found - outputs(alone, rows))) > 0.1
