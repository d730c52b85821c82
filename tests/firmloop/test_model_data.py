"""`firmloop model` finds delays, and refuses inputs and offsets that no model can be had from, with what would help."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.signal

from firmloop.cli import main
from firmloop.identify.bench_tests.blackbox import Record, fit_arx, least_squares_arx

PERIOD = 0.02
(ABOVE,), BELOW, _ = scipy.signal.cont2discrete(([30.0], [1, 4, 30]), PERIOD)  # gain 1, poles -2 +- 5.1 j
PROJECT = """schema = 1
name = "m"
[recordings]
train = ["log.csv"]
[plant]
kind = "ode"
states = ["x"]
inputs = ["drive_V"]
[plant.outputs]
position_rad = "x"
[plant.derivatives]
x = "drive_V - x"
[model]
"""


def steps(rows: int = 750) -> np.ndarray:
    return np.repeat(np.random.default_rng(5).choice([-1.0, 1.0], rows // 10 + 1), 10)[:rows]


def left(folder: Path, drive: np.ndarray, late: int, noise: float, rest: tuple[float, float], model: str) -> Path:
    """Write a recording of the plant, `late` samples late, around `rest`, and its project."""
    output = scipy.signal.lfilter(np.concatenate([np.zeros(late), ABOVE]), BELOW, drive)
    output = output + noise * np.random.default_rng(6).standard_normal(len(drive))
    rows = [
        f"{k * PERIOD:.6g},{u + rest[0]:.9g},{y + rest[1]:.9g}"
        for k, (u, y) in enumerate(zip(drive, output, strict=True))
    ]
    (folder / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]) + "\n")
    (folder / "project.toml").write_text(PROJECT + model)
    return folder / "project.toml"


def found(project: Path) -> dict[str, object]:
    out = project.parent / "out"
    assert main(["model", str(project), "--out", str(out)]) == 0
    return dict(json.loads((out / "model.json").read_text()))


@pytest.mark.parametrize(
    ("late", "structure"),
    [(0, "oe"), (3, "n4sid"), pytest.param(9, "oe", marks=pytest.mark.slow), (25, "oe")],
)
def test_a_delay_is_found_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], late: int, structure: str
) -> None:
    document = found(left(tmp_path, steps(), late, 0.03, (0.0, 0.0), f'structure = "{structure}"\n'))
    assert document["delay_s"] == pytest.approx(late * PERIOD)
    assert document["gain"] == pytest.approx(1.0, rel=0.05)
    assert (f"{late} samples of delay found by search" in capsys.readouterr().out) == (late > 0)


def test_a_given_delay_that_the_recording_denies_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found(left(tmp_path, steps(), 9, 0.03, (0.0, 0.0), "delay_samples = 2\n"))
    assert "model.delay_samples is 2; the recordings ask for 9 samples of delay" in capsys.readouterr().out


def test_a_given_delay_that_fits_as_well_as_another_is_no_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two numerator coefficients stand for some samples of delay besides: 13, the true one, is among those alike."""
    slow, given = np.repeat(np.random.default_rng(11).choice([-1.0, 1.0], 30), 50), "delay_samples = 13\n"
    document = found(left(tmp_path, slow, 13, 0.1, (0.0, 0.0), f'structure = "arx"\n{given}'))
    assert "ask for" not in capsys.readouterr().out
    assert document["delay_s"] == pytest.approx(13 * PERIOD)
    assert document["delays_alike_s"] == pytest.approx([11 * PERIOD, 15 * PERIOD])


def test_a_delay_that_is_found_is_told_with_those_that_fit_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    slow = np.repeat(np.random.default_rng(11).choice([-1.0, 1.0], 30), 50)
    found(left(tmp_path, slow, 13, 0.1, (0.0, 0.0), ""))
    assert "13 samples of delay found by search (11 to 15 fit alike); model.delay_samples" in capsys.readouterr().out


@pytest.mark.parametrize("noise", [0.01, pytest.param(0.05, marks=pytest.mark.slow), 0.2])
def test_the_noise_of_a_sensor_does_not_pull_an_arx_model_away(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], noise: float
) -> None:
    document = found(left(tmp_path, steps(), 9, noise, (0.0, 0.0), 'structure = "arx"\n'))
    assert document["gain"] == pytest.approx(1.0, abs=0.02 + 0.1 * noise)
    assert "pulls gain and poles of an arx model away" in capsys.readouterr().out


