"""What a diagnosis may not stand on: values far from what is met, a clock that jumps, a test that was fitted."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from bench.diagnose import simulated
from bench.diagnose.truth import FINE, run
from firmloop.diagnose.data.prepare import Apart, check_apart, check_clock, two_machines
from firmloop.diagnose.model.hypothesis import make_problem
from firmloop.diagnose.run import diagnose
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import EffectUse, with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.per_recording import with_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import measured, simulate
from tests.diagnose.cases import said_of
from tests.sizes import MOTOR, STAGE, motor, stage, use_of

NOISE = {"speed_rad_s": 0.3, "current_A": 0.005, "position_m": 2e-5, "speed_m_s": 2e-3}


def recorded(plant: Plant, size: float, seed: int = 1, rows: int = 1600, to_and_fro: bool = False) -> Recording:
    """Record what the plant does at random steps, or at random turns of one size, with noise."""
    random = np.random.default_rng(seed)
    time, drive = np.arange(rows) * 1e-3, np.repeat(random.uniform(-size, size, rows // 40), 40)
    if to_and_fro:
        drive = size * np.sign(drive)
    still = {signal.name: np.zeros(rows) for signal in plant.outputs}
    bare = make_recording(time, {plant.inputs[0].name: drive, **still}, "train.csv", "")
    shown = simulate(plant, bare, None)
    seen = {s.name: shown[:, k] + NOISE[s.name] * random.normal(size=rows) for k, s in enumerate(plant.outputs)}
    return make_recording(time, {plant.inputs[0].name: drive, **seen}, f"{seed}.csv", "")


BARE = {"motor": motor("speed_rad_s", "current_A"), "stage": stage("position_m", "speed_m_s")}


@cache
def seen_of(machine: str) -> Recording:
    """Record a machine with friction, once: a module that simulates has every worker do so to collect its tests."""
    plant = BARE[machine]
    return recorded(with_effects(plant, [use_of(plant, "coulomb_friction")]), 10.0)


def given(machine: str, name: str, factor: float) -> Plant:
    """Return the plant as a project gives it: 4 % off, and one parameter by a factor."""
    values = {key: 1.04 * value for key, value in (MOTOR if machine == "motor" else STAGE).items()}
    values |= {name: values[name] * factor}
    free = {key: {"value": value, "free": True} for key, value in values.items()}
    plant = BARE[machine]
    return make_plant(plant.kind, plant.inputs[0].name, [signal.name for signal in plant.outputs], free)


def noted(plant: Plant, recording: Recording, *effects: str) -> str:
    """Return the notes of a diagnosis, which has to name these effects and to meet the recording."""
    finding = diagnose(plant, [recording], [], lambda *_: None).finding
    assert [each.name for each in finding.effects] == list(effects)
    assert finding.train.after < 1.1
    return "; ".join(finding.notes)


def met(name: str, factor: float) -> str:
    return rf"met with {name} = [^,;]*, {1.0 / (1.04 * factor):.2g} times what the project gives; check its value"


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.1, 10.0])
@pytest.mark.parametrize(
    ("machine", "name"),
    [*(("motor", name) for name in ("R_ohm", "ke_V_s_rad", "J_kg_m2")), ("stage", "mass_kg")],
)
def test_a_parameter_that_is_ten_times_off_is_told_beside_what_is_missing(
    machine: str, name: str, factor: float
) -> None:
    said = noted(given(machine, name, factor), seen_of(machine), "coulomb_friction")
    assert re.search(met(name, factor), said)


@pytest.mark.parametrize(
    ("seen", "factor"),
    [("plain", 10.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in (("plain", 0.1), ("friction", 10.0)))],
)
def test_two_constants_that_are_ten_times_off_are_told(seen: str, factor: float) -> None:
    plant = given("motor", "ke_V_s_rad", factor)
    torque = next(p for p in plant.parameters if p.name == "kt_N_m_A")
    plant = replace(
        plant,
        parameters=tuple(replace(p, value=p.value * factor) if p is torque else p for p in plant.parameters),
    )
    effects = ["coulomb_friction"] if seen == "friction" else []
    said = noted(plant, seen_of("motor") if effects else recorded(BARE["motor"], 10.0), *effects)
    assert re.search(met("ke_V_s_rad", factor), said) and re.search(met("kt_N_m_A", factor), said)


@pytest.mark.parametrize(
    ("gain", "told"),
    [
        (3.1, "9.7 times what the project gives; check its value and unit"),
        (-30.0, "-1 times what the project gives; check its value and sign"),
    ],
)
def test_a_gain_that_is_only_a_start_is_told_and_stops_nothing(gain: float, told: str) -> None:
    """It may be off by what another unit would be, or by its sign."""
    lag = {"time_constant_s": {"value": 0.05, "free": True}, "delay_s": 0.0}
    true, given_one = (
        make_plant("first_order", "voltage_V", ["speed_rad_s"], {"gain": {"value": value, "free": True}, **lag})
        for value in (30.0, gain)
    )
    assert f"met with gain = 30, {told}" in noted(given_one, recorded(true, 10.0))


@pytest.mark.parametrize("machine", ["motor", "stage"])
def test_recordings_of_two_machines_are_told(machine: str) -> None:
    plant = BARE[machine]
    other = replace(
        plant,
        parameters=tuple(
            replace(p, value=0.5 * p.value) if p.name in ("J_kg_m2", "mass_kg") else p for p in plant.parameters
        ),
    )
    friction = [use_of(plant, "coulomb_friction")]
    second = recorded(with_effects(other, friction), 10.0, seed=3)
    apart = two_machines(plant, [seen_of(machine), second])
    assert apart is not None and "1.csv and 3.csv are not of one plant" in apart.says
    listed = "J_kg_m2" if machine == "motor" else "mass_kg"
    assert f'per_recording = ["{listed}"]' in apart.says
    assert not two_machines(with_varying(plant, [listed]), [seen_of(machine), second])
    assert not two_machines(plant, [seen_of(machine), recorded(with_effects(plant, friction), 4.0, seed=3)])


def test_what_an_effect_makes_two_machines_of_is_one_beside_it() -> None:
    """Pushed to and fro beyond its limit, a drive has a smaller gain."""
    lag = {"time_constant_s": {"value": 0.05, "free": True}, "delay_s": 0.0}
    plant = make_plant("first_order", "voltage_V", ["speed_rad_s"], {"gain": {"value": 30.0, "free": True}, **lag})
    true = with_effects(plant, [EffectUse("input_saturation", None, {"limit_V": 4.0})])
    seen = [recorded(true, size, seed, to_and_fro=True) for seed, size in ((1, 3.0), (3, 10.0))]
    apart = two_machines(plant, seen)
    assert apart is not None and "are not of one plant" in apart.says
    assert [each.name for each in diagnose(plant, seen, [], lambda *_: None).finding.effects] == ["input_saturation"]


@pytest.mark.slow
def test_a_clock_that_looks_like_another_inertia_is_named(tmp_path: Path) -> None:
    """A part of a recording, by which two machines are told, has lost what its clock was late before."""
    simulated.write(1330002, "single", 0, tmp_path)
    assert [each["name"] for each in said_of(tmp_path / "project.toml")["effects"]] == ["clock_skew"]


def test_a_finding_makes_one_machine_of_two_where_it_leaves_about_as_little_of_both() -> None:
    seen = [recorded(BARE["motor"], 10.0, seed) for seed in (1, 2)]
    outputs = [measured(BARE["motor"], each) for each in seen]
    spread = np.std(np.concatenate(outputs), axis=0)
    left = [np.tile(0.01 * spread, (len(each), 1)) for each in outputs]
    apart = Apart("", 2e-4)  # both outputs, each a hundredth of its spread
    assert apart.made_one(outputs, left)
    assert apart.made_one(outputs, [2.0 * left[0], 2.0 * left[1]])
    assert not apart.made_one(outputs, [left[0], 4.0 * left[1]])


@pytest.mark.slow
def test_two_machines_that_no_effect_makes_one_are_refused() -> None:
    lag = {"time_constant_s": {"value": 0.05, "free": True}, "delay_s": 0.0}
    plant, other = (
        make_plant("first_order", "voltage_V", ["speed_rad_s"], {"gain": {"value": gain, "free": True}, **lag})
        for gain in (30.0, 20.0)
    )
    with pytest.raises(IdentifyError, match=r"are not of one plant.*per_recording = \["):
        diagnose(plant, [recorded(plant, 10.0), recorded(other, 10.0, seed=3)], [], lambda *_: None)


def shifted(seen: Recording, by: float) -> Recording:
    return replace(seen, time=seen.time + np.where(np.arange(len(seen.time)) > 800, by, 0.0))


def test_a_clock_that_jumps_alone_is_told() -> None:
    with pytest.raises(IdentifyError, match=r"jumps by 0\.031 s after 0\.8 s, but the motion goes on"):
        check_clock(BARE["motor"], [shifted(seen_of("motor"), 0.03)])


def test_rows_that_are_missing_are_no_jump() -> None:
    kept = np.r_[0:800, 830:1600]
    seen = seen_of("motor")
    part = replace(
        seen,
        time=seen.time[kept],
        columns=MappingProxyType({name: values[kept] for name, values in seen.columns.items()}),
    )
    check_clock(BARE["motor"], [part, seen_of("motor")])


def test_a_test_that_was_fitted_is_told() -> None:
    plant, seen = BARE["motor"], seen_of("motor")
    later = replace(seen, time=seen.time + 5.0, source="copy.csv")
    part = replace(
        seen,
        time=seen.time[:500],
        columns=MappingProxyType({name: values[700:1200] for name, values in seen.columns.items()}),
        source="part.csv",
    )
    for one, begin in ((later, "0 s"), (part, "0.7 s")):
        with pytest.raises(IdentifyError, match=rf"{one.source} repeats 1\.csv from {begin}"):
            check_apart(plant, [seen], [one])
    check_apart(plant, [seen], [recorded(plant, 10.0, seed=2)])


def test_a_wave_along_a_way_has_a_period_in_it() -> None:
    """A longer one is a load or a spring under another name."""
    seen = seen_of("stage")
    problem = make_problem(BARE["stage"], [seen], (), np.zeros(2))
    travel = np.ptp(seen.columns["position_m"])
    for name in ("cogging_torque", "torque_ripple"):
        term = problem.term(name)
        assert term is not None
        (low,) = [each.low for each in term.parameters if each.name == "periods_per_m"]
        assert low == pytest.approx(1.0 / travel, rel=0.05)


def test_the_truth_switches_a_load_inside_a_substep() -> None:
    """Of a mass on which nothing else acts, the speed tells the moment to any digit."""
    begin, force, mass, step = 0.00403217, 2.0, 3.0, 1e-3
    values = {"kt": 1.0, "ke": 1.0, "R": 1.0, "L": 1.0, "J": mass, "step": force, "step_time": begin}
    _, fine = run(values, np.zeros(9), step, None, np.zeros(9))
    assert fine["speed"][7 * FINE] == pytest.approx(-force / mass * (7 * step - begin), rel=1e-9)
