"""The current along d that a foc adds: against a search over all currents of one torque, and beyond the base speed."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

from firmloop.codegen.emit import emit
from firmloop.design.kinds import kinds
from firmloop.design.kinds.foc.field import field_of
from firmloop.design.law import DesignError
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.host import build_host
from firmloop.verify.links.library import LibraryLink
from tests.verify.test_current_loop import FLUX, HOST, LD, SUPPLY, TABLE, Rotor, answered, request

BASE = SUPPLY / math.sqrt(3.0) / FLUX  # rad/s electrical


@pytest.mark.parametrize("salient", [{}, {"Lq_H": 0.8e-3}, {"Ld_H": 0.5e-3}])
def test_the_table_gives_the_least_current_for_its_torque(salient: dict[str, float]) -> None:
    """Whichever axis has the larger inductance: no other current along d gives the same torque with less."""
    machine = {key: value for key, value in {**TABLE, **salient}.items() if key != "tune"}
    wires = {wire.name: wire for wire in request(bandwidth_rad_s=1e3).inputs}
    found = field_of({"mtpa": True}, machine, 1.0, wires)
    assert found is not None
    psi, difference = machine["flux_Wb"], machine["Ld_H"] - machine["Lq_H"]
    for q in np.linspace(-20.0, 20.0, 13):
        d = float(ca.DM(ca.evalf(found.added(ca.SX(q), {}))))
        torque = (psi + difference * d) * q
        tried = np.linspace(-20.0, 20.0, 40_001)
        with np.errstate(divide="ignore"):
            needed = np.hypot(tried, torque / (psi + difference * tried))
        assert math.hypot(d, q) <= float(np.min(needed)) + 20.0 / 2000.0


def test_the_current_is_reached_beyond_the_base_speed() -> None:
    """At 1.2 times the speed that the supply allows: without weakening it is not."""
    reached = []
    for more in ({}, {"weakening_A": 15.0}):
        law = kinds()["foc"].design(request(bandwidth_rad_s=2 * math.pi * 1000.0, d_share=0.9, **more)).law
        program = lower(law, "fixed32")
        link = LibraryLink(build_host(emit(program, "firmloop generate test.toml"), HOST), program)
        link.reset()
        rotor = Rotor(1.2 * BASE)
        seen = []
        for _ in range(900):
            phases = [(rotor.current * np.exp(1j * (rotor.angle - n * 2 * math.pi / 3))).real for n in range(2)]
            wires = {"reference_d_A": 0.0, "reference_q_A": 3.0, "current_a_A": phases[0], "current_b_A": phases[1]}
            wires |= {"speed_rad_s": rotor.speed, "supply_V": SUPPLY}
            wires["angle_rad"] = (rotor.angle + math.pi) % (2 * math.pi) - math.pi
            duties, _ = answered(program, link, wires)
            seen.append(rotor.current)
            bridges = [duties[f"duty_{phase}"] * np.exp(2j * math.pi * n / 3) for n, phase in enumerate("abc")]
            rotor.hold(complex(sum(bridges)) * SUPPLY / 1.5)
        reached.append(complex(np.mean(seen[-200:])))
    assert reached[0].imag < 1.0
    assert abs(reached[1].imag - 3.0) < 0.1 and -15.0 < reached[1].real < -5.0


WRONG = {
    "round": ({"mtpa": True, "Lq_H": LD}, "mtpa = true has nothing to do where Ld_H and Lq_H are the same"),
    "too much": ({"weakening_A": 40.0}, "weakening_A = 40 takes the whole field away: psi/Ld is 32 A"),
    "beyond": ({"weakening_A": 31.0}, "beyond signals.current_a_A or current_b_A, 30 A"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    table, words = WRONG[case]
    with pytest.raises(DesignError) as refused:
        kinds()["foc"].design(request(bandwidth_rad_s=3e3, **table))
    assert words in str(refused.value)