def test_an_arx_model_of_its_own_noise_is_one_of_least_squares() -> None:
    random = np.random.default_rng(3)
    drive = np.repeat(random.choice([-1.0, 1.0], 250), 8)
    made = scipy.signal.lfilter([0.0, 0.2], [1.0, -1.5, 0.7], drive)
    made += scipy.signal.lfilter([1.0], [1.0, -1.5, 0.7], 0.05 * random.standard_normal(2000))
    records = [Record("r", drive, made)]
    assert np.array_equal(fit_arx(records, 2, 0).a, least_squares_arx(records, 2, 0).a)


@pytest.mark.parametrize(
    "rest",
    [
        (1.5, 4.2),
        pytest.param((0.0, 20.0), marks=pytest.mark.slow),
        pytest.param((-3.0, 0.0), marks=pytest.mark.slow),
    ],
)
def test_signals_that_rest_away_from_zero_are_refused_with_a_key_that_works(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rest: tuple[float, float]
) -> None:
    project = left(tmp_path, steps(), 0, 0.03, rest, "")
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    advice = 'remove_offset = ["drive_V", "position_rad"]'
    assert "rest away from 0" in said and f"[recordings.conditioning] {advice}" in said
    project.write_text(project.read_text() + f"[recordings.conditioning]\n{advice}\n")
    model = found(project)
    assert model["gain"] == pytest.approx(1.0, rel=0.05)
    (scored,) = model["train"]
    assert scored["rmse"] == pytest.approx(0.03, rel=0.1)  # the noise: without its mean the input drives the score, too


LEVELS = [(0.0, 20.0, 0), (0.0, -15.0, 0), (40.0, 75.0, 1), (0.0, 5.0, 40)]  # of the input, the output; rows at rest


@pytest.mark.parametrize("held", [10, 50])
@pytest.mark.parametrize("asked", ["", "order = 1\n", 'structure = "arx"\n'])
def test_rows_in_the_wrong_order_are_told_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: str, held: int
) -> None:
    """Of the same rows in their right order nothing of the kind is said."""
    drive = np.repeat(np.random.default_rng(5).choice([-1.0, 1.0], 600 // held), held)
    project = left(tmp_path, drive, 0, 0.02, (0.0, 0.0), asked)
    rows = (tmp_path / "log.csv").read_text().splitlines()
    main(["model", str(project), "--out", str(tmp_path / "out")])
    assert "wrong order" not in "".join(capsys.readouterr())
    values = [row.partition(",")[2] for row in reversed(rows[1:])]
    turned = [f"{row.partition(',')[0]},{value}" for row, value in zip(rows[1:], values, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join([rows[0], *turned]))
    main(["model", str(project), "--out", str(tmp_path / "out")])
    assert "position_rad answers drive_V from the last row to the first" in "".join(capsys.readouterr())


@pytest.mark.parametrize(("drive_rest", "output_rest", "still"), LEVELS)
def test_an_output_that_begins_at_its_rest_is_refused_with_the_lines_that_give_its_gain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], drive_rest: float, output_rest: float, still: int
) -> None:
    """A heater in its room: while its means are moved by how it warmed up, taking them off leaves much, too."""
    (above,), below, _ = scipy.signal.cont2discrete(([1.4], [60.0, 1.0]), 1.0)
    moves = np.repeat(np.random.default_rng(8).choice([0.0, 40.0, 80.0], 30), 30)
    drive = np.concatenate([np.zeros(still), moves[moves.nonzero()[0][0] :]])
    output = scipy.signal.lfilter(above, below, drive) + 0.1 * np.random.default_rng(9).standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), "order = 1\n")
    rows = [f"{k},{u + drive_rest},{y + output_rest}" for k, (u, y) in enumerate(zip(drive, output, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]))
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "position_rad rests at " in said, said
    lines = re.findall(r"\w+ = \{ name = \S+, offset = \S+ \}", said)
    project.write_text(project.read_text() + "[recordings.rename]\n" + "\n".join(lines) + "\n")
    assert found(project)["gain"] == pytest.approx(1.4, rel=0.02)


