"""A new user with a file of their own: `firmloop init` and `firmloop run`, no editor."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main

RNG = np.random.default_rng(7)
STEP = 0.001
DRIVE = np.repeat([0.0, 6.0, 0.0, -6.0, 10.0, -10.0, 3.0, 0.0], 150)
TIME = STEP * np.arange(len(DRIVE))


def motor() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Current, speed and angle of a small motor (7.4 ohm, 21 mN m/A), with noise."""
    current = speed = angle = 0.0
    rows = []
    for u in DRIVE:
        rows.append((current, speed, angle))
        for _ in range(20):
            current += STEP / 20 * (u - 7.4 * current - 0.0213 * speed) / 1.1e-3
            speed += STEP / 20 * (0.0213 * current - 3.6e-6 * speed) / 3.3e-6
            angle += STEP / 20 * speed
    noise = RNG.normal(size=(len(rows), 3)) * (8e-3, 0.4, 1e-3)
    return tuple((np.array(rows) + noise).T)  # type: ignore[return-value]


CURRENT, SPEED, ANGLE = motor()


def heater() -> np.ndarray:
    """A heater at 21 degC, of gain 0.8 and 40 s, sampled every second."""
    level, rows = 0.0, []
    for u in np.repeat([0.0, 60.0, 20.0, 80.0, 0.0], 120):
        rows.append(21.0 + level)
        level += (1 - np.exp(-1 / 40)) * (0.8 * u - level)
    return np.array(rows) + RNG.normal(size=len(rows)) * 0.05


def text(header: str, *columns: np.ndarray, mark: str = ",", end: str = "") -> str:
    rows = (mark.join(f"{value:.9g}" for value in row) + end for row in zip(*columns, strict=True))
    return "\n".join([header, *rows, ""])


HEATED = heater()
POWER = np.repeat([0.0, 60.0, 20.0, 80.0, 0.0], 120)
FILES: dict[str, tuple[str, str, dict[str, float]]] = {  # name and text of the file, what the fit finds
    "rpm, ms and mA": (
        "bench.csv",
        text("t_ms,u_V,speed_rpm,i_mA", TIME * 1e3, DRIVE, SPEED * 30 / np.pi, CURRENT * 1e3),
        {"R_ohm": 7.4, "ke_V_s_rad": 0.0213},
    ),
    "semicolons, decimal commas, a line of units": (
        "heater.csv",
        text("Zeit;Heater;Temp\ns;%;°C", np.arange(600.0), POWER, HEATED, mark=";")
        .replace(".", ",")
        .replace("Zeit", "Time"),
        {"gain": 0.8, "time_constant_s": 40.0, "output_at_rest": 21.0},
    ),
    "an export of a scope": (
        "scope.csv",
        text("X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-0.1,0.001", np.arange(len(DRIVE)), DRIVE, SPEED / 100),
        {"gain": 0.46},
    ),
    "a counter that wraps, a delimiter at each end": (
        "log.csv",
        text(
            "micros,pwm_V,Speed [rpm],",
            (TIME * 1e6 + 2**32 - 5e5) % 2**32,
            DRIVE,
            SPEED * 30 / np.pi,
            end=",",
        ),
        {"gain": 46.1},
    ),
    "tabs, degrees, a drive without unit": (
        "axis.txt",
        text("time\tcmd\tangle_deg", TIME, DRIVE / 12, ANGLE * 180 / np.pi, mark="\t"),
        {},
    ),
}


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], Path]:
    def made(name: str, content: str) -> Path:
        monkeypatch.chdir(tmp_path)
        (tmp_path / name).write_text(content, encoding="utf-8")
        return tmp_path / name

    return made


