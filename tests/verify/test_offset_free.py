"""A predictive controller in fixed point that estimates a disturbance leaves no offset."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Request
from firmloop.design.kinds.mpc.kind import design
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.graph import law_graph
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.twins.qp import optimum
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.closed_loop import PlantLoop, close_loop

PERIOD, RANGE = 0.05, 100.0  # s, degC
INPUTS = (Signal("reference", "degC", 0.0, RANGE), Signal("temperature", "degC", 0.0, RANGE))
OUTPUTS = (Signal("voltage", "V", -12.0, 12.0),)
POLE = math.exp(-PERIOD / 2.0)
OWN = {
    "A": [[POLE]], "B": [[10.0 * (1.0 - POLE)]], "Q": [1.0], "R": 0.1, "horizon": 6, "u_min": -12.0, "u_max": 12.0,
    "reference": "reference", "offset_free": True,
}  # fmt: skip


@pytest.mark.parametrize("number", ["fixed32", "fixed16"])
@pytest.mark.parametrize("solver", ["fixed_iterations", "explicit"])
def test_a_wrong_model_leaves_no_offset_in_fixed_point(solver: str, number: str) -> None:
    """The plant has a quarter less gain than the model, and twice its time constant."""
    law = design(Request("oven", {**OWN, "solver": solver}, PERIOD, INPUTS, OUTPUTS, None, optimum)).law
    program = lower(law, number)
    table = {"gain": 7.5, "time_constant_s": 4.0, "delay_s": 0.0}
    parameters = {name: {"value": value, "free": False} for name, value in table.items()}
    plant = make_plant("first_order", "voltage_V", ["temperature_C"], parameters)
    course = np.repeat([60.0, 23.0], 800)
    link = LibraryLink(build_host(emit(program, "test"), load_target("host")), program)
    ran = close_loop(program, PlantLoop(plant, course, ("reference", "temperature")), link)
    for end in (slice(700, 800), slice(1500, 1600)):
        assert np.max(np.abs(ran.reference - ran.measurement)[end]) <= 1e-3 * RANGE


def test_a_law_reads_each_state_and_input_at_one_place() -> None:
    law = design(Request("oven", {**OWN, "solver": "explicit"}, PERIOD, INPUTS, OUTPUTS, None, optimum)).law
    places = [node.place for node in law_graph(law).nodes if node.function == "argument"]
    assert len(places) == len(set(places)) == len(law.state) + len(law.inputs)
