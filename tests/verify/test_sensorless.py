"""A current loop without an encoder: started by a ramp, then on the observer's angle, held against the true one.

The machine is integrated here by itself, with a shaft that turns freely and sensors with noise; the C is in the loop.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from firmloop.codegen.emit import emit
from firmloop.design.design import Request
from firmloop.design.kinds import kinds
from firmloop.design.law import DesignError
from firmloop.identify.signal import Signal
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from tests.verify.test_current_loop import FLUX, HOST, LD, LQ, PAIRS, PERIOD, SUPPLY, R, Rotor, answered, request

RATED = SUPPLY / math.sqrt(3.0) / FLUX  # rad/s electrical, where the supply ends
STARTED = {"start_A": 3.0, "ramp_rad_s2": 2000.0, "hand_over_rad_s": 200.0, "pll_rad_s": 500.0}
INERTIA, NOISE, STEPS = 1e-4, 0.02, 10_000  # kg m^2, A rms


def wanted(**table: object) -> Request:
    made = request(bandwidth_rad_s=2 * math.pi * 500.0, d_share=0.9, **{**STARTED, **table})
    outputs = (*made.outputs, Signal("angle_rad", "rad", -3.2, 3.2), Signal("speed_rad_s", "rad/s", -4000.0, 4000.0))
    inputs = tuple(wire for wire in made.inputs if wire.name not in ("angle_rad", "speed_rad_s"))
    return replace(made, inputs=inputs, outputs=outputs)


class Free(Rotor):
    """A rotor that its own torque turns."""

    def hold(self, voltage: complex) -> None:
        h = PERIOD / 4
        for _ in range(4):
            turn = np.exp(1j * self.angle)
            current = self.current
            self.flux = self.flux + h * (voltage - R * current * turn)
            torque = 1.5 * PAIRS * (FLUX * current.imag + (LD - LQ) * current.real * current.imag)
            self.speed += h * PAIRS * torque / INERTIA
            self.angle += h * self.speed


def started(arithmetic: str, observer: str, current: float) -> NDArray[np.float64]:
    """Return the speed in rad/s and the error of the angle in degrees (n, 2), from rest anywhere."""
    program = lower(kinds()["foc"].design(wanted(observer=observer)).law, arithmetic)
    link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
    link.reset()
    rotor, random, seen = Free(0.0, FLUX * np.exp(1j), 1.0), np.random.default_rng(1), []
    for _ in range(STEPS):
        phases = [(rotor.current * np.exp(1j * (rotor.angle - n * 2 * math.pi / 3))).real for n in range(2)]
        noisy = np.array(phases) + NOISE * random.normal(size=2)
        wires = {"current_a_A": noisy[0], "current_b_A": noisy[1], "supply_V": SUPPLY}
        told, _ = answered(program, link, {**wires, "reference_d_A": 0.0, "reference_q_A": current})
        off = math.degrees((told["angle_rad"] - rotor.angle + math.pi) % (2 * math.pi) - math.pi)
        seen.append((rotor.speed, off))
        bridges = [told[f"duty_{phase}"] * np.exp(2j * math.pi * n / 3) for n, phase in enumerate("abc")]
        rotor.hold(complex(sum(bridges)) * SUPPLY / 1.5)
    return np.array(seen)


@pytest.mark.parametrize(
    ("observer", "arithmetic", "current"),
    [
        ("flux", "fixed32", 2.0),
        ("sliding_mode", "fixed32", -2.0),
        ("flux", "float32", -2.0),
        ("sliding_mode", "float32", 2.0),
    ],
)
def test_it_starts_from_rest_and_knows_its_angle(observer: str, arithmetic: str, current: float) -> None:
    """Either way round; the error at each tenth of the rated speed, while it still accelerates."""
    seen = started(arithmetic, observer, current)
    speed = seen[:, 0] * math.copysign(1.0, current)
    assert speed[-1] > 0.5 * RATED
    first = int(np.argmax(speed > 0.1 * RATED))
    assert np.all(speed[first:] > 0.09 * RATED), "the hand-over does not let it fall back"
    rms = [
        float(np.sqrt(np.mean(seen[(speed > low * RATED) & (speed < (low + 0.1) * RATED), 1] ** 2)))
        for low in (0.1, 0.2, 0.3, 0.4)
    ]
    assert max(rms) < 2.0, rms


WRONG = {
    "no such": ({"observer": "fluxx"}, "controller.observer = 'fluxx' is unknown; did you mean 'flux'?"),
    "too late": ({"observer": "flux", "hand_over_rad_s": 3000.0}, "more than half of what the supply allows"),
    "too fast": ({"observer": "flux", "pll_rad_s": 9000.0}, "pll_rad_s = 9000 is too fast for period_s = 5e-05"),
    "too much": ({"observer": "flux", "start_A": 30.0}, "start_A = 30 is beyond signals.reference_q_A"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    table, words = WRONG[case]
    with pytest.raises(DesignError) as refused:
        kinds()["foc"].design(wanted(**table))
    assert words in str(refused.value)


def test_keys_of_an_observer_need_one() -> None:
    with pytest.raises(DesignError, match='start_A has no effect without an observer; add observer = "flux"'):
        kinds()["foc"].design(request(bandwidth_rad_s=3e3, start_A=1.0))
