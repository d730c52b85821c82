"""Small projects with something concealed, made by the truth of the benchmark."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.diagnose.blind_cases import Case, draw_case, single_case, write_case
from bench.diagnose.concealed import MACHINES
from firmloop.cli import main
from firmloop.diagnose.data.checks import preflight
from firmloop.diagnose.model.candidate import Candidate, rated
from firmloop.diagnose.model.fit import Fitted, fit, noises_of
from firmloop.diagnose.model.hypothesis import LibraryTerm, Point, Problem, first_point, make_problem
from firmloop.door.diagnose import diagnose
from firmloop.door.load import load
from firmloop.identify.fitting.noise import Noise, white
from firmloop.project.project import read_project
from firmloop.stages.data import read_data
from firmloop.stages.plant import plant_of
from tests.conftest import Once

SHORT = 1500  # rows, of 5000: a diagnosis takes in proportion to them
BY_NAME = {machine.name: machine for machine in MACHINES}


def concealing(name: str, size: float, colored: bool) -> Case:
    """Return the case of a motor that conceals one effect (an empty name: none)."""
    return single_case(5, name, BY_NAME["flat_motor"], ("speed", "current"), "mixed", colored, size)


def concealed(folder: Path, name: str, size: float, colored: bool) -> Path:
    """Write the project of such a motor; return the project file."""
    return laid(folder, simulated(concealing, name, size, colored))


def shortened(project: Path, rows: int = SHORT) -> Path:
    """Leave the first rows of each of a project's recordings: enough of them for what is large; return its file."""
    for path in project.parent.glob("*.csv"):
        path.write_text("".join(path.read_text(encoding="utf-8").splitlines(keepends=True)[: 1 + rows]))
    return project


def without_tests(project: Path) -> Path:
    """Take the test recordings out of a project; return its file."""
    lines = project.read_text(encoding="utf-8").splitlines()
    project.write_text("\n".join(line for line in lines if not re.match(r"\s*test\s*=", line)), encoding="utf-8")
    return project


def drawn(folder: Path, seed: int) -> Path:
    """Write the project of a case of the benchmark; return the project file."""
    return laid(folder, simulated(draw_case, seed))


@cache
def simulated(draw: Callable[..., Case], *asked: object) -> Mapping[str, bytes]:
    """Return the files of a case: the truth takes half a second to simulate, and several tests ask for the same."""
    with TemporaryDirectory() as made:
        written(Path(made), draw(*asked))
        files = (path for path in Path(made).rglob("*") if path.is_file())
        return {str(path.relative_to(made)): path.read_bytes() for path in files}