@pytest.mark.parametrize(("structure", "dirt"), [("arx", 0.0), ("oe", 0.05), ("n4sid", 0.05)])
def test_one_sine_does_not_make_a_second_order_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], structure: str, dirt: float
) -> None:
    wave = 5.0 * np.sin(1.5 * PERIOD * np.arange(2000)) + dirt * np.random.default_rng(1).standard_normal(2000)
    project = left(tmp_path, wave, 0, 0.01, (0.0, 0.0), f'structure = "{structure}"\n')
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    assert "excites 2 directions" in (said := capsys.readouterr().err)
    assert "set model.order = 1, which is all that it supports" in said


def test_two_sines_do(tmp_path: Path) -> None:
    time = PERIOD * np.arange(2000)
    wave = np.sin(1.5 * time) + np.sin(7.0 * time)
    assert found(left(tmp_path, wave, 0, 0.01, (0.0, 0.0), ""))["gain"] == pytest.approx(1.0, rel=0.05)


def test_one_step_from_rest_has_no_delay_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = found(left(tmp_path, np.where(np.arange(1500) > 250, 1.0, 0.0), 0, 0.01, (0.0, 0.0), ""))
    assert document["delay_s"] == 0.0 and "no intervals" not in capsys.readouterr().out
    assert document["gain"] == pytest.approx(1.0, abs=0.01)
    poles = np.array(document["poles_rad_s"])
    np.testing.assert_allclose(poles, [[-2.0, -5.1], [-2.0, 5.1]], atol=0.2)


@pytest.mark.parametrize(("order", "fast"), [(1, 0.0), (2, -4.0)])
def test_a_plant_that_integrates_is_found_as_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], order: int, fast: float
) -> None:
    above, below = ([1.0], [1.0, 0.0]) if order == 1 else ([4.0], [1.0, 4.0, 0.0])
    (above,), below, _ = scipy.signal.cont2discrete((above, below), PERIOD)
    drive = steps()
    output = scipy.signal.lfilter(above, below, drive) + 0.01 * np.random.default_rng(6).standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), f"order = {order}\n")
    rows = [f"{k * PERIOD:.6g},{u:.9g},{y:.9g}" for k, (u, y) in enumerate(zip(drive, output, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]) + "\n")
    document = found(project)
    assert document["delay_s"] == 0.0 and document["gain"] is None
    assert [0.0, 0.0] in document["poles_rad_s"]
    assert min(real for real, _ in document["poles_rad_s"]) == pytest.approx(fast, abs=0.3)
    assert "it integrates" in capsys.readouterr().out


@pytest.mark.parametrize(("rest", "start"), [(1.5, 0.0), pytest.param(-0.4, 3.0, marks=pytest.mark.slow), (0.0, 3.0)])
def test_a_plant_that_integrates_from_elsewhere_is_refused_with_a_line_that_works_or_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rest: float, start: float
) -> None:
    (above,), below, _ = scipy.signal.cont2discrete(([2.0], [0.3, 1.0, 0.0]), PERIOD)
    drive = steps(1500)
    output = scipy.signal.lfilter(above, below, drive) + 0.003 * np.random.default_rng(6).standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), "order = 2\n")
    rows = [
        f"{k * PERIOD:.6g},{u + rest:.9g},{y + start:.9g}" for k, (u, y) in enumerate(zip(drive, output, strict=True))
    ]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]) + "\n")
    if rest:
        assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert "position_rad integrates drive_V" in said and "remove_offset" not in said
        assert float(said.partition("still at drive_V = ")[2].partition(" ")[0]) == pytest.approx(rest, abs=0.003)
        line = said.partition("such as ")[2].partition("; the mean")[0].strip()
        project.write_text(project.read_text().replace("[plant]", f"[recordings.rename]\n{line}\n[plant]", 1))
    document = found(project)
    assert document["gain"] is None and [0.0, 0.0] in document["poles_rad_s"]
    assert min(real for real, _ in document["poles_rad_s"]) == pytest.approx(-1 / 0.3, rel=0.02)