@pytest.mark.parametrize("case", FILES)
def test_two_commands_lead_from_a_file_to_verified_c(
    case: str, bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    name, content, wanted = FILES[case]
    file = bench(name, content)
    status = main(["init", name])
    said = capsys.readouterr()
    assert status == 0, said.err
    project = file.with_suffix(".toml")
    status = main(["run", project.name, "--out", "out", "--steps", "500"])
    said = capsys.readouterr()
    assert status == 0, said.err
    fitted = tomllib.loads((file.parent / "out" / "project.toml").read_text())["plant"]["parameters"]
    for parameter, value in wanted.items():
        assert fitted[parameter]["value"] == pytest.approx(value, rel=0.05), fitted


def write_mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed (pip install 'firmloop[mdf4]')")
    with asammdf.MDF(version="4.10") as file:
        for name, unit, values in (("Motor Voltage", "V", DRIVE), ("n_Motor Speed", "rpm", SPEED * 30 / np.pi)):
            file.append(asammdf.Signal(samples=values, timestamps=TIME, name=name, unit=unit))
        file.save(path)


def write_tdms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed (pip install 'firmloop[tdms]')")
    columns = {"Motor Voltage": ("V", DRIVE), "Speed": ("rpm", SPEED * 30 / np.pi)}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("bench", name, values, {"wf_increment": STEP, "unit_string": unit})
                for name, (unit, values) in columns.items()
            ]
        )


@pytest.mark.parametrize(("name", "write"), [("r.mf4", write_mdf), ("r.tdms", write_tdms)])
def test_two_commands_lead_from_an_instruments_file_to_verified_c(
    name: str, write: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / name)
    assert main(["init", name]) == 0
    assert main(["run", "r.toml", "--out", "out", "--steps", "500"]) == 0
    fitted = tomllib.loads((tmp_path / "out" / "project.toml").read_text())["plant"]
    assert fitted["outputs"] == ["speed_rad_s"]
    assert fitted["parameters"]["gain"]["value"] == pytest.approx(46.1, rel=0.05)


