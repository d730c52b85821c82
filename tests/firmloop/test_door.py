"""The Python door: functions called as sub-packages, nouns that show themselves, and what a type checker sees."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import firmloop as fl
from firmloop.cli import main
from firmloop.door.run import Run
from firmloop.identify.extras import ToolError
from firmloop.project.table import ProjectError

ROOT = Path(__file__).parents[2]
NAMES = ("load", "identify", "simulate", "design", "generate", "verify", "diagnose", "run")
# Each in a process of its own, in which no other name was asked for before; what is not ours is loaded once for all.
EACH_NAME = f"""
import os
import casadi, scipy.linalg, scipy.optimize, tomlkit
import firmloop as fl
for name in {NAMES}:
    if os.fork() == 0:
        f = getattr(fl, name)
        print(f.__module__, type(f).__name__, len(f.__doc__) > 40, flush=True)
        os._exit(0)
    os.wait()
"""
USER = """\
import firmloop as fl
from firmloop.identify.plants.plant import Plant
import firmloop.identify.units

project = fl.load("wheel_speed.toml")
identified = fl.identify(project)
plant: Plant = identified.plant
designed = fl.design(identified)
kp: float = designed.gains["kp"]
wrong: str = designed.gains["kp"]  # type: ignore[assignment]
code = fl.generate(designed)
agrees: bool = fl.verify(code, targets=["host"], steps=1000).agrees
verdict: str = fl.diagnose(project).finding.verdict
predicted = fl.simulate(project, "ramp.csv", start=fl.as_recorded).predicted.columns["speed_rad_s"]
text: str = fl.run(project).files("out")["report.html"]
"""


class Page(HTMLParser):
    """Checks that every tag is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.seen.add(tag)
        if tag not in ("meta", "path", "use", "rect", "image", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if self.open and self.open[-1] == tag:
            self.open.pop()


def shown(noun: object) -> set[str]:
    page = Page()
    page.feed(noun._repr_html_())  # type: ignore[attr-defined]
    assert not page.open
    return page.seen


def _python(code: str, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=folder,
        env={"PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize(
    "before", ["", "from firmloop.verify.run import verify_on; import firmloop.identify.fitting.fit"]
)
def test_a_name_of_the_door_is_its_function_whatever_was_imported(before: str, tmp_path: Path) -> None:
    found = _python(f"{before}\n{EACH_NAME}", tmp_path).splitlines()
    assert found == [f"firmloop.door.{name} function True" for name in NAMES]


@pytest.mark.parametrize(
    "code",
    [
        "from firmloop.identify.plants.plant import Plant; print(Plant.__name__)",
        "import firmloop; firmloop.identify; from firmloop.identify.plants.plant import Plant; print(Plant.__name__)",
        "import firmloop.identify.plants.plant as plant; print(plant.Plant.__name__)",
        "import firmloop; firmloop.identify; import firmloop.identify.plants.plant; "
        "print(firmloop.identify.plants.plant.Plant.__name__)",
    ],
)
def test_a_sub_package_of_the_same_name_is_imported_as_any_other(code: str, tmp_path: Path) -> None:
    assert _python(code, tmp_path) == "Plant"


def test_an_import_costs_nothing(tmp_path: Path) -> None:
    said = _python(
        "import sys, firmloop; print(sum(n.startswith('firmloop.') for n in sys.modules), 'numpy' in sys.modules)",
        tmp_path,
    )
    assert said == "0 False"


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fly'"):
        fl.fly  # type: ignore[attr-defined]  # noqa: B018
    assert set(NAMES) <= set(dir(fl)) and set(NAMES) <= set(fl.__all__)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory, recorded_files: dict[str, str]) -> Run:
    from tests.firmloop.conftest import PROJECT

    folder = tmp_path_factory.mktemp("walk")
    for name, text in {**recorded_files, "tank_heater.toml": PROJECT}.items():
        (folder / name).write_text(text)
    return fl.run(fl.load(folder / "tank_heater.toml"), steps=500)


def test_run_returns_what_each_of_its_functions_returns(walked: Run) -> None:
    assert walked.agrees and walked.verified.verdicts["host"].steps >= 500
    gain = {parameter.name: parameter for parameter in walked.identified.plant.parameters}["gain"]
    assert gain.value == pytest.approx(3.0, rel=0.02)
    assert walked.designed.gains["kp"] == 0.8 and walked.designed.law.inputs[0].unit == "degC"
    assert walked.code.program.id == walked.verified.verdicts["host"].program_id


def test_every_noun_shows_tables_and_plots(walked: Run, tmp_path: Path) -> None:
    assert {"table", "svg"} <= shown(walked) and {"table", "svg"} <= shown(walked.identified)
    assert {"table", "svg"} <= shown(walked.designed)
    assert {"table", "pre"} <= shown(walked.code) and "table" in shown(walked.verified)
    folder = walked.code.project.path.parent
    simulated = fl.simulate(walked.code.project, folder / "test.csv")
    assert "svg" in shown(simulated)
    simulated.save(tmp_path / "y.csv")
    assert (tmp_path / "y.csv").is_file()


def test_the_command_line_writes_what_the_functions_save(walked: Run, tmp_path: Path) -> None:
    project, path = walked.code.project, str(walked.code.project.path)
    fl.generate(project).save(tmp_path / "one")
    assert main(["generate", path, "--out", str(tmp_path / "two")]) == 0
    fl.identify(project).save(tmp_path / "three")
    assert main(["identify", path, "--out", str(tmp_path / "four")]) == 0
    for one, two in (("one", "two"), ("three", "four")):
        names, others = (
            sorted(file.relative_to(tmp_path / each) for file in (tmp_path / each).rglob("*") if file.is_file())
            for each in (one, two)
        )
        assert names and names == others
        for name in names:
            assert (tmp_path / one / name).read_bytes() == (tmp_path / two / name).read_bytes(), name


def test_each_function_takes_the_nouns_before_it(walked: Run, tmp_path: Path) -> None:
    """What is made of the noun is what is made of the project that the noun saves."""
    fitted, designed = walked.identified, walked.designed
    fitted.save(tmp_path / "fitted")
    saved = fl.load(tmp_path / "fitted" / "project.toml")
    file = walked.code.project.path.parent / "test.csv"
    for start in (fl.at_rest, fl.as_recorded):
        alone, as_saved = (fl.simulate(one, file, start=start).predicted.columns for one in (fitted, saved))
        assert np.array_equal(alone["temperature_C"], as_saved["temperature_C"])
    nominal = fl.simulate(walked.code.project, file).predicted.columns["temperature_C"]
    assert not np.allclose(nominal, fl.simulate(fitted, file).predicted.columns["temperature_C"])
    assert fl.generate(fitted).program.id == fl.generate(designed).program.id == fl.generate(saved).program.id
    for noun in (fitted, designed):
        assert fl.verify(noun, targets="host", steps=100).verdicts["host"].program_id == walked.code.program.id
    assert fl.run(fitted, targets="host", steps=100).identified is fitted
    found, of_saved = fl.diagnose(fitted).finding, fl.diagnose(saved).finding
    assert found.verdict == "no_mismatch" and found.as_dict() == of_saved.as_dict()


@pytest.mark.parametrize(
    ("verb", "noun", "words"),
    [
        ("identify", "designed", "takes a Project, and was given Designed; give it that one's project: .project"),
        ("simulate", "designed", "takes a Project or an Identified, and was given Designed"),
        ("design", "designed", "takes a Project or an Identified, and was given Designed"),
        ("generate", "code", "takes a Project, an Identified or a Designed, and was given Code"),
        ("verify", "verified", "takes a Project, an Identified, a Designed or a Code, and was given Verified"),
        ("diagnose", "code", "takes a Project or an Identified, and was given Code"),
        ("run", "code", "takes a Project or an Identified, and was given Code"),
        ("diagnose_fleet", "identified", "takes a Project, and was given Identified"),
    ],
)
def test_a_noun_that_is_not_before_a_function_is_refused(walked: Run, verb: str, noun: str, words: str) -> None:
    further = {"simulate": ("test.csv",), "diagnose_fleet": ("machines", "out")}.get(verb, ())
    for given, said in (
        (getattr(walked, noun), words),
        ("p.toml", "given str; read the file first: firmloop.load('p.toml')"),
        (None, "given None; firmloop.load reads a project's TOML file"),
    ):
        with pytest.raises(TypeError, match=re.escape(said)):
            getattr(fl, verb)(given, *further)


@pytest.mark.parametrize(("given", "called"), [(None, "None"), (5, "int"), (b"x", "bytes"), (["p.toml"], "list")])
def test_what_is_no_path_is_refused_in_a_sentence(walked: Run, given: Any, called: str) -> None:
    said = f"takes a path, and was given {called}; give a text or a Path, such as '"
    with pytest.raises(TypeError, match=re.escape(f"firmloop.load {said}wheel_speed.toml'")):
        fl.load(given)
    with pytest.raises(TypeError, match=re.escape(f"recording: {said}")):
        fl.simulate(walked.identified, given)
    for noun in (walked, walked.identified, walked.designed, walked.code, walked.verified):
        with pytest.raises(TypeError, match=re.escape(f"folder: {said}out'")):
            noun.save(given)
    for where, folder, name in ((given, "out", "where"), ("machines", given, "folder")):
        with pytest.raises(TypeError, match=re.escape(f"{name}: {said}")):
            fl.diagnose_fleet(walked.identified.project, where, folder)
    with pytest.raises(TypeError, match=r"start: 'recorded' is no start; give firmloop\.at_rest"):
        fl.simulate(walked.identified, "test.csv", start="recorded")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("asked", "kind", "words"),
    [
        ({"steps": -5}, ProjectError, "steps: '-5' is not a whole number from 1 to 1000000000"),
        ({"steps": 0}, ProjectError, "steps: '0' is not a whole number from 1 to 1000000000"),
        ({"steps": 1e3}, ProjectError, "steps: '1000.0' is not a whole number from 1 to 1000000000"),
        ({"seed": -1}, ProjectError, "seed: '-1' is not a whole number from 0 to"),
        ({"targets": "hots"}, ProjectError, "no target is called 'hots'; did you mean host?"),
        ({"targets": [3]}, TypeError, "targets: 3 is no name of a target"),
        (
            {"targets": 3},
            TypeError,
            "targets: 3 is no name of a target nor a list of some; firmloop targets lists them",
        ),
        ({"targets": None}, TypeError, "targets: None is no name of a target nor a list"),
        ({"fmu": 5}, TypeError, "fmu: takes a path, and was given int"),
        ({"fmu": "motor.fmu", "wires": 5}, TypeError, "wires: takes what the FMU calls each column, and was given int"),
        ({"port": 5}, TypeError, "port: 5 is no text such as /dev/ttyACM0"),
    ],
)
def test_a_wrong_number_or_target_is_refused_as_the_command_does(
    walked: Run, asked: dict[str, Any], kind: type[Exception], words: str
) -> None:
    for function, noun in ((fl.verify, walked.code), (fl.run, walked.identified)):
        with pytest.raises(kind, match=re.escape(words)):
            function(noun, **asked)  # type: ignore[operator]
    assert fl.verify(walked.code, targets="host", steps=np.int64(100)).agrees  # type: ignore[arg-type]


def test_a_users_file_passes_the_strict_type_checker(tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(USER)
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file",
        str(ROOT / "pyproject.toml"),
        str(tmp_path / "user.py"),
    ]
    # The line that ignores an error would be one itself, were there nothing to ignore.
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stdout


def test_what_an_extra_brings_is_named_with_its_command(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (project.parent / "train.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n\x1a\n")
    project.write_text(project.read_text().replace("train.csv", "train.mat"))
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 3
    assert (
        "needs h5py, which is not installed; install it with: pip install 'firmloop[hdf5]'" in capsys.readouterr().err
    )
    with pytest.raises(ToolError, match="hdf5"):
        fl.identify(fl.load(project))
