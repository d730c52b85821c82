"""Whatever is wrong with a user's files: exit 2, one clear line, no traceback, and nothing written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from firmloop.cli import main

LONG = "a" * 40


def _nothing_but(folder: Path, before: set[Path]) -> None:
    assert set(folder.rglob("*")) == before, "something was left behind"


def _complaint(capsys: pytest.CaptureFixture[str]) -> str:
    said = capsys.readouterr()
    assert said.out == ""
    assert "Traceback" not in said.err
    lines = said.err.splitlines()
    assert lines[0].startswith("firmloop: "), said.err
    assert all(line.startswith("  ") for line in lines[1:]), said.err  # what to paste
    assert len(lines[0]) < 500
    return lines[0]


# What is replaced in the sound project, by what, the verb that meets it, and what the message must name.
PROJECTS: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "no schema": ("schema = 1\n", "", "generate", ("'schema' is missing", "schema = 1")),
    "other schema": ("schema = 1", "schema = 2", "generate", (":1:", "schema = 2")),
    "schema as text": ("schema = 1", 'schema = "1"', "generate", (":1:", "schema")),
    "schema true": ("schema = 1", "schema = true", "generate", (":1:", "schema = true")),
    "no name": ('name = "tank_heater"\n', "", "generate", ("'name' is missing",)),
    "name that injects": ('"tank_heater"', "'x; system(\"rm\")'", "generate", (":2:", "cannot be a C name")),
    "name with a newline": ('"tank_heater"', '"x\\n#include <evil>"', "generate", (":2:", "cannot be a C name")),
    "name in capitals": ('"tank_heater"', '"Heater"', "generate", (":2:", "'Heater'")),
    "name is a keyword": ('"tank_heater"', '"register"', "generate", (":2:", "taken by C")),
    "name is a type": ('"tank_heater"', '"uint32_t"', "generate", (":2:", "taken by C")),
    "name too long": ('"tank_heater"', f'"{LONG}"', "generate", (":2:", "31")),
    "name a number": ('"tank_heater"', "7", "generate", (":2:", "must be a text")),
    "unknown key": ("period_s = 0.05", "perod_s = 0.05", "generate", ("period_s",)),
    "misspelt key": ("period_s", "perod_s", "generate", ("'period_s' is missing", "did you write 'perod_s' for it?")),
    "unknown table": ("[arithmetic]", "[arithmatic]", "generate", ("'arithmatic'", "did you mean 'arithmetic'?")),
    "unknown gain": ("ki = 0.5", "kq = 0.5", "generate", (":22:", "kq")),
    "unknown key of a signal": ('unit = "V",', 'unit = "V", width = 3,', "generate", (":27:", "'width'")),
    "period zero": ("period_s = 0.05", "period_s = 0", "generate", (":20:", "more than 0")),
    "period negative": ("period_s = 0.05", "period_s = -1", "generate", (":20:", "more than 0")),
    "period nan": ("period_s = 0.05", "period_s = nan", "generate", (":20:", "no number")),
    "period infinite": ("period_s = 0.05", "period_s = inf", "generate", (":20:", "finite")),
    "period of days": ("period_s = 0.05", "period_s = 90000", "generate", (":20:", "3600")),
    "period beyond all numbers": ("period_s = 0.05", f"period_s = 1{'0' * 400}", "generate", (":20:", "64 bits")),
    "gain as text": ("kp = 0.8", 'kp = "0.8"', "generate", (":21:", "kp")),
    "gain infinite": ("kp = 0.8", "kp = inf", "generate", (":21:", "kp")),
    "unknown controller": ('kind = "pid"', 'kind = "pdi"', "generate", (":19:", "pid")),
    "unknown tuning": ("kp = 0.8\nki = 0.5", 'tune = "simk"', "generate", (":21:", "simc")),
    "low above high": (
        'unit = "V", low = -12, high = 12',
        'unit = "V", low = 12, high = -12',
        "generate",
        (":27:", "low"),
    ),
    "low is high": ('unit = "V", low = -12, high = 12', 'unit = "V", low = 12, high = 12', "generate", (":27:", "low")),
    "range infinite": ("low = -12,", "low = -inf,", "generate", (":27:", "low", "finite")),
    "range missing": (", high = 12 }", " }", "generate", (":27:", "'high' is missing")),
    "signal without a unit": ('unit = "V", low', "low", "generate", (":27:", "'unit' is missing")),
    "unit that injects": ('unit = "V"', 'unit = "*/ int evil; /*"', "generate", (":27:", "unit")),
    "unit with a newline": ('unit = "V"', 'unit = "V\\n"', "generate", (":27:", "unit")),
    "signal that injects": ("reference = {", '"reference; int x" = {', "generate", (":25:", "cannot be a C name")),
    "signals that differ in capitals": (
        'unit = "V", low = -12, high = 12 }',
        'unit = "V", low = -12, high = 12 }\nflow_l = { unit = "1", low = 0, high = 1 }\n'
        'flow_L = { unit = "1", low = 0, high = 1 }',
        "generate",
        (":29:", "'flow_L'", "'flow_l'", "capitals"),
    ),
    "output unit mismatch": ('unit = "V"', 'unit = "mV"', "run", (":27:", "'mV'", "voltage_V")),
    "measurement unit mismatch": (
        'measurement = { unit = "degC"',
        'measurement = { unit = "rpm"',
        "run",
        (":26:", "'rpm'"),
    ),
    "output that is no signal": ("kp = 0.8", 'outputs = ["valve"]\nkp = 0.8', "generate", (":21:", "'valve'")),
    "unknown arithmetic": ('number = "float32"', 'number = "float16"', "generate", (":30:", "float16")),
    "odd number of bits": ('number = "float32"', 'number = "fixed"\nbits = 24', "generate", (":31:", "16 or 32")),
    "bits as a float": ('number = "float32"', 'number = "fixed"\nbits = 32.0', "generate", (":31:", "16 or 32")),
    "unknown target": ('names = ["host"]', 'names = ["hosts"]', "verify", (":33:", "'hosts'", "host")),
    "targets as text": ('names = ["host"]', 'names = "host"', "verify", (":33:", "list")),
    "target twice": ('names = ["host"]', 'names = ["host", "host"]', "verify", (":33:", "twice")),
    "no arithmetic": ('[arithmetic]\nnumber = "float32"\n', "", "generate", ("[arithmetic]",)),
    "no controller": ('kind = "pid"\n', "", "generate", ("kind",)),
    "no recordings": ('[recordings]\ntrain = ["train.csv"]\ntest = ["test.csv"]\n', "", "identify", ("[recordings]",)),
    "no train": ('train = ["train.csv"]\n', "", "identify", ("train",)),
    "train as text": ('train = ["train.csv"]', 'train = "train.csv"', "identify", (":5:", "list")),
    "recording that is not there": ('"train.csv"', '"tarin.csv"', "identify", (":5:", "tarin.csv")),
    "test is train": ('"test.csv"', '"./train.csv"', "identify", (":6:", "train")),
    "unknown plant": ('"first_order"', '"first_oder"', "identify", (":9:", "first_oder")),
    "unknown parameter": ("gain = {", "gian = {", "identify", (":14:", "gian")),
    "parameter as text": ("gain = { value = 1.0, free = true }", 'gain = "1.0"', "identify", (":14:", "gain")),
    "parameter out of range": ("{ value = 1.0, free = true }\ndelay", "{ value = -1.0 }\ndelay", "identify", (":15:",)),
    "free is no truth value": ("value = 0.0, free = false", "value = 0.0, free = 0", "identify", (":16:", "free")),
    "an ode without an input": (
        'kind = "first_order"\ninput = "voltage_V"',
        'kind = "ode"\nstates = ["x"]\ninputs = []',
        "identify",
        (":11:", "inputs = []: must name one", "a column of zeros"),
    ),
    "no outputs": ('outputs = ["temperature_C"]\n', "", "identify", ("'outputs' is missing",)),
    "input that is not recorded": ('input = "voltage_V"', 'input = "power_W"', "identify", ("power_W",)),
    "conditioning key": ("[plant]", "[recordings.conditioning]\nsavgol = 3\n[plant]", "identify", (":9:", "savgol")),
    "rename twice": ("[plant]", '[recordings.rename]\na = "x"\nb = "x"\n[plant]', "identify", (":10:", "'a'")),
    "rename to a number": ("[plant]", "[recordings.rename]\na = 3\n[plant]", "identify", (":9:", "text")),
    "effects": ("[controller]", '[[plant.effects]]\nname = "x"\n[controller]', "identify", ("effects",)),
    "table for a value": ("[controller]", "[controller]\n[controller.period_s]\n[x]", "generate", ("unknown key 'x'",)),
    "value for a table": ("[arithmetic]\nnumber = ", "[plant.x]\narithmetic = ", "generate", ("[plant]", "'x'")),
    "syntax": ("kp = 0.8", "kp = = 0.8", "generate", (":21:", "not valid TOML")),
    "unclosed text": ('name = "tank_heater"', 'name = "tank_heater', "generate", (":2:", "not valid TOML")),
    "key twice": ("kp = 0.8", "kp = 0.8\nkp = 0.9", "generate", (":22:", "not valid TOML")),
    "a number of 5000 digits": ("kp = 0.8", f"kp = {'9' * 5000}", "generate", ("number too long",)),
    "deep brackets": ("kp = 0.8", f"kp = {'[' * 3000}{']' * 3000}", "generate", ("brackets",)),
}


@pytest.mark.parametrize("case", PROJECTS)
def test_project_file(case: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, verb, names = PROJECTS[case]
    text = project.read_text()
    assert old in text
    project.write_text(text.replace(old, new, 1))
    before = set(tmp_path.rglob("*"))
    assert main([verb, str(project), "--out", str(tmp_path / "deep" / "out")]) == 2
    message = _complaint(capsys)
    assert str(project) in message or ".csv" in message
    for name in names:
        assert name in message
    _nothing_but(tmp_path, before)


BYTES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\n", "is empty"),
    "not UTF-8": (b'schema = 1\nname = "\xff\xfe"\n', ":2: is not UTF-8"),
    "binary": (bytes(range(256)), "is not UTF-8"),
    "UTF-16": ("schema = 1\n".encode("utf-16"), "is not UTF-8"),
    "a zero byte": (b"schema = 1\n\x00\n", ":2: is not valid TOML"),
    "a recording": (b"time_s,voltage_V\n0,1\n", ":1: is not valid TOML"),
    "a point without its zero": (b"schema = 1\nki = -.02e3\n", "; write -0.02e3, with a digit before and behind"),
    "a point at the end": (b"schema = 1\na = { value = 5., free = true }\n", "; write 5.0, with a digit before"),
    "a decimal comma": (b"schema = 1\nki = 1,5\n", "; write 1.5, or several numbers in brackets"),
    "a colon": (b"schema = 1\nki: 3\n", "; write = between a key and its value"),
}


@pytest.mark.parametrize("case", BYTES)
def test_bytes_that_are_no_project(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, named = BYTES[case]
    path = tmp_path / "p.toml"
    path.write_bytes(content)
    before = set(tmp_path.rglob("*"))
    assert main(["generate", str(path), "--out", str(tmp_path / "out")]) == 2
    assert named in _complaint(capsys)
    _nothing_but(tmp_path, before)


@pytest.mark.parametrize("name", ["missing.toml", ".", "missing/p.toml"])
def test_project_that_is_not_there(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    assert "file" in _complaint(capsys)
    assert not list(tmp_path.iterdir())


def _lines(change: Callable[[list[str]], list[str]]) -> Callable[[str], bytes]:
    return lambda text: "\n".join(change(text.splitlines())).encode()


RECORDINGS: dict[str, tuple[Callable[[str], bytes], tuple[str, ...]]] = {
    "empty": (lambda text: b"", ("empty",)),
    "header only": (_lines(lambda lines: lines[:1]), ("rows",)),
    "two rows": (_lines(lambda lines: lines[:3]), ("rows",)),
    "no header": (_lines(lambda lines: lines[1:]), ("time_s",)),
    "missing column": (lambda text: text.replace("temperature_C", "speed_rad_s").encode(), ("temperature_C",)),
    "missing input": (lambda text: text.replace("voltage_V", "drive_V").encode(), ("voltage_V",)),
    "missing time": (lambda text: text.replace("time_s", "t").encode(), ("time_s", "rename")),
    "column twice": (lambda text: text.replace("voltage_V", "time_s").encode(), ("twice", "in the header")),
    "nan": (_lines(lambda lines: [*lines[:9], "0.40,nan,1", *lines[10:]]), ("10", "voltage_V")),
    "infinity": (_lines(lambda lines: [*lines[:9], "0.40,1,inf", *lines[10:]]), ("10", "temperature_C")),
    "a word": (_lines(lambda lines: [*lines[:9], "0.40,one,1", *lines[10:]]), ("10", "voltage_V")),
    "an empty cell": (_lines(lambda lines: [*lines[:9], "0.40,,1", *lines[10:]]), ("10", "voltage_V")),
    "time goes back": (_lines(lambda lines: [*lines[:9], "0.10,1,1", *lines[10:]]), ("10", "time_s")),
    "time stands still": (_lines(lambda lines: [*lines[:9], lines[8], *lines[9:]]), ("10", "time_s")),
    "ragged row": (_lines(lambda lines: [*lines[:9], "0.40,1", *lines[10:]]), ("10",)),
    "long row": (_lines(lambda lines: [*lines[:9], "0.40,1,1,1", *lines[10:]]), ("10",)),
    "commas in commas": (lambda text: text.replace(".", ",").encode(), ("decimal commas", ";")),
    "not text": (lambda text: bytes(range(256)) * 9, ("train.csv",)),
    "input that never moves": (
        _lines(lambda lines: [lines[0], *(f"{row * 0.05:.2f},0,0" for row in range(50))]),
        ("input",),
    ),
    "output that never moves": (
        _lines(lambda lines: [lines[0], *(f"{row * 0.05:.2f},{row % 7},0" for row in range(50))]),
        ("temperature_C",),
    ),
}


@pytest.mark.parametrize("case", RECORDINGS)
def test_recording(case: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    change, names = RECORDINGS[case]
    path = project.parent / "train.csv"
    path.write_bytes(change(path.read_text()))
    before = set(tmp_path.rglob("*"))
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 2
    message = _complaint(capsys)
    assert "train.csv" in message
    for name in names:
        assert name in message
    _nothing_but(tmp_path, before)


ENDINGS = {
    "train.npz": b"PK\x03\x04junk",
    "train.mat": b"MATLAB 5.0 junk",
    "train.csv.gz": b"\x1f\x8bjunk",
    "train.xls": b"x",
}


@pytest.mark.parametrize("name", ENDINGS)
def test_broken_binary_recording(name: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project.parent / name).write_bytes(ENDINGS[name])
    project.write_text(project.read_text().replace("train.csv", name))
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 2
    assert name in _complaint(capsys)
    assert not (tmp_path / "out").exists()


def test_a_project_without_signals_is_told_so(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = project.read_text()
    first, _, rest = text.partition("[signals]")
    project.write_text(first + "[arithmetic]" + rest.partition("[arithmetic]")[2])
    assert main(["generate", str(project), "--out", str(tmp_path / "out")]) == 2
    assert "[signals]" in _complaint(capsys)


@pytest.mark.parametrize(
    ("content", "named"),
    [
        (b"{", "not JSON from line 1"),
        (b"", "not JSON"),
        (b"\xff\xfe", "not JSON"),
        (b"[" * 99999, "not JSON"),
        (b"{}", "no costs"),
    ],
)
def test_a_baseline_that_is_none(
    content: bytes, named: str, project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "old.json").write_bytes(content)
    before = set(tmp_path.rglob("*"))
    rest = ["--out", str(tmp_path / "out"), "--steps", "10", "--baseline", str(tmp_path / "old.json")]
    assert main(["verify", str(project), *rest]) == 2
    said = _complaint(capsys)
    assert named in said and "old.json" in said and "cost.json or verdict.json" in said
    _nothing_but(tmp_path, before)


def test_a_verb_that_is_misspelt_is_told_its_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["genrate", "x.toml", "--out", "x"])
    assert caught.value.code == 2
    assert "did you mean 'generate'?" in _complaint(capsys)


TWO_BODIES = """\
schema = 1
name = "two"
[plant]
kind = "ode"
states = ["w1_rad_s", "w2_rad_s"]
inputs = ["torque_N_m"]
outputs = { w1_rad_s = "w1_rad_s" }
[plant.derivatives]
w1_rad_s = "(torque_N_m - d_N_m_s_rad*(w1_rad_s - w2_rad_s))/J_kg_m2"
w2_rad_s = "d_N_m_s_rad*(w1_rad_s - w2_rad_s)/J_kg_m2"
[plant.balances]
w1_rad_s = { kind = "torque", per = "1/J_kg_m2", speed = "w1_rad_s" }
w2_rad_s = { kind = "torque", per = "1/J_kg_m2", speed = "w2_rad_s" }
[plant.parameters]
J_kg_m2 = 1e-3
d_N_m_s_rad = 0.01
[[plant.effects]]
name = "load_torque"
at = "w1_rad_s"
torque_N_m = 0.01
[[plant.effects]]
name = "coulomb_friction"
at = "w2_rad_s"
torque_N_m = 0.01
[[plant.effects]]
name = "coulomb_friction"
at = "w1_rad_s"
torque_N_m = 0.01
"""


@pytest.mark.parametrize(
    ("line", "instead", "told"),
    [
        (27, "", "25: plant.effects: coulomb_friction.at is missing"),
        (27, 'at = "w3_rad_s"', "27: plant.effects: coulomb_friction.at 'w3_rad_s' is no state it can act at"),
        (18, 'name = "loat_torque"', "18: plant.effects: 'loat_torque' is none of the"),
        (19, "", "17: plant.effects: load_torque.at is missing"),
        (20, "torque_N_m = {}", "20: plant.effects: load_torque.torque_N_m is None"),
        (28, "torque_N_m = -2.5", "28: plant.effects: coulomb_friction.torque_N_m is -2.5 N*m"),
        (24, "force_N = 1.0", "24: plant.effects: coulomb_friction.force_N is unknown"),
    ],
)
def test_what_is_wrong_with_an_effect_is_told_at_its_own_lines(
    line: int, instead: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = TWO_BODIES.splitlines()
    lines[line - 1] = instead
    (tmp_path / "two.toml").write_text("\n".join(lines))
    (tmp_path / "a.csv").write_text("time_s,torque_N_m,w1_rad_s\n0,1,0\n1,1,0\n2,0,0\n")
    out = ["--out", str(tmp_path / "o.csv")]
    assert main(["simulate", str(tmp_path / "two.toml"), str(tmp_path / "a.csv"), *out]) == 2
    assert f"two.toml:{told}" in capsys.readouterr().err
