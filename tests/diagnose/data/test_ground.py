"""What a diagnosis may not stand on: parameters that are far off, a clock that jumps, a test that was fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from bench.diagnose.truth import FINE, run
from firmloop.diagnose.data.prepare import check_apart, check_clock, check_nominal, check_same
from firmloop.diagnose.model.hypothesis import make_problem
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.per_recording import with_varying
from firmloop.identify.plants.plant import Plant
from firmloop.identify.recordings.recording import Recording, make_recording
from firmloop.identify.simulation.simulate import simulate
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.diagnose.cases import drawn
from tests.sizes import MOTOR, STAGE, motor, stage, use_of

NOISE = {"speed_rad_s": 0.3, "current_A": 0.005, "position_m": 2e-5, "speed_m_s": 2e-3}


def recorded(plant: Plant, size: float, seed: int = 1, rows: int = 1600) -> Recording:
    """Record what the plant does at random steps, with noise."""
    random = np.random.default_rng(seed)
    time, drive = np.arange(rows) * 1e-3, np.repeat(random.uniform(-size, size, rows // 40), 40)
    still = {signal.name: np.zeros(rows) for signal in plant.outputs}
    bare = make_recording(time, {plant.inputs[0].name: drive, **still}, "train.csv", "")
    shown = simulate(plant, bare, None)
    seen = {s.name: shown[:, k] + NOISE[s.name] * random.normal(size=rows) for k, s in enumerate(plant.outputs)}
    return make_recording(time, {plant.inputs[0].name: drive, **seen}, f"{seed}.csv", "")


BARE = {"motor": motor("speed_rad_s", "current_A"), "stage": stage("position_m", "speed_m_s")}
SEEN = {name: recorded(with_effects(plant, [use_of(plant, "coulomb_friction")]), 10.0) for name, plant in BARE.items()}


def given(machine: str, name: str, factor: float) -> Plant:
    """Return the plant as a project gives it: 4 % off, and one parameter by a factor."""
    values = {key: 1.04 * value for key, value in (MOTOR if machine == "motor" else STAGE).items()}
    values |= {name: values[name] * factor}
    free = {key: {"value": value, "free": True} for key, value in values.items()}
    plant = BARE[machine]
    return make_plant(plant.kind, plant.inputs[0].name, [signal.name for signal in plant.outputs], free)


@pytest.mark.parametrize("factor", [0.1, 10.0])
@pytest.mark.parametrize(
    ("machine", "name"),
    [*(("motor", name) for name in ("R_ohm", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2")), ("stage", "mass_kg")],
)
def test_a_parameter_that_is_ten_times_off_is_told(machine: str, name: str, factor: float) -> None:
    with pytest.raises(IdentifyError, match=r"plant\.parameters are far off") as caught:
        check_nominal(given(machine, name, factor), [SEEN[machine]])
    if name not in ("kt_N_m_A", "J_kg_m2"):  # of those two the outputs show the ratio alone
        assert name in str(caught.value)


@pytest.mark.parametrize("seen", ["plain", "with friction"])
@pytest.mark.parametrize("factor", [0.1, 10.0])
def test_two_constants_that_are_ten_times_off_are_told(seen: str, factor: float) -> None:
    plant = given("motor", "ke_V_s_rad", factor)
    torque = next(p for p in plant.parameters if p.name == "kt_N_m_A")
    plant = replace(
        plant,
        parameters=tuple(replace(p, value=p.value * factor) if p is torque else p for p in plant.parameters),
    )
    recording = SEEN["motor"] if seen == "with friction" else recorded(BARE["motor"], 10.0)
    with pytest.raises(IdentifyError, match=r"plant\.parameters are far off.*ke_V_s_rad"):
        check_nominal(plant, [recording])


@pytest.mark.parametrize(
    ("machine", "effect"),
    [
        ("motor", "coulomb_friction"),
        ("motor", "flexible_coupling"),
        ("motor", "brush_drop"),
        ("motor", "sensor_lag"),
        ("stage", "stribeck_friction"),
        ("stage", "input_delay"),
    ],
)
def test_an_effect_is_no_wrong_parameter(machine: str, effect: str) -> None:
    plant = BARE[machine]
    name = "R_ohm" if machine == "motor" else "mass_kg"
    check_nominal(given(machine, name, 1.0), [recorded(with_effects(plant, [use_of(plant, effect)]), 10.0)])


def test_a_mass_that_no_input_moves_is_no_wrong_mass(tmp_path: Path) -> None:
    """A stage is pressed against its stop: a hundredfold mass that was moving when the recording began comes near."""
    project = read_project(drawn(tmp_path, 740065))
    check_nominal(plant_of(project), read_data(project).train)


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
    with pytest.raises(IdentifyError, match=r"1\.csv and 3\.csv are not of one plant") as caught:
        check_same(plant, [SEEN[machine], second])
    listed = "J_kg_m2" if machine == "motor" else "mass_kg"
    assert f'per_recording = ["{listed}"]' in str(caught.value)
    check_same(with_varying(plant, [listed]), [SEEN[machine], second])
    check_same(plant, [SEEN[machine], recorded(with_effects(plant, friction), 4.0, seed=3)])


def shifted(seen: Recording, by: float) -> Recording:
    return replace(seen, time=seen.time + np.where(np.arange(len(seen.time)) > 800, by, 0.0))


def test_a_clock_that_jumps_alone_is_told() -> None:
    with pytest.raises(IdentifyError, match=r"jumps by 0\.031 s after 0\.8 s, but the motion goes on"):
        check_clock(BARE["motor"], [shifted(SEEN["motor"], 0.03)])


def test_rows_that_are_missing_are_no_jump() -> None:
    kept = np.r_[0:800, 830:1600]
    seen = SEEN["motor"]
    part = replace(
        seen,
        time=seen.time[kept],
        columns=MappingProxyType({name: values[kept] for name, values in seen.columns.items()}),
    )
    check_clock(BARE["motor"], [part, SEEN["motor"]])


def test_a_test_that_was_fitted_is_told() -> None:
    plant, seen = BARE["motor"], SEEN["motor"]
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
    seen = SEEN["stage"]
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
