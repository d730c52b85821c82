"""What the first sample does otherwise is one branch, and what is infinite is found where it becomes no number."""

from __future__ import annotations

import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from firmloop.quantize.lower.first_sample import in_one_branch, merged
from firmloop.quantize.lower.graph import Graph, evaluator, read_graph
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.lower.vanishing import vanishes
from tests.laws import FULL, TABLES, pid

Build = Callable[[ca.SX, ca.SX, ca.SX], list[ca.SX]]


def graph_of(build: Build) -> Graph:
    """Two state variables, two inputs and `fresh`; the results are next state and output."""
    x, z, fresh = ca.SX.sym("x", 2), ca.SX.sym("z", 2), ca.SX.sym("fresh")
    *after, u = build(x, z, fresh)
    return merged(read_graph(ca.Function("law", [x, z, fresh], [ca.vertcat(*after), u, ca.SX(0, 1), ca.SX(0, 1)])))


def filtered(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
    w = 0.5 * z[0] - z[1]
    held = ca.if_else(fresh, w, x[0])
    total = ca.if_else(fresh, x[1], x[1] + z[0])
    moved = w - held
    return [held + 0.25 * moved, total, ca.fmin(2 * z[0] + 3 * moved, 9)]


def choices(graph: Graph) -> list[int]:
    return [k for k, node in enumerate(graph.nodes) if node.function == "choose"]


def test_the_choice_stands_behind_what_only_later_samples_need() -> None:
    graph = graph_of(filtered)
    found = in_one_branch(graph)
    places = choices(found)
    assert places == list(range(places[0], places[0] + 3))  # both states and what is limited
    assert "min" in [node.function for node in found.nodes[places[-1] :]]
    random = np.random.default_rng(1)
    x, z = (list(random.uniform(-9, 9, size=(2, 500))) for _ in range(2))
    for fresh in (0.0, 1.0):
        arguments = [x, z, [np.full(500, fresh)]]
        for row, other in zip(evaluator(graph)(arguments)[:2], evaluator(found)(arguments)[:2], strict=True):
            for one, same in zip(row, other, strict=True):
                np.testing.assert_allclose(one, same, rtol=0, atol=1e-14)


def test_a_choice_that_another_needs_stays() -> None:
    def build(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
        held = ca.if_else(fresh, z[0], x[0])
        limited = ca.fmin(held, 4)
        return [limited, limited + ca.if_else(fresh, z[1], x[1]), held]

    def nested(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
        limited = ca.fmin(ca.if_else(fresh, z[0], x[0]), 4)
        return [limited, ca.if_else(fresh, limited, x[1]), limited]

    assert len(choices(in_one_branch(graph_of(build)))) == 2
    graph = graph_of(nested)
    assert in_one_branch(graph) is graph


def back_calculated(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
    del fresh
    v = x[0] + z[0]
    return [x[0] + 0.1 * z[0] + 0.5 * (ca.fmin(ca.fmax(v, -1), 1) - v), ca.SX(0), v]


def held_for_ever(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
    del fresh
    return [0.5 * x[0] + z[0], ca.SX(0), x[0] + z[1]]


def limited(x: ca.SX, z: ca.SX, fresh: ca.SX) -> list[ca.SX]:
    del fresh
    return [ca.fmin(ca.fmax(x[0] + z[0], -1), 1), ca.SX(0), x[0]]


@pytest.mark.parametrize(("build", "expected"), [(back_calculated, True), (held_for_ever, False), (limited, False)])
def test_what_is_infinite_vanishes_where_infinities_of_both_signs_meet(build: Build, expected: bool) -> None:
    graph = graph_of(build)
    assert vanishes(graph, [0], [0]) is expected
    state = [np.array([math.inf, -math.inf]), np.zeros(2)]
    with np.errstate(invalid="ignore"):
        for _ in range(3):
            state = [np.broadcast_to(row, 2) for row in evaluator(graph)([state, [np.ones(2), np.ones(2)], []])[0]]
    assert bool(np.all(np.isnan(state[0]))) is expected


def test_a_law_asks_for_no_number_where_that_will_do() -> None:
    asked = {
        name: next(op.function for op in lower(pid(table), "float32").body if op.result.name == "fresh")
        for name, table in (("full", FULL), ("clamping", TABLES["clamping"]))
    }
    assert asked == {"full": "none", "clamping": "lost"}
