"""A recording too short for the model asked is refused with the figures, and one that just does is fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.fit import fit
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.recordings.conditioning import NONE, Conditioning
from firmloop.identify.recordings.recording import Recording, make_recording

STARTS = {
    "first_order": {"gain": 1.5, "time_constant_s": 0.5, "delay_s": 0.0},
    "second_order": {"gain": 1.5, "natural_frequency_rad_s": 3.0, "damping_ratio": 1.0, "delay_s": 0.0},
    "process": {
        "gain": 1.5,
        "time_constant_s": 0.5,
        "second_time_constant_s": 0.1,
        "zero_time_constant_s": 0.0,
        "delay_s": 0.0,
    },
}


def step(rows: int, span: float, slowness: float = 0.4) -> Recording:
    """Return a step of 2 through a lag of gain 1.5."""
    time = np.linspace(0.0, span, rows)
    return make_recording(time, {"u": np.full(rows, 2.0), "y": 3.0 * (1.0 - np.exp(-time / slowness))}, "short.csv", "")


@pytest.mark.parametrize(("kind", "needed"), [("first_order", 17), ("second_order", 24), ("process", 29)])
def test_six_rows_are_too_few_for_any_model(kind: str, needed: int) -> None:
    plant = make_plant(kind, "u", ["y"], STARTS[kind])
    with pytest.raises(IdentifyError, match=rf"short.csv: 6 rows are too few for {kind}: .* at least {needed} rows"):
        fit(plant, [step(6, 2.0)], [], NONE)


def test_windows_cost_an_initial_state_each() -> None:
    plant = make_plant("first_order", "u", ["y"], STARTS["first_order"])
    assert len(fit(plant, [step(26, 1.0)], [], NONE).starts) > 0
    with pytest.raises(
        IdentifyError, match=r"26 rows are too few .* 3 free parameters and 6 initial states .* 27 rows"
    ):
        fit(plant, [step(26, 1.0)], [], Conditioning(window_s=0.16))


def test_an_end_before_the_first_time_constant_is_refused_with_the_time_it_takes() -> None:
    plant = make_plant("first_order", "u", ["y"], {**STARTS["first_order"], "delay_s": {"value": 0.0, "free": False}})
    with pytest.raises(IdentifyError, match=r"0.3 s are too short for first_order: .* 0.4 s, .* at least 1.2 s"):
        fit(plant, [step(200, 0.3)], [], NONE)
    found = fit(plant, [step(200, 0.3), step(200, 0.6)], [], NONE)
    assert {p.name: p.value for p in found.plant.parameters}["gain"] == pytest.approx(1.5, rel=1e-3)
    known = make_plant("first_order", "u", ["y"], {"gain": {"value": 1.5, "free": False}, "time_constant_s": 1.0})
    assert fit(known, [step(200, 0.3)], [], NONE).plant.parameters[1].value == pytest.approx(0.4, rel=1e-3)


def test_the_command_line_says_it_in_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "short.csv").write_text("time_s,u,y\n" + "".join(f"{0.1 * k:.1f},1,{k % 3}\n" for k in range(6)))
    project = tmp_path / "p.toml"
    project.write_text(
        'schema = 1\nname = "brief"\n[recordings]\ntrain = ["short.csv"]\n[plant]\nkind = "second_order"\n'
        'input = "u"\noutputs = ["y"]\n'
    )
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert "6 rows are too few for second_order" in said and "at least 24 rows" in said
    assert not (tmp_path / "out" / "project.toml").exists()


def test_a_lag_that_only_integrates_is_refused_and_never_called_instant() -> None:
    """Its time constant is without end and its interval even wider: nothing that a lower bound of 0 explains."""
    rng = np.random.default_rng(0)
    time = 0.002 * np.arange(2000)
    drive = np.repeat(rng.choice([-8.0, 8.0], 100), 20)
    place = 0.05 * np.concatenate([[0.0], np.cumsum(0.002 * drive)[:-1]])
    place += 0.3 * np.sin(0.5 * time) + 0.001 * rng.normal(size=len(time))
    recording = make_recording(time, {"u": drive, "y": place}, "axis.csv", "")
    plant = make_plant("first_order", "u", ["y"], {})
    with pytest.raises(IdentifyError, match=r"axis.csv: the output drifts and does not settle"):
        fit(plant, [recording], [], NONE)


@pytest.mark.parametrize("seed", range(4))
def test_no_length_is_advised_where_the_fit_ran_away(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A speed that is counted without its sign follows no lag; what a lag comes out as says nothing of the length."""
    random = np.random.default_rng(seed)
    drive, speed, rows = np.repeat(random.choice([-1.5, 1.5], 25), 20), 0.0, []
    for k, u in enumerate(drive):
        rows.append(f"{0.02 * k:.2f},{u},{abs(speed) + 0.02 * random.normal():.5f}")
        speed += (1.0 - np.exp(-0.02 / 0.16)) * (3.0 * u - speed)
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text("\n".join(["time_s,voltage_V,belt", *rows, ""]))
    Path("p.toml").write_text(
        'schema = 1\nname = "belt"\n[recordings]\ntrain = ["log.csv"]\n[plant]\nkind = "first_order"\n'
        'input = "voltage_V"\noutputs = ["belt"]\n'
    )
    main(["identify", "p.toml", "--out", "out"])
    said = "".join(capsys.readouterr())
    assert "too short" not in said and ("gain" in said)


def test_a_recording_that_nothing_drives_may_stand_still_beside_one_that_runs_out() -> None:
    plant = make_plant("first_order", "u", ["y"], {**STARTS["first_order"], "delay_s": {"value": 0.0, "free": False}})
    time, still = np.linspace(0.0, 3.0, 60), np.zeros(60)
    running_out = make_recording(time, {"u": still, "y": 2.0 * np.exp(-time / 0.4)}, "decay.csv", "")
    resting = make_recording(time, {"u": still, "y": still}, "still.csv", "")
    found = fit(plant, [step(200, 2.0), running_out, resting], [], NONE)
    assert {p.name: p.value for p in found.plant.parameters}["time_constant_s"] == pytest.approx(0.4, rel=1e-3)