def laid(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Put a case's files into a folder; return the project file."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder / "case" / "project.toml"


def written(folder: Path, case: Case) -> Path:
    """Write a case; return the project file."""
    write_case(case, folder / "case", folder / "labels")
    return folder / "case" / "project.toml"


def truths(folder: Path, effect: str) -> dict[str, float]:
    """Return the parameters of an effect that a case written there conceals."""
    label = json.loads((folder / "labels" / "label.json").read_text(encoding="utf-8"))
    return {name: float(value) for name, value in label["effects"][effect].items()}


def logged(folder: Path, project: str, head: str, *columns: NDArray[np.float64]) -> Path:
    """Write a project's text and its one recording, log.csv with columns of these names; return the project file."""
    np.savetxt(folder / "log.csv", np.column_stack(columns), delimiter=",", header=head, comments="", fmt="%.9g")
    file = folder / "project.toml"
    file.write_text(project, encoding="utf-8")
    return file


def lag_project(drive: str, output: str, gain: float, lag: float, train: Sequence[str] = ("log.csv",)) -> str:
    """Return the text of a project whose plant is a lag of first order without a delay."""
    return black_box_project("first_order", drive, output, train) + (
        f"[plant.parameters]\ngain = {{ value = {gain}, free = true }}\n"
        f"time_constant_s = {{ value = {lag}, free = true }}\ndelay_s = {{ value = 0.0, free = false }}\n"
    )


def black_box_project(kind: str, drive: str, output: str, train: Sequence[str] = ("log.csv",)) -> str:
    """Return the text of a project whose plant has one input, one output, and no value yet."""
    return (
        f'schema = 1\nname = "lag"\n[recordings]\ntrain = {json.dumps(list(train))}\n[plant]\nkind = "{kind}"\n'
        f'input = "{drive}"\noutputs = ["{output}"]\n'
    )


def lagged(drive: NDArray[np.float64], time_constant_s: float) -> NDArray[np.float64]:
    """Return what a lag of gain 1 makes of a drive, row by row of 10 ms."""
    level = np.zeros(len(drive))
    for k in range(1, len(drive)):
        level[k] = level[k - 1] + 0.01 / time_constant_s * (drive[k - 1] - level[k - 1])
    return level


class Motor(NamedTuple):
    """A motor of one constant, of which a log holds voltage and speed."""

    resistance: float  # ohm
    inductance: float  # H
    constant: float  # V s/rad and N m/A
    inertia: float  # kg m^2
    friction: float  # N m s/rad
    limit: float = math.inf  # A, of its driver
    brakes: bool = True  # whether that lets current through against its voltage


MOTOR_PROJECT = """schema = 1
name = "motor"
[recordings]
train = ["log.csv"]
[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s"]
[plant.parameters]
R_ohm = {{ value = {0.resistance}, free = false }}
L_H = {{ value = {0.inductance}, free = false }}
ke_V_s_rad = {{ value = {1}, free = true }}
kt_N_m_A = {{ value = {0.constant}, free = false }}
J_kg_m2 = {{ value = {2}, free = true }}
b_N_m_s_rad = {{ value = {3}, free = true }}
"""


def motion(
    motor: Motor, drive: NDArray[np.float64], step: float, pull: Callable[[float, float], float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a motor's angle and speed at every row, from rest, each voltage held for a step (s).

    `pull` is the torque at an angle and a speed that holds the shaft back.
    """
    fine = math.ceil(step / 5e-5)
    current = speed = angle = 0.0
    angles, speeds = np.empty(len(drive)), np.empty(len(drive))
    for k, voltage in enumerate(drive):
        angles[k], speeds[k] = angle, speed
        for _ in range(fine):
            rise = (voltage - motor.resistance * current - motor.constant * speed) / motor.inductance
            push = motor.constant * current - motor.friction * speed - pull(angle, speed)
            current = min(max(current + step / fine * rise, -motor.limit), motor.limit)
            if not motor.brakes and current * voltage <= 0.0:
                current = 0.0
            speed += step / fine * push / motor.inertia
            angle += step / fine * speed
    return angles, speeds


def turned(
    folder: Path,
    motor: Motor,
    told: tuple[float, float, float],
    drive: NDArray[np.float64],
    pull: Callable[[float], float],
    noise: NDArray[np.float64],
) -> Path:
    """Log a motor's speed from rest, each voltage held for 1 ms; return the project file, with ke, J and b as `told`.

    `pull` is the torque at an angle that holds the shaft back.
    """
    step = 1e-3
    _, read = motion(motor, drive, step, lambda angle, _: pull(angle))
    head = "time_s,voltage_V,speed_rad_s"
    return logged(folder, MOTOR_PROJECT.format(motor, *told), head, step * np.arange(len(drive)), drive, read + noise)


def problem_of(project: Path) -> Problem:
    """Return a project's plant and recordings as a search sees them."""
    made = read_project(project)
    plant, data = plant_of(made), read_data(made)
    return make_problem(plant, data.train, data.test, preflight(plant, data.train, data.test).floors)


def nominal_of(problem: Problem) -> Candidate:
    """Return the nominal plant refitted, as a search begins with it."""
    flat = [white(float(problem.train[0].columns[signal.name].std())) for signal in problem.plant.outputs]
    fitted = fit(problem, problem.train, (), first_point(problem, problem.train), flat, 24)
    return rated(problem, fit(problem, problem.train, (), fitted.point, noises_of(problem, fitted.residuals), 24))


def refitted(
    problem: Problem, term: LibraryTerm, begin: Point, sizes: Sequence[float]
) -> tuple[Fitted, tuple[Noise, ...]]:
    """Fit one term, at last with the noise it leaves; `sizes` are those of the outputs' noise to begin with."""
    found = fit(problem, problem.train, (term,), begin, [white(size) for size in sizes], 12)
    for _ in range(3):
        noises = noises_of(problem, found.residuals)
        found = fit(problem, problem.train, (term,), found.point, noises, 12)
    return found, noises


def said_of(project: Path) -> dict[str, Any]:
    """Diagnose; return what diagnosis.json would hold. No page is drawn, which takes as long as the search."""
    said: dict[str, Any] = json.loads(json.dumps(diagnose(load(project)).finding.as_dict(), allow_nan=False))
    return said


def diagnosis(project: Path, out: Path) -> tuple[int, dict[str, Any]]:
    """Diagnose by the command line; return the exit status and diagnosis.json."""
    status = main(["diagnose", str(project), "--out", str(out)])
    return status, json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """One diagnosis that several tests judge."""

    folder: Path  # with `case`, `labels` and `out`
    status: int
    printed: str

    @property
    def said(self) -> dict[str, Any]:
        """What diagnosis.json holds."""
        said: dict[str, Any] = json.loads((self.folder / "out" / "diagnosis.json").read_text(encoding="utf-8"))
        return said


def said_once(once: Once, name: str, case: Case) -> dict[str, Any]:
    """Return what diagnosis.json would hold of a case, diagnosed once in a run of the tests for all that name it so."""

    def fill(folder: Path) -> None:
        (folder / "said.json").write_text(json.dumps(said_of(written(folder, case))), encoding="utf-8")

    said: dict[str, Any] = json.loads((once(f"what is said of {name}", fill) / "said.json").read_text(encoding="utf-8"))
    return said


def diagnosed_once(once: Once, name: str, case: Case) -> Diagnosed:
    """Diagnose a short case by the command line, once in a run of the tests for all that name it so."""

    def fill(folder: Path) -> None:
        with redirect_stdout(io.StringIO()) as printed:
            status, _ = diagnosis(shortened(written(folder, case)), folder / "out")
        (folder / "printed.json").write_text(json.dumps([status, printed.getvalue()]), encoding="utf-8")

    folder = once(name, fill)
    return Diagnosed(folder, *json.loads((folder / "printed.json").read_text(encoding="utf-8")))


def concealed_once(once: Once, name: str, colored: bool) -> Diagnosed:
    """Diagnose a motor that conceals one effect (an empty name: none) by the command line, once in a run."""
    called = f"{name or 'nothing'} in {'colored' if colored else 'white'} noise"
    return diagnosed_once(once, called, concealing(name, 0.3 if name else 1.0, colored))