def test_a_unit_that_a_file_says_is_not_called_missing(
    bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bench(*FILES["rpm, ms and mA"][:2])
    assert main(["init", "bench.csv"]) == 0
    assert "no unit in the file" not in capsys.readouterr().out


@pytest.mark.parametrize("header", ["TIME,CH1,CH2,CH3", "ts,volts,amps,counts_per_s"])
def test_where_names_do_not_tell_the_output_is_what_follows_the_drive(
    header: str, bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    names = header.split(",")
    file = bench("a.csv", text(header, TIME, DRIVE, CURRENT, SPEED * 100))
    assert main(["init", "a.csv"]) == 0
    made = tomllib.loads(file.with_suffix(".toml").read_text())
    assert made["plant"]["outputs"] == [names[3]] and made["signals"]["measurement"]["unit"] == "1"
    assert made["plant"]["parameters"]["gain"]["value"] == pytest.approx(4610.0, rel=0.05)


def test_a_first_step_from_rest_is_told_from_a_level_that_is_held(bench: Callable[[str, str], Path]) -> None:
    power = np.repeat([40.0, 0.0, 60.0, 20.0, 80.0], 120)
    late, level, rows = np.concatenate([np.zeros(8), power]), 0.0, []
    for k in range(len(power)):
        rows.append(21.0 + level)
        level += (1 - np.exp(-1 / 40)) * (0.8 * late[k] - level)
    heated = np.array(rows) + np.random.default_rng(4).normal(size=len(rows)) * 0.05
    file = bench("a.csv", text("time_s,heater_percent,temperature_C", np.arange(600.0), power, heated))
    assert main(["init", "a.csv"]) == 0
    found = tomllib.loads(file.with_suffix(".toml").read_text())["plant"]["parameters"]
    assert "input_at_rest" not in found
    assert found["output_at_rest"]["value"] == pytest.approx(21.0, abs=0.1)
    assert found["delay_s"]["value"] == pytest.approx(8.0, abs=0.2)


def test_files_with_other_columns_are_told_with_both_names(
    bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bench(*FILES["rpm, ms and mA"][:2])
    bench("other.csv", text("time_s,voltage_V,speed_rad_s,current_A", TIME, DRIVE, SPEED, CURRENT))
    assert main(["init", "other.csv", "bench.csv"]) == 2
    assert "give the columns of both the same names" in capsys.readouterr().err


def test_the_last_of_several_files_is_only_scored(bench: Callable[[str, str], Path]) -> None:
    content = FILES["an export of a scope"][1]
    for name in ("a.csv", "b.csv", "c.csv"):
        file = bench(name, content)
    assert main(["init", "a.csv", "b.csv", "c.csv", "--out", "sub/loop.toml"]) == 0
    made = tomllib.loads((file.parent / "sub" / "loop.toml").read_text())
    assert made["recordings"]["train"] == ["../a.csv", "../b.csv"] and made["recordings"]["test"] == ["../c.csv"]
    assert made["name"] == "loop"


WRONG: dict[str, tuple[str, str, list[str], str]] = {  # file, its text, further arguments, what is said
    "two columns of one name": (
        "a.csv",
        text("t,u,omega,speed_rpm", TIME, DRIVE, SPEED, SPEED),
        [],
        "columns 'omega' and 'speed_rpm' both seem to be speed_rad_s; say which one is to be left out: --leave-out",
    ),
    "one header twice": ("a.csv", text("t,u,w,w", TIME, DRIVE, SPEED, SPEED), [], "2 columns are called 'w'"),
    "numbers beyond any project": (
        "a.csv",
        text("t,u,w", TIME, DRIVE, SPEED * 1e12),
        [],
        "a.csv: no project can be made of it: [signals.reference] low holds",
    ),
    "no time": ("a.csv", text("u,omega", DRIVE, SPEED), [], "--period 0.001"),
    "nothing that moves": ("a.csv", text("t,u,omega", TIME, DRIVE, 0 * SPEED), [], "two columns that change"),
    "a column that is not there": ("a.csv", text("t,u,w", TIME, DRIVE, SPEED), ["--leave-out", "q"], "no such column"),
    "no file": ("a.csv", "", [], "is empty"),
    "a folder": ("a.csv", "", ["."], ".: is a folder; name the recordings in it"),
    "a place that is no project": ("a.csv", "", ["--out", "there.json"], "ends in .toml"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_guessed_is_said_and_nothing_is_written(
    case: str, bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    name, content, more, words = WRONG[case]
    file = bench(name, content)
    assert main(["init", name, *more]) == 2
    assert words in capsys.readouterr().err
    assert [path.name for path in file.parent.iterdir()] == [name]


def test_a_log_that_begins_while_it_heats_up_is_no_plant_that_does_not_answer(
    bench: Callable[[str, str], Path],
) -> None:
    power = np.repeat(np.random.default_rng(3).choice([0.0, 40.0, 80.0], 30), 20)
    power[:20], level, rows = 80.0, 0.0, []
    for u in power:
        rows.append(20.0 + level)
        level += (1 - np.exp(-1 / 12)) * (0.15 * u - level)
    heated = np.array(rows) + np.random.default_rng(4).normal(size=len(rows)) * 0.02
    file = bench("a.csv", text("time_s,heater_percent,temperature_C", np.arange(600.0), power, heated))
    assert main(["init", "a.csv"]) == 0
    fitted = tomllib.loads(file.with_suffix(".toml").read_text())["plant"]["parameters"]
    found = {name: fitted[name]["value"] for name in ("gain", "time_constant_s", "output_at_rest", "input_at_rest")}
    assert found["gain"] == pytest.approx(0.15, rel=0.02) and found["time_constant_s"] == pytest.approx(12.0, rel=0.02)
    assert found["output_at_rest"] - found["gain"] * found["input_at_rest"] == pytest.approx(20.0, abs=0.1)


def test_names_without_a_latin_letter_stay_apart(bench: Callable[[str, str], Path]) -> None:
    file = bench("a.csv", text("t,напряжение,скорость", TIME, DRIVE, SPEED))
    assert main(["init", "a.csv"]) == 0
    made = tomllib.loads(file.with_suffix(".toml").read_text())
    assert made["recordings"]["rename"] == {"t": "time_s", "напряжение": "column", "скорость": "column_2"}


def test_what_was_asked_for_is_taken(bench: Callable[[str, str], Path]) -> None:
    file = bench("a.csv", text("u,omega,speed_rpm", DRIVE, SPEED, SPEED * 30 / np.pi))
    assert main(["init", "a.csv", "--period", "0.001", "--leave-out", "omega"]) == 0
    made = tomllib.loads(file.with_suffix(".toml").read_text())
    assert made["recordings"]["period_s"] == 0.001
    assert made["recordings"]["rename"]["speed_rpm"] == {"name": "speed_rad_s", "unit": "rpm"}


@pytest.mark.parametrize("header", ["Zeit [s],Heizung [%],Temperatur [°C]", "t,Stellwert,Temperatur [°C]"])
def test_a_drive_in_another_language_is_told_by_units(header: str, bench: Callable[[str, str], Path]) -> None:
    names = header.split(",")
    file = bench("a.csv", text(",".join([names[0], names[2], names[1]]), np.arange(600.0), HEATED, POWER))
    assert main(["init", "a.csv"]) == 0
    plant = tomllib.loads(file.with_suffix(".toml").read_text())["plant"]
    assert plant["outputs"] == ["temperature_C"] and plant["input"].startswith(names[1].split()[0])


def test_a_supply_and_a_reference_are_no_ends_of_the_plant(bench: Callable[[str, str], Path]) -> None:
    supply, reference = 12 - 0.1 * np.abs(DRIVE), np.roll(SPEED, -5)
    header = "time_s,supply_V,speed_ref_rad_s,speed_rad_s,motor_cmd_V,voltage_ff_V"
    file = bench("a.csv", text(header, TIME, supply, reference, SPEED, DRIVE, supply))
    assert main(["init", "a.csv"]) == 0
    plant = tomllib.loads(file.with_suffix(".toml").read_text())["plant"]
    assert (plant["input"], plant["outputs"]) == ("motor_cmd_V", ["speed_rad_s"])


def test_what_an_inner_loop_is_asked_for_moves_the_plant_and_an_angle_within_a_turn_is_unrolled(
    bench: Callable[[str, str], Path],
) -> None:
    asked, speed, angle = np.repeat([0.0, 900.0, -800.0, 1500.0, 0.0, -1200.0], 100), 0.0, 0.0
    rows = []
    for u in asked:
        rows.append((angle, speed))
        speed += 0.1 * (u - speed)
        angle += 0.005 * speed
    turned, moved = np.transpose(rows)
    header = "time_s,commanded_deg_s,angle_deg,feedback_deg_s"
    file = bench("a.csv", text(header, 0.005 * np.arange(600), asked, turned % 360.0, moved))
    assert main(["init", "a.csv"]) == 0
    made = tomllib.loads(file.with_suffix(".toml").read_text())
    assert (made["plant"]["input"], made["plant"]["outputs"]) == ("commanded_deg_s", ["position_rad"])
    assert made["recordings"]["rename"]["angle_deg"] == {"name": "position_rad", "unit": "deg", "wraps": 360.0}


def test_names_of_a_file_stay_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    odd = {"u\n[plant]\nkind = 'x'": DRIVE, 'omega "1"': SPEED, "\nname = 'evil'": CURRENT, "t": TIME}
    np.savez(tmp_path / "a.npz", **odd)
    assert main(["init", "a.npz"]) == 0
    made = tomllib.loads((tmp_path / "a.toml").read_text())
    assert made["name"] == "a" and made["plant"]["outputs"] == ["speed_rad_s"]
    assert set(made["recordings"]["rename"]) <= set(odd)


@pytest.mark.parametrize("name", ["a\nb.csv", "a\udce9.csv", "a\x1b[2J.csv"])
def test_a_file_that_no_project_can_name_is_refused(
    name: str, bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bench(name, FILES["an export of a scope"][1])
    assert main(["init", name]) == 2
    said = capsys.readouterr().err
    assert "a project cannot name this file" in said and len(said.splitlines()) == 1


def test_a_project_that_is_there_stays_as_it_is(
    bench: Callable[[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
    file = bench("a.csv", FILES["an export of a scope"][1])
    project = file.with_suffix(".toml")
    project.write_text("mine")
    (file.parent / "folder.toml").mkdir()
    for more in ([], ["--out", "folder.toml"]):
        assert main(["init", "a.csv", *more]) == 2
        assert "is not overwritten" in capsys.readouterr().err
    assert project.read_text() == "mine"


@pytest.mark.parametrize("name", ["my motor", "o'brien", "$(touch RAN)", "a;b", 'say "x"'])
def test_the_commands_that_are_shown_can_be_copied_into_a_shell(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.csv").write_text(text("time_s,heater_percent,temperature_C", np.arange(len(POWER)), POWER, HEATED))
    assert main(["init", f"{name}.csv", "--out", f"{name}.toml"]) == 0
    (shown,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("next: "))
    assert shlex.split(shown)[1:4] == ["firmloop", "run", f"{name}.toml"]
    (guessed,) = (line for line in Path(f"{name}.toml").read_text().splitlines() if line.startswith("# Guessed by: "))
    assert shlex.split(guessed)[3:] == ["firmloop", "init", f"{name}.csv"]
    assert main(["design", f"{name}.toml", "--out", "out"]) == 0
    first = Path("out/project.toml").read_text().partition("\n")[0]
    assert shlex.split(first)[4:] == ["firmloop", "design", f"{name}.toml"]


@pytest.mark.parametrize(("stem", "name"), [("time", "time_loop"), ("fl_run", "loop_fl_run")])
def test_a_file_called_like_what_c_has_gives_a_name_that_is_free(
    stem: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(f"{stem}.csv").write_text(text("time_s,heater_percent,temperature_C", np.arange(len(POWER)), POWER, HEATED))
    assert main(["init", f"{stem}.csv"]) == 0
    assert tomllib.loads(Path(f"{stem}.toml").read_text())["name"] == name


@pytest.mark.parametrize("kind", ["csv", "npz"])
def test_stamps_of_a_calendar_are_in_seconds_and_no_unit_is_assumed(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stamps = np.datetime64("2026-05-01T12:00:00") + np.arange(len(POWER)) * np.timedelta64(1, "s")
    file = tmp_path / f"oven.{kind}"
    if kind == "npz":
        np.savez(file, Date=stamps, heater_percent=POWER, temperature_C=HEATED)
    else:
        rows = (f"{d} {u:g} {y:.9g}".replace(" ", ",") for d, u, y in zip(stamps, POWER, HEATED, strict=True))
        file.write_text("\n".join(["Date,heater_percent,temperature_C", *rows, ""]))
    assert main(["init", str(file), "--out", str(tmp_path / "oven.toml")]) == 0
    assert "no unit in the file" not in capsys.readouterr().out
    made = tomllib.loads((tmp_path / "oven.toml").read_text())
    assert made["recordings"]["rename"] == {"Date": "time_s"}
    assert made["plant"]["parameters"]["time_constant_s"]["value"] == pytest.approx(40.0, rel=0.02)


def test_a_clock_that_ticks_more_often_than_the_stamps_beside_it_is_the_time(tmp_path: Path) -> None:
    rows = (
        f"12:{k // 600:02d}:{k // 10 % 60:02d},{100 * k},{u:g},{y:.9g}"
        for k, (u, y) in enumerate(zip(POWER, HEATED, strict=True))
    )
    (tmp_path / "oven.csv").write_text("\n".join(["time,t_ms,heater_percent,temperature_C", *rows, ""]))
    assert main(["init", str(tmp_path / "oven.csv"), "--out", str(tmp_path / "oven.toml")]) == 0
    made = tomllib.loads((tmp_path / "oven.toml").read_text())
    assert made["recordings"]["rename"] == {"t_ms": {"name": "time_s", "unit": "ms"}}
