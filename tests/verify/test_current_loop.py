"""The current loop of a permanent-magnet machine, closed by the C of each number format at 20 kHz.

The machine is integrated here by itself, in fine steps with its voltage held between the samples in the stator's frame,
while the rotor turns on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.design import Request
from firmloop.design.kinds import kinds
from firmloop.design.law import DesignError
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.block import run_blocks
from firmloop.verify.build.host import build_host
from firmloop.verify.compare import record_type
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.closed_loop import PlantLoop, close_loop
from firmloop.verify.proofs.rounding import measure_rounding
from firmloop.verify.reference import element_type
from firmloop.verify.scaling import to_physical, to_raw
from firmloop.verify.stimuli.stimuli import adversarial, stimuli

Array = NDArray[np.float64]

HOST = load_target("host")
R, LD, LQ, FLUX, PAIRS = 0.36, 0.2e-3, 0.33e-3, 6.4e-3, 4
PERIOD, FINE = 50e-6, 50  # s, and steps of the integration within it
SUPPLY = 24.0
TABLE = {"tune": "pole_zero", "R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX}
RANGES = {
    "reference_d_A": ("A", -20.0, 20.0),
    "reference_q_A": ("A", -20.0, 20.0),
    "current_a_A": ("A", -30.0, 30.0),
    "current_b_A": ("A", -30.0, 30.0),
    "angle_rad": ("rad", -math.pi, math.pi),
    "speed_rad_s": ("rad/s", -4000.0, 4000.0),
    "supply_V": ("V", 18.0, 30.0),
}


def request(**table: object) -> Request:
    inputs = tuple(Signal(name, *wire) for name, wire in RANGES.items())
    outputs = tuple(Signal(f"duty_{phase}", "1", 0.0, 1.0) for phase in "abc")
    told = {key: value for key, value in {**TABLE, **table}.items() if value is not None}
    return Request("spindle", told, PERIOD, inputs, outputs, None)


@dataclass
class Rotor:
    """A machine whose speed a heavy load holds, in rad/s electrical; its fluxes stand in the stator's frame."""

    speed: float
    flux: complex = FLUX
    angle: float = 0.0

    @property
    def current(self) -> complex:
        """In the rotor's frame, d along the real axis."""
        own = self.flux * np.exp(-1j * self.angle)
        return complex((own.real - FLUX) / LD, own.imag / LQ)

    def hold(self, voltage: complex) -> None:
        """Hold a voltage of the stator for a period (Heun's method)."""
        h = PERIOD / FINE
        for _ in range(FINE):
            first = voltage - R * self.current * np.exp(1j * self.angle)
            before, self.flux, self.angle = self.flux, self.flux + h * first, self.angle + h * self.speed
            second = voltage - R * self.current * np.exp(1j * self.angle)
            self.flux = before + h / 2 * (first + second)


def answered(program: Program, link: LibraryLink, wires: dict[str, float]) -> tuple[dict[str, float], int]:
    """Return the outputs and the status of one step of the C."""
    row = np.zeros(1, [(value.name, element_type(value.number)) for value in program.inputs])
    for value in program.inputs:
        row[value.name] = to_raw(value, np.array([wires[value.name]]))
    got = np.frombuffer(link.step(row.tobytes(), 1), record_type(program))
    duties = {v.name: float(to_physical(v, got[f"out_{v.name}"])[0]) for v in program.outputs}
    return duties, int(got["status"][0])


def stepped(arithmetic: str, speed: float, step: float, late: int, **table: object) -> tuple[Array, NDArray[np.int64]]:
    """Return the currents (n,), complex, through a step of the reference of q at sample 400, and the status words.

    `late` are the samples by which the duties act later than they could.
    """
    program = lower(kinds()["foc"].design(request(**table)).law, arithmetic)
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
    link.reset()
    rotor, seen, status = Rotor(speed), [], []
    waiting: list[complex] = [complex(0.0, speed * FLUX)] * late
    for k in range(800):
        phases = [(rotor.current * np.exp(1j * (rotor.angle - n * 2 * math.pi / 3))).real for n in range(2)]
        wires = {
            "reference_d_A": 0.0,
            "reference_q_A": step if k >= 400 else 0.0,
            "current_a_A": phases[0],
            "current_b_A": phases[1],
            "angle_rad": (rotor.angle + math.pi) % (2 * math.pi) - math.pi,
            "speed_rad_s": speed,
            "supply_V": SUPPLY,
        }
        seen.append(rotor.current)
        duties, word = answered(program, link, wires)
        status.append(word)
        bridges = [duties[f"duty_{phase}"] * np.exp(2j * math.pi * n / 3) for n, phase in enumerate("abc")]
        waiting.append(complex(sum(bridges)) * SUPPLY / 1.5)
        rotor.hold(waiting.pop(0))
    return np.array(seen), np.array(status)


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
@pytest.mark.parametrize("speed", [0.0, 500.0])
def test_a_step_of_torque_neither_overshoots_nor_reaches_the_field(arithmetic: str, speed: float) -> None:
    """At a bandwidth of 2 kHz; the duties act at once."""
    seen, status = stepped(arithmetic, speed, 3.0, 0, bandwidth_rad_s=2 * math.pi * 2000.0)
    before, after = seen[300:400], seen[400:]
    assert np.max(np.abs(before)) < 0.01, "at rest before"
    assert np.max(after.imag) < 3.0 * 1.01
    assert np.argmax(after.imag > 0.9 * 3.0) <= 3, "to 90 % within three periods"
    assert np.max(np.abs(after.real)) < 3.0 * 0.03
    np.testing.assert_allclose(after[-100:], 3.0j, atol=0.01)
    assert np.all(status[410:] == 0)


