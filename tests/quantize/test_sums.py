"""What a law adds up is gathered exactly, and a choice is read as one."""

from __future__ import annotations

from fractions import Fraction

import casadi as ca
import numpy as np

from firmloop.quantize.lower.graph import evaluator, read_graph
from firmloop.quantize.lower.limits import with_limits
from firmloop.quantize.lower.sums import gather


def function_of(build) -> ca.Function:
    x, z = ca.SX.sym("x", 2), ca.SX.sym("z", 2)
    u = build(x, z)
    return ca.Function("law", [x, z], [x, u, ca.SX(0), ca.SX(0, 1)])


def test_a_sum_is_multiplied_out() -> None:
    graph = read_graph(function_of(lambda x, z: 0.5 * (0.25 * z[0] - z[1]) + x[0] - 2.0))
    (total,) = (total for total in gather(graph).values() if total.terms)
    places = {graph.nodes[k].place: weight for k, weight in total.terms.items()}
    assert places == {(1, 0): Fraction(1, 8), (1, 1): Fraction(-1, 2), (0, 0): Fraction(1)}
    assert total.constant == -2


def test_what_is_used_often_is_computed_once() -> None:
    def build(x, z):
        error = z[0] - z[1]
        return ca.fmax(2.0 * error + x[0], 3.0 * error + x[1]) + 4.0 * error

    graph = read_graph(function_of(build))
    errors = [k for k, node in enumerate(graph.nodes) if node.function == "sub"]
    assert set(errors) <= set(gather(graph))


def test_a_choice_is_one_operation() -> None:
    function = function_of(lambda x, z: ca.if_else(z[0] > 0.5, x[0], x[1]))
    graph = read_graph(function)
    assert [node.function for node in graph.nodes].count("choose") == 1
    for z0 in (0.0, 1.0):
        (got,) = evaluator(graph)([[np.float64(3.0), np.float64(4.0)], [np.float64(z0), np.float64(0.0)]])[1]
        assert got == float(function([3.0, 4.0], [z0, 0.0])[1])


def test_a_limit_its_flag_and_what_it_cuts_off_ask_the_same() -> None:
    def build(x, z):
        free = x[0] + z[0]
        limited = ca.fmin(ca.fmax(free, -1.0), 2.0)
        return ca.vertcat(limited, limited != free, x[1] + 0.3 * (limited - free))

    functions = [node.function for node in with_limits(read_graph(function_of(build))).nodes]
    assert functions.count("clamp") == functions.count("outside") == functions.count("choose") == 1
