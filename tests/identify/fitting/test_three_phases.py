"""A log of a permanent-magnet machine that cannot be right is told in one sentence, with the way out."""

from __future__ import annotations

import math
from itertools import combinations
from types import MappingProxyType

import numpy as np
import pytest

from firmloop.identify.fitting.checks.three_phases import look
from firmloop.identify.fitting.evidence import Evidence
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import conditioning_from_table
from firmloop.identify.recordings.recording import Recording

R, LD, LQ, FLUX, J = 0.36, 0.2e-3, 0.33e-3, 6.4e-3, 4.8e-6
H, ROWS = 50e-6, 2000
VALUES = {"R_ohm": R, "Ld_H": LD, "Lq_H": LQ, "flux_Wb": FLUX, "J_kg_m2": J, "b_N_m_s_rad": 1e-5}


def log(pairs: int, knee: float = 1e6) -> dict[str, np.ndarray]:
    """Return the columns of a drive that steps its voltages, by fine steps, with noise; `knee` halves an inductance."""
    random = np.random.default_rng(4)
    v = np.repeat(random.choice([-4.0, 1.0, 5.0, 7.0], size=(ROWS // 50, 2)) * (0.2, 1.0), 50, axis=0)
    x, rows = np.zeros(4), []
    for v_d, v_q in v:
        rows.append(x.copy())
        for _ in range(10):
            d, q, w, th = x
            along, across = LD * knee * math.atan(d / knee), LQ * knee * math.atan(q / knee)
            x = x + H / 10 * np.array(
                [
                    (v_d - R * d + pairs * w * across) / LD * (1.0 + (d / knee) ** 2),
                    (v_q - R * q - pairs * w * (along + FLUX)) / LQ * (1.0 + (q / knee) ** 2),
                    (1.5 * pairs * ((FLUX + along) * q - across * d) - 1e-5 * w) / J,
                    w,
                ]
            )
    d, q, w, th = np.array(rows).T
    phases = [d * np.cos(pairs * th - n) - q * np.sin(pairs * th - n) for n in (0.0, 2 * math.pi / 3, 4 * math.pi / 3)]
    columns = {"voltage_d_V": v[:, 0], "voltage_q_V": v[:, 1], "current_d_A": d, "current_q_A": q, "speed_rad_s": w}
    columns |= {f"current_{name}_A": phase for name, phase in zip("abc", phases, strict=True)}
    noisy = {name: value + 0.01 * random.normal(size=ROWS) * ("_A" in name) for name, value in columns.items()}
    return {**noisy, "position_rad": th}


def said(columns: dict[str, np.ndarray], pairs: float) -> tuple[str, ...]:
    plant = make_plant("pmsm", ("voltage_d_V", "voltage_q_V"), ["current_d_A"], {**VALUES, "pole_pairs": pairs})
    recording = Recording(np.arange(ROWS) * H, MappingProxyType(columns), (), "log.csv", "")
    return look(Evidence(plant, (recording,), conditioning_from_table({}), None))


@pytest.mark.parametrize("pairs", [1, 4, 7])
def test_a_sound_log_is_met_with_silence(pairs: int) -> None:
    assert said(log(pairs), pairs) == ()


@pytest.mark.parametrize(("given", "true"), [(8, 4), (2, 4), (14, 7), (4, 3)])
def test_pole_pairs_that_are_wrong_by_a_factor(given: int, true: int) -> None:
    columns = {name: value for name, value in log(true).items() if "_A" not in name or name[8] in "dq"}
    (one,) = said(columns, given)
    assert (
        one.startswith(f"pole_pairs = {given}, but the currents of log.csv fit ")
        and f"correct pole_pairs to {true}" in one
    )


@pytest.mark.parametrize(("given", "true"), [(8, 4), (2, 4), (5, 4), (14, 7), (1, 3)])
def test_pole_pairs_that_are_wrong_beside_phase_currents(given: int, true: int) -> None:
    columns = {name: value for name, value in log(true).items() if name not in ("current_d_A", "current_q_A")}
    (one,) = [one for one in said(columns, given) if "pole_pairs" in one]
    assert f"correct pole_pairs to {true}" in one


@pytest.mark.parametrize(
    ("times", "way"),
    [
        (30.0 / math.pi, 'unit = "rpm"'),
        (180.0 / math.pi, 'unit = "deg/s"'),
        (2.9, "no whole number; speed_rad_s is off"),
    ],
)
def test_a_speed_in_another_unit_is_no_reason_to_change_the_pole_pairs(times: float, way: str) -> None:
    columns = {name: value for name, value in log(4).items() if "_A" not in name or name[8] in "dq"}
    del columns["position_rad"]
    (one,) = said({**columns, "speed_rad_s": times * columns["speed_rad_s"]}, 4)
    assert way in one and "correct pole_pairs" not in one


@pytest.mark.parametrize("pairs", [1, 4, 7])
def test_a_sound_log_of_two_phases_is_met_with_silence(pairs: int) -> None:
    columns = {name: value for name, value in log(pairs).items() if name[8:] not in ("d_A", "q_A", "c_A")}
    assert said(columns, pairs) == ()


def test_voltages_that_are_exchanged_beside_phase_currents() -> None:
    columns = {name: value for name, value in log(4).items() if name[8:] not in ("d_A", "q_A", "c_A")}
    swapped = {**columns, "voltage_d_V": columns["voltage_q_V"], "voltage_q_V": columns["voltage_d_V"]}
    (one,) = said(swapped, 4)
    assert one.startswith("voltage_d_V and voltage_q_V of log.csv look exchanged: ")


@pytest.mark.parametrize("pair", list(combinations("abc", 2)))
def test_duties_that_are_exchanged(pair: tuple[str, str]) -> None:
    columns = log(4)
    angle, supply = 4.0 * columns["position_rad"], np.full(ROWS, 24.0)
    volts = (columns.pop("voltage_d_V") + 1j * columns.pop("voltage_q_V")) * np.exp(1j * angle)
    for k, name in enumerate("abc"):
        columns[f"duty_{name}"] = 0.5 + (volts * np.exp(-2j * math.pi / 3 * k)).real / supply
    columns |= {"supply_V": supply, "angle_rad": angle}
    assert said(columns, 4) == ()
    one, other = (f"duty_{name}" for name in pair)
    (told,) = said({**columns, one: columns[other], other: columns[one]}, 4)
    assert told.startswith(f"{one} and {other} of log.csv look exchanged: ")


def test_the_electrical_speed_in_the_place_of_the_shafts() -> None:
    columns = log(4)
    columns["speed_rad_s"] = 4 * columns["speed_rad_s"]
    del columns["position_rad"]
    (one,) = said(columns, 4)
    assert "correct pole_pairs to 1, or speed_rad_s is the electrical speed" in one


WRONG = {
    "two phases swapped": (
        {"current_a_A": ("current_b_A", 1.0, 0.0), "current_b_A": ("current_a_A", 1.0, 0.0)},
        "look swapped",
    ),
    "one sign": ({"current_a_A": ("current_a_A", -1.0, 0.0)}, "current_a_A of log.csv looks turned around"),
    "the other sign": ({"current_b_A": ("current_b_A", -1.0, 0.0)}, "current_b_A of log.csv looks turned around"),
    "the position's sign": ({"position_rad": ("position_rad", -1.0, 0.0)}, "position_rad of log.csv moves against"),
    "an offset": ({"current_c_A": ("current_c_A", 1.0, 3.0)}, "an offset of a sensor: subtract it"),
    "a gain": ({"current_c_A": ("current_c_A", 0.7, 0.0)}, "do not sum up to 0"),
    "degrees": ({"position_rad": ("position_rad", 180 / math.pi, 0.0)}, "it looks like degrees"),
    "counts": ({"position_rad": ("position_rad", 4096 / (2 * math.pi), 0.0)}, "it looks like counts, 4096 a turn"),
    "electrical": ({"position_rad": ("position_rad", 4.0, 0.0)}, "it looks electrical; divide it by pole_pairs"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named(case: str) -> None:
    changed, words = WRONG[case]
    right = log(4)
    columns = {**right, **{name: gain * right[source] + offset for name, (source, gain, offset) in changed.items()}}
    told = said(columns, 4)
    assert any(words in one for one in told), told
    assert all("\n" not in one and len(one) < 400 for one in told)


def test_axes_that_rock_about_the_magnets_are_no_other_number_of_pole_pairs() -> None:
    """An encoder far out of true turns currents and voltages: their rise alone would show 5.7."""
    right = log(4)
    columns = {name: value for name, value in right.items() if name[8:] not in ("a_A", "b_A", "c_A")}
    rocking = np.exp(-1.2j * np.sin(columns["position_rad"] + 3.1))
    for quantity in ("voltage_{}_V", "current_{}_A"):
        d, q = (quantity.format(axis) for axis in "dq")
        turned = (columns[d] + 1j * columns[q]) * rocking
        columns |= {d: turned.real, q: turned.imag}
    assert said(columns, 4) == ()


def test_iron_that_saturates_is_no_other_number_of_pole_pairs() -> None:
    """The more current flows, the faster it rises: what all of it fits are fewer pole pairs."""
    assert said(log(4, knee=8.5), 4) == ()
