"""Feedforward from the plant's effects: the input that holds a speed against them, and nothing it cannot know."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import design
from firmloop.design.law import DesignError, Law
from firmloop.design.models.feedforward import feedforward
from firmloop.design.models.sine import WORST, sine
from firmloop.identify.plants.attach import EffectUse, with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import make_recording
from firmloop.identify.signal import Signal
from firmloop.identify.simulation.simulate import simulate
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.proof import proof
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import compare
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.checker import check_proof
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import run
from firmloop.verify.stimuli.stimuli import stimuli
from tests.quantize.test_lower import leaves_bounds
from tests.sizes import motor, use_of

MOTOR = {"R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.025, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}
STAND = (Signal("reference", "rad/s", -400.0, 400.0), Signal("measurement", "rad/s", -400.0, 400.0))
VOLTS = (Signal("output", "V", -12.0, 12.0),)
AHEAD = {"kp": 0.01, "feedforward": {"from": "effects", "smooth": 2.0}}


def plant(*uses: tuple[str, dict[str, float]]) -> Plant:
    bare = make_plant("dc_motor", "voltage_V", ["speed_rad_s"], MOTOR)
    return with_effects(bare, [EffectUse(name, None, values, ()) for name, values in uses])


def term(machine: Plant, reference: float) -> float:
    """Return what the feedforward adds to a P controller without error."""
    law = design("pid", "x", AHEAD, 0.001, STAND, VOLTS, machine).law
    return float(law.last.function([], [reference, reference])[1])


def test_friction_costs_its_torque_times_r_over_kt() -> None:
    machine = plant(("coulomb_friction", {"torque_N_m": 1e-3}))
    volts = 1e-3 * 8.0 / 0.025
    wanted = {100.0: volts, -3.0: -volts, 1.0: volts / 2, 0.0: 0.0}
    assert [term(machine, w) for w in wanted] == pytest.approx(list(wanted.values()))


def test_directions_load_drag_and_brushes() -> None:
    ohm = 8.0 / 0.025
    uneven = plant(("asymmetric_friction", {"positive_N_m": 1e-3, "negative_N_m": 2e-3}))
    assert (term(uneven, 50.0), term(uneven, -50.0)) == pytest.approx((1e-3 * ohm, -2e-3 * ohm))
    load = plant(("load_torque", {"torque_N_m": -5e-4}))
    assert (term(load, 50.0), term(load, -50.0)) == pytest.approx((-5e-4 * ohm, -5e-4 * ohm))
    drag = plant(("quadratic_drag", {"coefficient_N_m_s2_rad2": 1e-8}))
    assert term(drag, -200.0) == pytest.approx(-1e-8 * 4e4 * ohm)
    assert term(plant(("brush_drop", {"voltage_V": 0.7})), 9.0) == pytest.approx(0.7)


@pytest.mark.parametrize("ends", [(-1.0, 1.0), (-200.0, 150.0), (0.0, 3.0), (2.0, 40.0)])
def test_the_sine_is_one(ends: tuple[float, float]) -> None:
    angle = ca.SX.sym("angle")
    points = np.linspace(*ends, 5001)
    found = np.array(ca.Function("sine", [angle], [sine(angle, *ends)])(points)).ravel()
    assert np.abs(found - np.sin(points)).max() < 1.05 * WORST


TURNS = Signal("position", "rad", -20.0, 20.0)
HELD = (
    *("coulomb_friction", "asymmetric_friction", "stribeck_friction", "load_torque", "quadratic_drag"),
    *("gravity_torque", "cogging_torque", "return_spring", "hardening_spring"),
)


@pytest.mark.parametrize("speed", [12.0, -35.0])
@pytest.mark.parametrize("name", HELD)
def test_the_plant_keeps_its_speed(name: str, speed: float) -> None:
    """What the feedforward gives at every moment of an even motion is what the simulator needs to keep it even."""
    bare = make_plant(
        "rotary_stage", "torque_N_m", ["speed_rad_s", "position_rad"], {"J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6}
    )
    machine = with_effects(bare, [use_of(bare, name)])
    ahead = feedforward(
        {"feedforward": {"from": "effects", "position": "position", "smooth": 2.0}},
        machine, 0.001, (STAND[0], Signal("output", "N*m", -1.0, 1.0)), (*STAND, TURNS),
    )  # fmt: skip
    time = np.arange(60) * 1e-4
    place = 0.4 + speed * (time + 0.5e-4)
    w, th = ca.SX.sym("w"), ca.SX.sym("th")
    extra = np.array(ca.Function("term", [w, th], [ahead.term(w, th)])(np.full(60, speed), place)).ravel()

    def last(torque: np.ndarray) -> float:
        columns = {"torque_N_m": torque + 3e-6 * speed, "speed_rad_s": time, "position_rad": time}
        names = [state.name for state in machine.states]
        start = np.array([{"speed_rad_s": speed, "position_rad": 0.4}[n] for n in names])
        return float(simulate(machine, make_recording(time, columns, "even", ""), start)[-1, 0])

    without, held = abs(last(0.0 * extra) - speed), abs(last(extra) - speed)
    assert without > 1e-3
    assert held < (0.02 if name == "stribeck_friction" else 2e-3) * without


def test_friction_grows_with_the_load_that_is_met() -> None:
    load = ("load_torque", {"torque_N_m": 1e-3})
    ohm = 8.0 / 0.025
    machine = plant(load, ("load_dependent_friction", {"ratio": 0.2}))
    assert (term(machine, 50.0), term(machine, -50.0)) == pytest.approx((1.2e-3 * ohm, 0.8e-3 * ohm))


def test_the_input_comes_out_of_its_dead_zone() -> None:
    machine = plant(("dead_zone", {"half_width_V": 0.3}))
    table = {"kp": 0.01, "feedforward": {"from": "effects", "soft": 0.1}}
    law = design("pid", "x", table, 0.001, STAND, VOLTS, machine).law
    wanted = {20.0: 0.2 + 0.3, -100.0: -1.0 - 0.3, 5.0: 0.05 + 0.15, 0.0: 0.0}
    assert [float(law.last.function([], [w, 0.0])[1]) for w in wanted] == pytest.approx(list(wanted.values()))


def test_a_dead_zone_about_another_command_than_zero_is_not_met() -> None:
    values = {"gain": 1.0, "time_constant_s": 0.1, "delay_s": 0.0, "input_at_rest": 4.0}
    bare = make_plant("first_order", "voltage_V", ["speed_rad_s"], values)
    machine = with_effects(bare, [EffectUse("dead_zone", None, {"half_width_V": 0.3}, ())])
    with pytest.raises(DesignError, match="dead_zone: it lies about input_at_rest, and the"):
        design("pid", "x", {"kp": 0.01, "feedforward": {"from": "effects"}}, 0.001, STAND, VOLTS, machine)


def position_loop(*names: str) -> Law:
    """Make a position controller of a motor with these effects."""
    bare = motor("position_rad", "speed_rad_s")
    machine = with_effects(bare, [use_of(bare, name) for name in names])
    wires = tuple(Signal(name, "rad", -20.0, 20.0) for name in ("reference", "measurement"))
    table = {"kp": 2.0, "ki": 1.0, "kd": 0.05, "tf_s": 0.004, "feedforward": {"from": "effects", "smooth": 0.5}}
    return design("pid", "x", table, 0.001, wires, VOLTS, machine).law


def test_a_position_tells_its_speed_from_the_second_sample_on() -> None:
    law = position_loop("coulomb_friction")
    volts = 1e-3 * 8.0 / 0.02
    x = np.array(law.start)
    for r, wanted in ((3.0, 0.0), (3.0, 0.0), (3.002, volts), (3.0015, -volts), (3.0015 + 2.5e-4, volts / 2)):
        x, *_, named = (np.array(part).ravel() for part in law.last.function(x, [r, r]))
        shown = dict(zip([signal.name for signal in law.last.named], named, strict=True))
        assert shown["feedforward"] == pytest.approx(wanted, abs=1e-12)


ALL = (
    *("stribeck_friction", "asymmetric_friction", "load_dependent_friction", "load_torque", "quadratic_drag"),
    *("gravity_torque", "cogging_torque", "return_spring", "dead_zone", "input_delay", "sensor_offset"),
)


FEW = ("stribeck_friction", "cogging_torque", "dead_zone", "input_delay")


@pytest.mark.parametrize(
    ("number", "names"),
    [
        ("fixed16", FEW),
        ("float32", FEW),
        *(pytest.param(number, ALL, marks=pytest.mark.slow) for number in ("float32", "float64", "fixed16", "fixed32")),
    ],
    ids=lambda value: value if isinstance(value, str) else str(len(value)),
)
def test_every_format_computes_every_term_to_the_last_bit(number: str, names: tuple[str, ...]) -> None:
    law = position_loop(*names)
    program = lower(law, number)
    if number.startswith("fixed"):
        check_proof(proof(program, law.reasons))
    blocks = stimuli(program, [], 200, 1)
    traces = [run(program, block.inputs, block.settings) for block in blocks]
    link = LibraryLink(build_host(emit(program, "test"), load_target("host")), program)
    assert compare(program, link, blocks, traces, lambda *_: None).differences == 0
    assert all(row.worst <= row.bound for row in measure_rounding(law, program, blocks, traces))
    assert law.says.endswith("(not for input_delay)" if names == FEW else "(not for input_delay, sensor_offset)")


def test_a_position_is_an_angle() -> None:
    machine = plant(("gravity_torque", {"amplitude_N_m": 1e-3}))
    table = {"kp": 0.01, "feedforward": {"from": "effects", "position": "place"}}
    with pytest.raises(DesignError, match=r"signals\.place in 'm'; it must be in 'rad'"):
        design("pid", "x", table, 0.001, (*STAND, Signal("place", "m", -1.0, 1.0)), VOLTS, machine)
    law = design("pid", "x", table, 0.001, (*STAND, Signal("place", "rad", -9.0, 9.0)), VOLTS, machine).law
    volts = float(law.last.function([], [0.0, 0.0, -0.5])[1])
    assert volts == pytest.approx(1e-3 * 8.0 / 0.025 * np.sin(-0.5), rel=1e-3)


@pytest.mark.parametrize("arithmetic", ["float32", "fixed16"])
def test_bounds_hold_with_an_integral(arithmetic: str) -> None:
    machine = plant(("coulomb_friction", {"torque_N_m": 3e-3}))
    table = {"kp": 0.01, "ki": 2.0, "feedforward": {"from": "effects"}}
    law = design("pid", "x", table, 0.001, STAND, VOLTS, machine).law
    program = lower(law, arithmetic)
    assert leaves_bounds(program, stimuli(program, [], 6000, 5)) == []
    random = np.random.default_rng(1)
    rows = np.repeat(random.choice([-400.0, 0.0, 400.0], (200, 2)), 40, axis=0)
    x = np.array(law.last.function.mapaccum(len(rows))(np.array(law.start), rows.T)[0])
    assert law.state[0].low <= x.min() and x.max() <= law.state[0].high
    assert "coulomb_friction" in law.says


@pytest.mark.parametrize(
    ("table", "machine", "words"),
    [
        ({"from": "effects"}, None, ["nothing to work from", "[[plant.effects]]"]),
        (
            {"from": "effects"},
            plant(("input_delay", {"delay_s": 2e-3})),
            ["none of the plant's effects", "input_delay: no input acts before it is given"],
        ),
        (
            {"from": "effects"},
            plant(("cogging_torque", {"amplitude_N_m": 1e-3, "periods_per_rev": 8.0})),
            ["cogging_torque: a speed tells no position", "position ="],
        ),
        ({"from": "effect"}, plant(("load_torque", {"torque_N_m": 1e-4})), ["did you mean 'effects'"]),
        ({"smooth": 1.0}, plant(("load_torque", {"torque_N_m": 1e-4})), ["from", "missing"]),
        ("effects", None, ["not a table"]),
    ],
)
def test_what_cannot_be_met_is_told(table, machine, words) -> None:
    with pytest.raises(DesignError) as caught:
        design("pid", "x", {"kp": 0.01, "feedforward": table}, 0.001, STAND, VOLTS, machine)
    for word in words:
        assert word in str(caught.value)
