"""What docs/architecture.md calls a change of one file is one: put into its folder, it is found and used."""

from __future__ import annotations

import csv
import importlib
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.verify.stimuli.stimuli import stimuli

ROOT = Path(__file__).parents[2]
COMMAND = '''\
"""`firmloop hello`: greets."""

NAME = "hello"
HELP = "greet"


def arguments(parser):
    """Ask whom."""
    parser.add_argument("whom")


def run(arguments, console):
    """Greet."""
    console.lines([f"hello {arguments.whom}"])
    return 0
'''
READER = '''\
"""Recordings of numbers with bars between them."""

from firmloop.identify.recordings.formats import Format
from firmloop.identify.recordings.formats.csv_text import read_csv

FORMAT = Format((".bars",), lambda content: read_csv(content.replace(b"|", b",")))
'''
Put = Callable[[str, str, str], None]


def _forget() -> None:
    """Forget all that was made of what stands in the folders, also by tests before this one."""
    for name, module in list(sys.modules.items()):
        if name.startswith("firmloop."):
            for made in list(vars(module).values()):
                if callable(getattr(made, "cache_clear", None)):
                    made.cache_clear()


@pytest.fixture
def put(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Put]:
    """Let a file stand in the folder of a package, as long as the test runs."""
    folder = tmp_path / "put"
    folder.mkdir()
    before = set(sys.modules)

    def standing(package: str, name: str, text: str) -> None:
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
        module = importlib.import_module(f"firmloop.{package}")
        monkeypatch.setattr(module, "__path__", [*module.__path__, str(folder)])
        _forget()

    yield standing
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
            del sys.modules[name]
    monkeypatch.undo()
    _forget()


def _column(path: Path, name: str) -> list[float]:
    with path.open(encoding="utf-8") as stream:
        return [float(row[name]) for row in csv.DictReader(stream)]


def test_an_effect_is_simulated(put: Put, tmp_path: Path) -> None:
    like = ROOT / "identify" / "plants" / "effects" / "torque" / "quadratic_drag.py"
    text = like.read_text(encoding="utf-8").replace("quadratic_drag", "cubic_drag")
    put("identify.plants.effects.torque", "cubic_drag", text.replace("fabs(v->w)", "(v->w * v->w)"))
    project = shutil.copytree(ROOT / "examples" / "wheel_speed", tmp_path / "bench") / "wheel_speed.toml"
    plain = project.read_text(encoding="utf-8")
    speeds = []
    for coefficient in (0.0, 1e-9):
        effect = f'[[plant.effects]]\nname = "cubic_drag"\ncoefficient_N_m_s2_rad2 = {coefficient}\n'
        project.write_text(f"{plain}\n{effect}", encoding="utf-8")
        out = tmp_path / "y.csv"
        assert main(["simulate", str(project), str(project.parent / "ramp.csv"), "--out", str(out)]) == 0
        speeds.append(max(_column(out, "speed_rad_s")))
    assert speeds[1] < 0.99 * speeds[0]


def test_a_stimulus_gets_its_share_of_the_steps(put: Put) -> None:
    like = ROOT / "verify" / "stimuli" / "characters" / "chirps.py"
    text = like.read_text(encoding="utf-8")
    put("verify.stimuli.characters", "sweeps", text.replace('Stimulus("chirps", 7', 'Stimulus("sweeps", -1'))
    kind = kinds()["pid"]
    program = lower(kind.design(kind.example).law, "float32")
    assert any("sweeps" == block.name for block in stimuli(program, [], 6_000, 5))


def test_a_reader_of_recordings_reads_a_users_file(put: Put, tmp_path: Path) -> None:
    put("identify.recordings.formats", "bars", READER)
    project = shutil.copytree(ROOT / "examples" / "wheel_speed", tmp_path / "bench") / "wheel_speed.toml"
    ramp = project.parent / "ramp.csv"
    (project.parent / "ramp.bars").write_text(ramp.read_text().replace(",", "|"))
    for name in ("ramp.csv", "ramp.bars"):
        out = tmp_path / f"{name}.out.csv"
        assert main(["simulate", str(project), str(project.parent / name), "--out", str(out)]) == 0
    assert (tmp_path / "ramp.csv.out.csv").read_bytes() == (tmp_path / "ramp.bars.out.csv").read_bytes()


def test_a_command_is_listed_and_runs(put: Put, capsys: pytest.CaptureFixture[str]) -> None:
    put("commands", "hello", COMMAND)
    assert main(["hello", "motor"]) == 0
    assert "hello motor" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--help"])
    assert "greet" in capsys.readouterr().out