def test_one_step_from_a_level_is_no_integral(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive, stays = np.repeat([20.0, 60.0], 300), np.exp(-2.0 / 150.0)
    level = 30.0 + 0.5 * scipy.signal.lfilter([0.0, 1.0 - stays], [1.0, -stays], drive - 20.0)
    level += 0.05 * np.random.default_rng(6).standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), "order = 1\n")
    rows = [f"{k / 30.0:.4f},{u:g},{y:.3f}" for k, (u, y) in enumerate(zip(drive, level, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(["t_min,drive_V,position_rad", *rows]) + "\n")
    lines = '[recordings.rename]\nt_min = { name = "time_s", unit = "min" }\n'
    project.write_text(project.read_text().replace("[plant]", f"{lines}[plant]", 1))
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "position_rad rests at" in said and "where drive_V is 20," in said
    mended = said.partition("file on the left: ")[2].partition("; the means")[0].replace(" and ", "\n")
    project.write_text(project.read_text().replace(lines, f"{lines}{mended}\n", 1))
    document = found(project)
    assert document["gain"] == pytest.approx(0.5, rel=0.01)


def test_what_follows_the_input_still_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found(left(tmp_path, steps(), 0, 0.01, (0.0, 0.0), "order = 1\n"))
    assert "still follows the input" in capsys.readouterr().out


def test_a_delay_is_found_in_noise_as_large_as_the_signal(tmp_path: Path) -> None:
    document = found(left(tmp_path, steps(3000), 9, 1.0, (0.0, 0.0), ""))
    least, most = document["delays_alike_s"]
    assert 3 * PERIOD < least <= 9 * PERIOD <= most < 14 * PERIOD
    assert abs(document["delay_s"] - 9 * PERIOD) < 4 * PERIOD
    assert document["gain"] == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("rows", [1, 12])
def test_an_output_that_leads_its_input_is_told_with_the_rows(
    rows: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = steps(3000)
    output = scipy.signal.lfilter(ABOVE, BELOW, np.concatenate([drive[rows:], np.zeros(rows)]))
    output += 0.001 * np.random.default_rng(7).standard_normal(len(drive))
    table = np.column_stack([PERIOD * np.arange(len(drive)), drive, output])
    (tmp_path / "project.toml").write_text(PROJECT)
    np.savetxt(tmp_path / "log.csv", table, "%.9g", ",", header="time_s,drive_V,position_rad", comments="")
    found(tmp_path / "project.toml")
    said = capsys.readouterr().out
    count = "1 row" if rows == 1 else f"{rows} rows"
    assert f"position_rad answers {count} before drive_V changes" in said
    assert "follows the input" not in said


@pytest.mark.parametrize("smoothed", [False, True], ids=["thirty rows early", "filtered to and fro"])
def test_an_early_output_is_the_cause_that_is_named_where_no_model_is_found(
    smoothed: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(1)
    drive = np.repeat(random.uniform(-5.0, 5.0, 100), 15)
    late = scipy.signal.lfilter([0.0, 2.0 / 15.0], [1.0, -14.0 / 15.0], drive) + random.normal(0.0, 0.05, len(drive))
    output = scipy.signal.filtfilt(*scipy.signal.butter(2, 0.05), late) if smoothed else np.roll(late, -30)[:-30]
    table = np.column_stack([PERIOD * np.arange(len(output)), drive[: len(output)], output])
    (tmp_path / "project.toml").write_text(PROJECT)
    np.savetxt(tmp_path / "log.csv", table, "%.9g", ",", header="time_s,drive_V,position_rad", comments="")
    assert main(["model", str(tmp_path / "project.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert re.search(r"position_rad answers \d+ rows before drive_V changes", said), said
    assert "exchange both names if position_rad is what drives" in said
    assert "unstable" not in said and "drifts" not in said


def test_a_line_over_time_is_told_with_its_size(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    project = left(tmp_path, steps(1500), 0, 0.01, (0.0, 0.0), "")
    rows = [line.split(",") for line in (tmp_path / "log.csv").read_text().splitlines()[1:]]
    drifted = [f"{t},{u},{float(y) + 0.02 * float(t)}" for t, u, y in rows]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *drifted]))
    text = project.read_text() + '[recordings.conditioning]\nremove_offset = ["drive_V", "position_rad"]\n'
    project.write_text(text)
    found(project)
    said = capsys.readouterr().out
    drift = float(said.partition("drifts by ")[2].partition(" ")[0])
    assert drift == pytest.approx(0.02 * 30.0, rel=0.05)
    assert 'detrend = ["position_rad"]' in said
    project.write_text(text + 'detrend = ["position_rad"]\n')
    found(project)
    assert "drifts" not in capsys.readouterr().out


@pytest.mark.parametrize("rest", [(0.0, 0.0), (3.0, 7.0)])
def test_a_drift_is_named_where_taking_the_means_would_leave_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rest: tuple[float, float]
) -> None:
    project = left(tmp_path, steps(), 0, 0.01, rest, "")
    rows = [line.split(",") for line in (tmp_path / "log.csv").read_text().splitlines()[1:]]
    drifted = [f"{t},{u},{float(y) + 0.1 * float(t)}" for t, u, y in rows]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *drifted]))
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    advice = 'detrend = ["position_rad"]', 'remove_offset = ["drive_V"]'
    assert "position_rad drifts by" in said and f"[recordings.conditioning] {' and '.join(advice)}" in said
    text = project.read_text() + "[recordings.conditioning]\n"
    project.write_text(text + 'remove_offset = ["drive_V", "position_rad"]\n')
    found(project)
    assert "drifts by" in capsys.readouterr().out
    project.write_text(text + "\n".join(advice))
    assert found(project)["gain"] == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("seed", [1, 2])
def test_n4sid_of_noise_alone_is_no_model(tmp_path: Path, capsys: pytest.CaptureFixture[str], seed: int) -> None:
    project = left(tmp_path, steps(), 0, 0.0, (0.0, 0.0), 'structure = "n4sid"\n')
    rows = [line.split(",") for line in (tmp_path / "log.csv").read_text().splitlines()[1:]]
    noise = np.random.default_rng(seed).standard_normal(len(rows))
    bare = [f"{t},{u},{y:.9g}" for (t, u, _), y in zip(rows, noise, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *bare]))
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    assert "the output does not answer the input" in capsys.readouterr().err


