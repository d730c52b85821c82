"""A certificate of a closed loop for all time covers what is found, and a wrong one is refused by what is wrong."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg

from bench.proofs.for_ever import LOOPS, made, worst_found
from firmloop.cli import main
from firmloop.door.generate import Code
from firmloop.stages import proving
from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, UNKNOWN
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.forever.exponential import PLACES, exponential
from firmloop.verify.proofs.forever.sampled import sample
from firmloop.verify.proofs.forever.stated import read_stated
from firmloop.verify.proofs.forever.sums import positive_definite
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import every_judge

JUDGE = every_judge()["for_ever"]
NAME = "lag_pi"


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Code, Claims, Any]:
    """A first-order lag in intervals under a PI controller: its code, its claims and the certificate."""
    return made(LOOPS[NAME], tmp_path_factory.mktemp("loop"))


def judged(claims: Claims, document: Any) -> tuple[str, str]:
    said = JUDGE.judge(Delivered(claims, None, document))
    return said.result, said.says


def test_a_bound_for_all_time_is_proven_and_close_to_the_worst_that_a_search_finds(
    found: tuple[Code, Claims, Any],
) -> None:
    code, claims, document = found
    result, says = judged(claims, document)
    assert result == PROVEN and "|error| <=" in says and "for every plant in 2 intervals" in says
    worst, bound = worst_found(code, claims, document, draws=3), float(document["error"])
    assert 0.5 * bound <= worst <= bound
    assert float(document["reach"]) > 10.0  # rad/s: the certificate is not one of a loop that stands still


def _error(document: Any) -> None:
    document["error"] = repr(0.999 * float(document["error"]))


def _level(document: Any) -> None:
    document["parts"][0]["levels"][0] = repr(0.999 * float(document["parts"][0]["levels"][0]))


def _reach(document: Any) -> None:
    document["reach"] = repr(1.001 * float(document["reach"]))


def _limit(document: Any) -> None:
    document["reach"] = repr(1.05 * float(document["reach"]))
    document["error"] = repr(1.1 * float(document["error"]))
    part = document["parts"][0]
    part["levels"] = [repr(1.1 * float(level)) for level in part["levels"]]


def _wider(document: Any) -> None:
    document["plant"]["parameters"][0]["high"] = "60.0"


def _other_plant(document: Any) -> None:
    document["plant"]["parameters"][0] |= {"low": "60.0", "high": "61.0"}
    document["parts"][0]["box"][0] = ["60.0", "61.0"]


def _overlap(document: Any) -> None:
    document["parts"].append(copy.deepcopy(document["parts"][0]))


def _lyapunov(document: Any) -> None:
    document["parts"][0]["lyapunov"][0][0] = "-1.0"


def _rate(document: Any) -> None:
    document["parts"][0]["rate"] = "0.5"


def _stale(document: Any) -> None:
    document["program_id"] = "0" * 16


def _wire(document: Any) -> None:
    document["wires"]["measured"] = {"speed": 0}


def _divides(document: Any) -> None:
    at = next(k for k, op in enumerate(document["plant"]["operations"]) if op[0] in ("div", "inv"))
    zero = ["number", "0"]
    document["plant"]["operations"][at] = ["inv", 0]
    document["plant"]["operations"][0] = zero


def _missing(document: Any) -> None:
    del document["parts"][0]["levels"]


def _samples(document: Any) -> None:
    document["parts"][0]["steps"] = 3


PLANTED: dict[str, tuple[Callable[[Any], None], str]] = {
    "a smaller bound of the error": (_error, "|error| is stated to stay within"),
    "a smaller bound of a state": (_level, "plant state 0 is stated to stay within"),
    "a farther reference": (_reach, "is stated to stay within"),
    "a reference at which a limit acts": (_limit, "another line holds from"),
    "wider intervals than its parts": (_wider, "leave out some of the plant's intervals"),
    "the certificate of another plant": (_other_plant, ""),
    "two parts that overlap": (_overlap, "overlap"),
    "a Lyapunov matrix that is none": (_lyapunov, "Lyapunov"),
    "a loop that falls faster than it does": (_rate, "does not fall by 0.5"),
    "another program": (_stale, "one of them is stale"),
    "a wire that is not there": (_wire, "no 'speed'"),
    "a plant that divides by zero": (_divides, "divides by an interval that holds 0"),
    "a part without levels": (_missing, "levels is no list"),
    "too few samples": (_samples, "is stated to stay within"),
}


@pytest.mark.parametrize("planted", PLANTED)
def test_a_wrong_certificate_is_refused_by_name(planted: str, found: tuple[Code, Claims, Any]) -> None:
    _, claims, document = found
    change, words = PLANTED[planted]
    wrong = copy.deepcopy(document)
    change(wrong)
    result, says = judged(claims, wrong)
    assert result == REFUTED and words in says


def test_without_a_certificate_nothing_is_said(found: tuple[Code, Claims, Any]) -> None:
    _, claims, _ = found
    assert judged(claims, None)[0] == NOT_RUN
    assert judged(claims, {"found": False, "why": "the plant has effects: backlash"}) == (
        UNKNOWN,
        "no certificate was found: the plant has effects: backlash",
    )


def test_a_loop_that_is_not_stable_has_no_certificate(tmp_path: Path) -> None:
    text = LOOPS[NAME].replace('tune = "simc"\ntau_c_s = 0.02', "kp = 3.0\nki = 1.0")
    _, claims, document = made(text, tmp_path)
    result, says = judged(claims, document)
    assert result == UNKNOWN and "not stable near rest" in says


def test_prove_writes_the_certificate_and_judges_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project, out = tmp_path / "loop.toml", tmp_path / "out"
    project.write_text(LOOPS[NAME])
    assert main(["prove", str(project), "--out", str(out), "--judge", "for_ever"]) == 0
    assert "for every plant in 2 intervals" in capsys.readouterr().out
    (said,) = json.loads((out / "proofs.json").read_text())["proofs"]
    assert (said["judge"], said["result"]) == ("for_ever", PROVEN)
    document = json.loads((out / "loop.json").read_text())
    _error(document)
    (out / "loop.json").write_text(json.dumps(document))
    assert main(["prove", str(out), "--judge", "for_ever"]) == 1
    assert "|error| is stated to stay within" in capsys.readouterr().out


def test_what_is_no_linear_plant_ends_in_unknown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = tmp_path / "loop.toml"
    effect = '[[plant.effects]]\nname = "coulomb_friction"\ntorque_N_m = 1.1e-3\n'
    text = LOOPS["motor_pi"].replace("[controller]", f"{effect}[controller]", 1)
    project.write_text(text)
    code = main(["prove", str(project), "--out", str(tmp_path / "out"), "--judge", "for_ever"])
    said = capsys.readouterr().out
    assert code == 3 and "not proven: for_ever: unknown" in said


def test_without_names_a_loop_that_is_not_bounded_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proving, "every_judge", lambda: {"for_ever": JUDGE})
    project, out = tmp_path / "loop.toml", tmp_path / "out"
    project.write_text(LOOPS[NAME].replace('"fixed"\nbits = 32\nrounding = "nearest"', '"float32"'))
    assert main(["prove", str(project), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "not bounded for ever: a certificate is of fixed point, and the program is in float32" in said
    assert not (out / "loop.json").exists()


def test_the_sampled_plant_is_inside_its_enclosure(found: tuple[Code, Claims, Any]) -> None:
    _, claims, document = found
    stated = read_stated(document)
    (part,) = stated.parts
    plant = sample(stated.equations, part.box, Fraction(repr(claims.period)), part.modes)
    random = np.random.default_rng(1)
    names = [name for name, *_ in stated.equations.parameters]
    for _ in range(50):
        drawn = {
            name: float(low) + random.choice([0.0, random.random(), 1.0]) * float(high - low)
            for name, (low, high) in zip(names, part.box, strict=True)
        }
        pole = float(np.exp(-claims.period / drawn["time_constant_s"]))
        for value, (low, high) in ((pole, plant.a[0][0]), (drawn["gain"] * (1 - pole), plant.taps[0][0][0])):
            assert low - Fraction(1, 10**12) <= Fraction(value) <= high + Fraction(1, 10**12)
    assert plant.a[0][0][1] - plant.a[0][0][0] < Fraction(1, 100)


def test_a_matrix_exponential_is_within_its_bound() -> None:
    random = np.random.default_rng(2)
    for order, size in ((1, 0.1), (2, 3.0), (3, 20.0), (5, 1.0)):
        matrix = random.normal(size=(order, order)) * size
        found = exponential([[Fraction(float(x)) for x in row] for row in matrix])
        truth = scipy.linalg.expm(matrix)
        got = np.array([[float(Fraction(int(x), 1 << PLACES)) for x in row] for row in found.whole])
        assert np.allclose(got, truth, rtol=1e-9, atol=1e-12 * np.max(np.abs(truth)))
        assert found.off < 1 << (PLACES // 2)


def test_definiteness_is_decided_exactly() -> None:
    edge = Fraction(1, 10**30)
    assert positive_definite([[Fraction(1), Fraction(1)], [Fraction(1), Fraction(1) + edge]])
    assert not positive_definite([[Fraction(1), Fraction(1)], [Fraction(1), Fraction(1)]])
    assert not positive_definite([[Fraction(1), Fraction(1)], [Fraction(1), Fraction(1) - edge]])