def test_a_period_to_compute_is_in_the_margin() -> None:
    """The duties act a period late, at half the bandwidth: the current still settles without ringing."""
    seen, _ = stepped("fixed32", 0.0, 3.0, 1, bandwidth_rad_s=2 * math.pi * 1000.0)
    assert np.max(seen.imag) < 3.0 * 1.05
    np.testing.assert_allclose(seen[-100:], 3.0j, atol=0.01)


def test_without_voltage_enough_it_winds_nothing_up() -> None:
    """At a speed that takes all of the supply the step is not reached; back below it, the current is there at once."""
    seen, status = stepped("fixed32", 2000.0, 3.0, 0, bandwidth_rad_s=2 * math.pi * 2000.0)
    assert np.all(status[400:] == 1) and seen[-1].imag < 2.8
    back, _ = stepped("fixed32", 2000.0, 1.0, 0, bandwidth_rad_s=2 * math.pi * 2000.0)
    np.testing.assert_allclose(back[-100:], 1.0j, atol=0.02)


def test_a_duty_is_safe_where_the_angle_is_not_a_number() -> None:
    made = kinds()["foc"].design(request(bandwidth_rad_s=6000.0)).law
    program = lower(replace(made, safe=(0.5, 0.5, 0.5)), "float32")
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
    link.reset()
    wires = {name: (wire[1] + wire[2]) / 2 for name, wire in RANGES.items()}
    duties, status = answered(program, link, {**wires, "angle_rad": math.nan})
    assert set(duties.values()) == {0.5} and status == 2


@pytest.mark.parametrize(("arithmetic", "most"), [("fixed32", 1e-6), ("fixed16", 1e-3)])
def test_the_duties_follow_the_law(arithmetic: str, most: float) -> None:
    """Proven for any state and reading, and never seen beyond what is proven."""
    law = kinds()["foc"].design(request(bandwidth_rad_s=2 * math.pi * 1000.0, d_share=0.9)).law
    program = lower(law, arithmetic)
    blocks = adversarial(program, 4000, 1) + stimuli(program, [], 4000, 1)
    for found in measure_rounding(law, program, blocks, run_blocks(program, blocks)):
        assert 0.0 < found.worst <= found.bound <= most, found.output