def test_n4sid_says_where_output_error_leaves_less(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    step = np.where(np.arange(1500) > 250, 1.0, 0.0)
    found(left(tmp_path, step, 0, 0.01, (0.0, 0.0), 'structure = "n4sid"\n'))
    assert "n4sid leaves 0.01" in (said := capsys.readouterr().out) and "take structure = 'oe'" in said


def lagged(drive: np.ndarray, late: int) -> np.ndarray:
    """A first-order lag of gain 2 and 0.5 s."""
    stays = np.exp(-PERIOD / 0.5)
    return scipy.signal.lfilter([*[0.0] * late, 0.0, 2.0 * (1.0 - stays)], [1.0, -stays], drive)


@pytest.mark.parametrize(("late", "seed"), [(0, 11), (40, 11), (3, 4)])
def test_a_lower_order_is_taken_where_the_usual_one_has_no_continuous_form(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], late: int, seed: int
) -> None:
    """A lag alone was refused: 'a pole at -0.05 in z', with the structure that it had as a remedy."""
    random = np.random.default_rng(seed)
    drive = np.repeat(random.choice([-1.0, 1.0], 60), 25)
    output = lagged(drive, late) + 0.01 * random.standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), "")
    rows = [f"{k * PERIOD:.6g},{u:.9g},{y:.9g}" for k, (u, y) in enumerate(zip(drive, output, strict=True))]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]) + "\n")
    document = found(project)
    assert document["gain"] == pytest.approx(2.0, rel=5e-3)
    if len(document["poles_rad_s"]) == 1:
        assert "order 1 is taken: a model of order 2 has no continuous form" in capsys.readouterr().out
        (tmp_path / "project.toml").write_text(project.read_text() + "order = 2\n")
        assert main(["model", str(project), "--out", str(tmp_path / "asked")]) == 2
        assert "1 explains no less: write that" in capsys.readouterr().err


def test_an_output_that_drifts_is_not_said_to_integrate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    random = np.random.default_rng(11)
    drive = np.repeat(random.choice([-1.0, 1.0], 60), 25)
    time = PERIOD * np.arange(len(drive))
    output = lagged(drive, 0) + 0.1 * time + 0.01 * random.standard_normal(len(drive))
    project = left(tmp_path, drive, 0, 0.0, (0.0, 0.0), "")
    rows = [f"{t:.6g},{u:.9g},{y:.9g}" for t, u, y in zip(time, drive, output, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,drive_V,position_rad", *rows]) + "\n")
    assert main(["model", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "drifts by" in said and "integrates" not in said
