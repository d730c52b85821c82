"""What no noise model may make noise of is searched by how near simulations come."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import firmloop.diagnose.run as run
from firmloop.diagnose.discrepancy.fit import Shape
from firmloop.diagnose.model.candidate import extended, rated
from firmloop.diagnose.model.fit import fit
from firmloop.diagnose.model.hypothesis import Point
from firmloop.diagnose.search.anew import floated
from firmloop.diagnose.search.found import Progress, Search
from firmloop.diagnose.search.from_given import nominal_fit
from firmloop.diagnose.search.harmless import as_identified
from tests.diagnose.cases import black_box_project, problem_of, said_of

Array = NDArray[np.float64]

STEP = 1e-3  # s
WHEEL = (
    black_box_project("rotary_stage", "voltage_V", "speed_rad_s", ("up.csv", "down.csv", "step.csv"))
    + "torque_per_unit = 1.0\n[plant.parameters]\n"
    + "J_kg_m2 = { value = 0.03, free = true }\nb_N_m_s_rad = { value = 0.1, free = true }\n"
)


def turned(volts: Array) -> Array:
    """Return the speed (n,) of a wheel that 0.7 V keep from turning, 0.111 V s/rad and 5.2 mV s^2/rad."""
    speed, found = 0.0, np.empty(len(volts))
    for k, volt in enumerate(volts):
        found[k] = speed
        free = volt - 0.111 * speed
        if speed == 0.0 and abs(free) <= 0.7:
            continue
        way = np.sign(speed) if speed else np.sign(free)
        after = speed + STEP * (free - 0.7 * way) / 5.2e-3
        speed = 0.0 if speed * after < 0.0 else after
    return found


def windowed(values: Array, rows: int) -> Array:
    """Return the mean (n,) of as many rows up to each."""
    total, last = np.concatenate([[0.0], np.cumsum(values)]), np.arange(1, len(values) + 1)
    return np.asarray((total[last] - total[np.maximum(last - rows, 0)]) / rows)


def logged(folder: Path) -> Path:
    """Log two ramps and a step of a wheel whose speed is averaged and renewed some 20 ms apart; return the project."""
    random = np.random.default_rng(2)
    for name, span, rows, volts in (("up", 16, 20, 0.25), ("down", 12, 20, -0.25), ("step", 2, 10, 7.0)):
        time = np.arange(0.0, span, STEP)
        drive = np.repeat((np.full(len(time), volts) if name == "step" else volts * time)[::rows], rows)
        speed = turned(drive)
        speed += 0.01 * np.sin(STEP * np.cumsum(speed)) * np.sqrt(np.abs(speed))
        read = windowed(windowed(speed, 100), 64)
        renewed = np.cumsum(np.concatenate([[0], random.integers(17, 24, len(time) // 17)]))
        held = read[renewed[np.searchsorted(renewed, np.arange(len(time)), side="right") - 1]]
        table = np.column_stack([time, drive, np.round(102.4 * held) / 102.4])[::rows]
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    (folder / "project.toml").write_text(WHEEL, encoding="utf-8")
    return folder / "project.toml"


def test_friction_in_ramps_and_a_delay_in_a_step_are_found_behind_readings_that_are_averaged_and_held(
    tmp_path: Path,
) -> None:
    said = said_of(logged(tmp_path))
    assert said["verdict"] == "ambiguous"
    held = {each["name"]: each["parameters"] for each in said["effects"]}
    assert {"dead_zone", "coulomb_friction", "sensor_delay"} <= set(held)
    assert not {"asymmetric_friction", "presliding_friction", "stribeck_friction"} & set(held)  # no better than Coulomb
    low, high = held["coulomb_friction"]["torque_N_m"]["ci95"]
    assert low < 0.7 < high
    low, high = held["sensor_delay"]["delay_s"]["ci95"]
    assert low < 0.5 * (0.1 + 0.064 + 0.02) < high
    figures = said["simulation_rms"]["train"]["speed_rad_s"]
    assert figures["after"] < 0.2 * figures["refit"]


def test_what_a_search_led_astray_has_found_gives_way_to_what_simulates_nearer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What had been found did not hold, and the refit was written beside "unknown physics"."""

    def astray(found: Search, progress: Progress) -> tuple[Search, Shape | None]:
        """End with a delay, which explains next to nothing."""
        problem, nominal = found.problem, found.nominal.fitted
        late = problem.term("input_delay")
        assert late is not None
        begin = Point({**nominal.point.values, **problem.starts[late.label][0]}, nominal.point.starts)
        fitted = fit(problem, problem.train, (late,), begin, found.nominal.noises, 2)
        return replace(found, best=rated(problem, fitted), rounds=()), None

    monkeypatch.setattr(run, "completed", astray)
    random, time = np.random.default_rng(4), np.arange(0.0, 6.0, STEP)
    drive = np.repeat(np.repeat(random.uniform(-6.0, 6.0, 12), 25), 20)
    table = np.column_stack([time, drive, turned(drive) + random.normal(0.0, 0.25, len(time))])[::20]
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time_s,voltage_V,speed_rad_s", comments="")
    text = WHEEL.replace('["up.csv", "down.csv", "step.csv"]', '["log.csv"]')
    (tmp_path / "project.toml").write_text(text, encoding="utf-8")
    said = said_of(tmp_path / "project.toml")
    assert "coulomb_friction" in {each["name"] for each in said["effects"]}, said["says"]


CART = (
    black_box_project("linear_stage", "force_N", "speed_m_s", ("log.csv",))
    + "[plant.parameters]\nmass_kg = { value = 12.0, free = true }\nb_N_s_m = { value = 30.0, free = true }\n"
)


def carted(folder: Path) -> Path:
    """Log a cart on a spring of 84 N/m by a sensor that shows no more than 0.23 m/s; return the project."""
    random, time = np.random.default_rng(6), np.arange(0.0, 6.0, 5e-3)
    drive, place, speed, read = 30.0 * np.sin(2.0 * np.pi * (0.3 + 0.25 * time) * time), 0.0, 0.0, []
    for force in drive:
        read.append(np.clip(speed, -0.23, 0.23) + random.normal(0.0, 2e-3))
        for _ in range(10):
            speed += 5e-4 * (force - 30.0 * speed - 84.0 * place) / 12.0
            place += 5e-4 * speed
    table = np.column_stack([time, drive, read])
    np.savetxt(folder / "log.csv", table, delimiter=",", header="time_s,force_N,speed_m_s", comments="")
    (folder / "project.toml").write_text(CART, encoding="utf-8")
    return folder / "project.toml"


def test_what_was_found_first_gives_way_to_what_explains_far_more_beside_the_rest(tmp_path: Path) -> None:
    """A drag stood for the spring, and beside it and a sensor's limit nothing else was found."""
    problem = problem_of(carted(tmp_path))
    nominal = nominal_fit(problem, as_identified(problem.plant, problem.train))
    wrong = nominal
    for name in ("quadratic_drag", "sensor_saturation of speed_m_s"):
        (term,) = (each for each in problem.terms if each.label == name)
        begin = extended(wrong.fitted, term, problem.starts[name][0])
        wrong = rated(problem, fit(problem, problem.train, *begin, wrong.noises, 24))
    found = Search(problem, nominal, wrong, (), (), (nominal.score - wrong.score,))
    right = floated(found)
    assert right is not None
    assert set(right.best.fitted.names) == {"sensor_saturation", "return_spring"}
    assert floated(right) is None