WRONG = {
    "too quick": ({"bandwidth_rad_s": 15e3}, "leaves a phase margin of 26 degrees at period_s = 5e-05; give at most"),
    "gains beside tune": ({"bandwidth_rad_s": 1e3, "kp_d": 1.0}, "kp_d = 1.0 is given beside tune = 'pole_zero'"),
    "no bandwidth": ({}, "controller.bandwidth_rad_s is missing"),
    "coil too quick": (
        {"bandwidth_rad_s": 1e3, "Ld_H": 1e-6},
        "longer than the time constant of the winding, 2.78e-06",
    ),
    "coil too quick for gains": (
        {"kp_d": 1.0, "ki_d": 1e3, "kp_q": 1.0, "ki_q": 1e3, "tune": None, "Ld_H": 1e-6},
        "longer than the time constant of the winding, 2.78e-06",
    ),
    "modulation": ({"bandwidth_rad_s": 1e3, "modulation": 1.2}, "controller.modulation = 1.2 is out of range"),
    "decoupling": ({"bandwidth_rad_s": 1e3, "decoupling": 1}, "controller.decoupling = 1 is not a truth value"),
    "tracking": ({"bandwidth_rad_s": 1e3, "tt_s": 1e-6}, "controller.tt_s = 1e-06 is below period_s = 5e-05"),
    "unknown": ({"bandwidth_rad_s": 1e3, "bandwith": 1.0}, "a foc has no such key; did you mean 'bandwidth_rad_s'?"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    table, words = WRONG[case]
    with pytest.raises(DesignError) as refused:
        kinds()["foc"].design(request(**table))
    assert words in str(refused.value)


SWAPPED = {
    "a supply too low": (("supply_V", "V", 6.0, 30.0), "the 20 A of signals.reference_q_A take 7.2 V at rest already"),
    "counts": (("angle_rad", "counts", 0.0, 4096.0), "a foc takes it in 'rad': convert it"),
    "a supply that can be 0": (("supply_V", "V", 0.0, 30.0), "without a supply there is no duty"),
    "degrees": (("angle_rad", "deg", -180.0, 180.0), "signals.angle_rad is in 'deg'; a foc takes it in 'rad'"),
    "degrees called rad": (("angle_rad", "rad", 0.0, 360.0), "ranges from 0 to 360, a turn of degrees"),
    "degrees called rad, both ways": (("angle_rad", "rad", -180.0, 180.0), "a turn of degrees"),
    "counts called rad": (("angle_rad", "rad", 0.0, 4095.0), "ranges from 0 to 4095, a turn of counts"),
    "counts called rad, both ways": (("angle_rad", "rad", -32768.0, 32767.0), "a turn of counts"),
    "turns called rad": (("angle_rad", "rad", 0.0, 1.0), "1 of the 6.283 rad of a turn, as turns have it"),
    "a part of a turn": (("angle_rad", "rad", 0.0, 3.1416), "3.142 of the 6.283 rad of a turn; a foc"),
    "a sensor too small": (("current_a_A", "A", -3.0, 3.0), "asks for up to 20 A, which a phase carries both ways"),
    "a sensor of one sign": (("current_b_A", "A", 0.0, 30.0), "signals.current_b_A ranges from 0 to 30 A and"),
    "another name": (("theta", "rad", -3.0, 3.0), "they must be reference_d_A, reference_q_A"),
}


@pytest.mark.parametrize("case", SWAPPED)
def test_a_wire_that_is_wrong_is_named(case: str) -> None:
    wire, words = SWAPPED[case]
    made = request(bandwidth_rad_s=1e3)
    replaced = "angle_rad" if wire[0] == "theta" else wire[0]
    inputs = tuple(Signal(*wire) if signal.name == replaced else signal for signal in made.inputs)
    with pytest.raises(DesignError) as refused:
        kinds()["foc"].design(replace(made, inputs=inputs))
    assert words in str(refused.value)


@pytest.mark.parametrize("span", [(0.0, 6.28), (-3.14, 3.14), (-1000.0, 1000.0), (-4096.0, 4096.0), (0.0, 400.0)])
def test_an_angle_may_be_counted_on_over_turns(span: tuple[float, float]) -> None:
    made = request(bandwidth_rad_s=1e3)
    inputs = tuple(replace(s, low=span[0], high=span[1]) if s.name == "angle_rad" else s for s in made.inputs)
    assert kinds()["foc"].design(replace(made, inputs=inputs)).law.inputs == inputs


def test_a_duty_in_percent_is_refused() -> None:
    made = request(bandwidth_rad_s=1e3)
    outputs = tuple(replace(signal, unit="%", high=100.0) for signal in made.outputs)
    with pytest.raises(DesignError, match=r"signals.duty_a is in '%'; a foc gives shares of the period"):
        kinds()["foc"].design(replace(made, outputs=outputs))


@pytest.mark.parametrize("arithmetic", ["float32", "fixed32", "fixed16"])
def test_its_bench_closes_the_loop_around_the_plant(arithmetic: str) -> None:
    """As `verify` does on a target: duties to the plant, phase currents, angle and speed back, from rest."""
    machine = {name: value for name, value in TABLE.items() if name != "tune"}
    values = {**machine, "pole_pairs": PAIRS, "J_kg_m2": 2e-5, "b_N_m_s_rad": 1e-5}
    plant = make_plant("pmsm", ("voltage_d_V", "voltage_q_V"), ["speed_rad_s"], values)
    made = kinds()["foc"].design(replace(request(bandwidth_rad_s=2 * math.pi * 2000.0), plant=plant))
    assert made.bench is not None
    course = np.repeat([2.0, -1.0], 200)
    program = lower(made.law, arithmetic)
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
    run = close_loop(
        program, PlantLoop(made.bench.plant, course, (made.bench.told, ""), made.bench.read_by(made.law.inputs)), link
    )
    assert made.bench.plant.outputs[0].name == "current_q_A"
    current = run.measurement
    assert np.argmax(current > 0.9 * 2.0) <= 3 and np.max(current) < 2.0 * 1.05
    assert np.argmax(current[200:] < 2.0 - 0.9 * 3.0) <= 3 and np.min(current) > -1.0 - 3.0 * 0.05
    np.testing.assert_allclose(current[100:200], 2.0, atol=0.02)
    np.testing.assert_allclose(current[300:], -1.0, atol=0.02)


def test_the_machine_is_taken_from_the_plant() -> None:
    machine = {name: value for name, value in TABLE.items() if name != "tune"}
    values = {**machine, "pole_pairs": PAIRS, "J_kg_m2": 1e-5, "b_N_m_s_rad": 0.0}
    plant = make_plant("pmsm", ("voltage_d_V", "voltage_q_V"), ["speed_rad_s"], values)
    given = request(bandwidth_rad_s=6000.0)
    short = replace(given, table={"tune": "pole_zero", "bandwidth_rad_s": 6000.0}, plant=plant)
    assert kinds()["foc"].design(short).gains == kinds()["foc"].design(given).gains
    with pytest.raises(DesignError, match=r"R_ohm is missing; give it, or a .plant. of kind pmsm"):
        kinds()["foc"].design(replace(short, plant=None))
