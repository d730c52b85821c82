"""A current loop gives back what the dead time of its bridges takes: the current's shape, the C in the loop.

The machine turns at a held speed and is integrated here by itself, phase by phase, with bridges that lose V sign(i).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.codegen.emit import emit
from firmloop.design.design import Design
from firmloop.design.kinds import kinds
from firmloop.design.law import DesignError
from firmloop.identify.plants.attach import with_effects
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse, Plant
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.proofs.closed_loop import PlantLoop, close_loop
from tests.verify.test_current_loop import FINE, FLUX, HOST, LD, LQ, PAIRS, PERIOD, SUPPLY, R, Rotor, answered, request

DEAD, SPEED = 0.6, 200.0  # V, rad/s electrical
METAL = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX, "pole_pairs": PAIRS, "J_kg_m2": 2e-5, "b_N_m_s_rad": 1e-5}
TURNS = np.exp(2j * math.pi * np.arange(3) / 3)


def machine(*effects: EffectUse) -> Plant:
    outputs = ["speed_rad_s", "current_a_A"]
    return with_effects(make_plant("pmsm", ("voltage_d_V", "voltage_q_V"), outputs, METAL), effects)


def designed(feedforward: bool, **more: object) -> Design:
    own = {"feedforward": {"from": "effects"}} if feedforward else {}
    made = request(bandwidth_rad_s=2 * math.pi * 500.0, d_share=0.9, **own, **more)
    return kinds()["foc"].design(replace(made, plant=machine(EffectUse("dead_time", values={"voltage_V": DEAD}))))


class Bridged(Rotor):
    """A rotor behind bridges that wait between their switches; near no current the loss is a line."""

    def hold(self, voltage: complex) -> None:
        h, soft = PERIOD / FINE, 0.1 * DEAD / R
        for _ in range(FINE):
            currents = (self.current * np.exp(1j * self.angle) / TURNS).real
            lost = DEAD * currents / np.sqrt(currents**2 + soft**2)
            seen = voltage - complex(lost @ TURNS) / 1.5 - R * self.current * np.exp(1j * self.angle)
            self.flux, self.angle = self.flux + h * seen, self.angle + h * self.speed


def phase_current(arithmetic: str, feedforward: bool, current: float) -> NDArray[np.float64]:
    """Return the current of phase a over two electrical turns at a held speed, once the loop has settled."""
    program = lower(designed(feedforward).law, arithmetic)
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
    link.reset()
    rotor, seen = Bridged(SPEED), []
    turn = round(2 * math.pi / SPEED / PERIOD)
    for _ in range(4 * turn):
        phases = (rotor.current * np.exp(1j * rotor.angle) / TURNS).real
        seen.append(phases[0])
        wires = {
            **{"reference_d_A": 0.0, "reference_q_A": current, "current_a_A": phases[0], "current_b_A": phases[1]},
            "angle_rad": (rotor.angle + math.pi) % (2 * math.pi) - math.pi,
            **{"speed_rad_s": SPEED, "supply_V": SUPPLY},
        }
        duties, _ = answered(program, link, wires)
        rotor.hold(
            complex(sum(duties[f"duty_{x}"] * turned for x, turned in zip("abc", TURNS, strict=True))) * SUPPLY / 1.5
        )
    return np.array(seen[-2 * turn :])


def distortion(course: NDArray[np.float64]) -> float:
    """Return the harmonics of a course of two turns over its fundamental, rms."""
    lines = np.abs(np.fft.rfft(course))
    return float(np.sqrt(np.sum(lines[4:200:2] ** 2)) / lines[2])


@pytest.mark.parametrize("arithmetic", ["float32", "fixed16"])
def test_the_current_is_a_sine_again(arithmetic: str) -> None:
    before, after = (distortion(phase_current(arithmetic, feedforward, 2.0)) for feedforward in (False, True))
    assert before > 0.05 and after < 0.012


def test_the_wave_is_followed_closer() -> None:
    """Against the plant with its effects, as `verify` follows it."""
    errors = []
    for made in (designed(False), designed(True)):
        bench, program = made.bench, lower(made.law, "fixed32")
        assert bench is not None
        link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
        course = 2.0 * np.sin(2 * math.pi * np.arange(1500) / 500)
        run = close_loop(
            program, PlantLoop(bench.plant, course, (bench.told, ""), bench.read_by(made.law.inputs)), link
        )
        errors.append(float(np.sqrt(np.mean((run.reference - run.measurement)[500:] ** 2))))
    assert errors[1] < 0.5 * errors[0], errors


def test_other_effects_are_told_and_none_is_refused() -> None:
    own = {"feedforward": {"from": "effects"}}
    dead, friction = (
        EffectUse("dead_time", values={"voltage_V": DEAD}),
        EffectUse("coulomb_friction", values={"torque_N_m": 1e-3}),
    )
    wanted = request(bandwidth_rad_s=3e3, **own)
    made = kinds()["foc"].design(replace(wanted, plant=machine(dead, friction)))
    assert made.not_met == {"coulomb_friction": "it acts on the shaft; the loop around, of speed, meets it"}
    assert made.law.says.endswith("feedforward for dead_time, 0.6 V")
    for plant in (None, machine(friction)):
        with pytest.raises(DesignError, match="meets the effect dead_time alone, and the plant has none"):
            kinds()["foc"].design(replace(wanted, plant=plant))
    with pytest.raises(DesignError, match=r"controller.feedforward.sofd = 1: that of a foc has no such key"):
        kinds()["foc"].design(request(bandwidth_rad_s=3e3, feedforward={"from": "effects", "sofd": 1}))
