"""The source FMU of a plant with its effects reads, in FMPy, what our simulator reads."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.identify.simulation.stepped import SteppedPlant
from firmloop.project.project import read_project
from firmloop.stages.plant import plant_of

STEP = 0.001
STEPS = 2000
MOTOR = """\
schema = 1
name = "motor"

[plant]
kind = "dc_motor"
input = "voltage_V"
outputs = ["speed_rad_s", "current_A", "position_rad"]

[plant.parameters]
R_ohm = 7.4
L_H = 1.1e-3
ke_V_s_rad = 0.0213
kt_N_m_A = 0.0213
J_kg_m2 = 3.3e-6
b_N_m_s_rad = 3.6e-6
"""
PLANTS: Mapping[str, tuple[str, str]] = {  # by name: the project, what is appended to it
    "motor": (MOTOR, ""),
    "friction and a late input": (
        MOTOR,
        '[[plant.effects]]\nname = "coulomb_friction"\ntorque_N_m = 1e-3\n'
        '[[plant.effects]]\nname = "input_delay"\ndelay_s = 0.00235\n',
    ),
    "an actuator that is slow, clipped and dead in the middle, a late sensor": (
        MOTOR,
        '[[plant.effects]]\nname = "slew_rate_limit"\nrate_V_s = 2900\n'
        '[[plant.effects]]\nname = "input_saturation"\nlimit_V = 9\n'
        '[[plant.effects]]\nname = "dead_zone"\nhalf_width_V = 0.4\n'
        '[[plant.effects]]\nname = "sensor_delay"\ndelay_s = 0.0034\noutput = "current_A"\n',
    ),
    "cogging and a step of the load": (
        MOTOR,
        '[[plant.effects]]\nname = "cogging_torque"\namplitude_N_m = 8e-4\nperiods_per_rev = 7\nphase_rad = 0.3\n'
        '[[plant.effects]]\nname = "load_step"\ntorque_N_m = 2e-3\ntime_s = 1.00037\n',
    ),
    "equations that are not linear": (
        'schema = 1\nname = "arm"\n[plant]\nkind = "ode"\nstates = ["x_m", "v_m_s"]\ninputs = ["force_N"]\n'
        '[plant.outputs]\nposition_m = "x_m"\nspeed_m_s = "v_m_s + 0.1 * x_m * x_m"\n'
        '[plant.derivatives]\nx_m = "v_m_s"\nv_m_s = "(force_N - c_N_s_m*v_m_s - k_N_m*sin(x_m)) / m_kg"\n'
        '[plant.balances]\nv_m_s = { kind = "force", per = "1/m_kg", position = "x_m", speed = "v_m_s" }\n'
        "[plant.parameters]\nm_kg = 1.0\nc_N_s_m = 2.0\nk_N_m = 50.0\n",
        '[[plant.effects]]\nname = "coulomb_friction"\nforce_N = 0.5\n',
    ),
}


def exported(project: Path, out: Path, step: float = STEP) -> Path:
    """Export the plant and unpack it."""
    assert main(["export", str(project), "--fmu", "--of", "plant", "--step", str(step), "--out", str(out)]) == 0
    folder = out.with_suffix("")
    with zipfile.ZipFile(out) as archive:
        archive.extractall(folder)
    return folder


def replayed(folder: Path, drive: np.ndarray, step: float) -> np.ndarray:
    """Build the FMU as an importer does and return what its outputs read before each row of `drive` acts."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (pip install fmpy)")
    slaves = pytest.importorskip("fmpy.fmi3")
    description = fmpy.read_model_description(str(folder), validate=True)
    model = description.coSimulation.modelIdentifier
    library = folder / "binaries" / slaves.platform_tuple / f"{model}{fmpy.sharedLibraryExtension}"
    library.parent.mkdir(parents=True)
    listed = [
        str(folder / "sources" / each) for each in description.buildConfigurations[0].sourceFileSets[0].sourceFiles
    ]
    flags = ["-std=c99", "-pedantic-errors", "-O2", "-ffp-contract=off", "-fPIC", "-shared"]
    headers = Path(fmpy.__file__).parent / "c-code"
    built = ["gcc", *flags, f"-I{headers}", *listed, "-o", str(library), "-lm"]
    done = subprocess.run(built, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    by_kind = {
        kind: [each.valueReference for each in description.modelVariables if each.causality == kind]
        for kind in ("input", "output")
    }
    slave = slaves.FMU3Slave(
        guid=description.guid, unzipDirectory=str(folder), modelIdentifier=model, instanceName="one"
    )
    slave.instantiate()
    slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    rows = []
    for k, values in enumerate(drive):
        rows.append(slave.getFloat64(by_kind["output"]))
        slave.setFloat64(by_kind["input"], values.tolist())
        slave.doStep(k * step, step)
    slave.terminate()
    slave.freeInstance()
    return np.array(rows)


def stepped(project: Path, drive: np.ndarray, step: float) -> np.ndarray:
    model, rows = SteppedPlant(plant_of(read_project(project)), step), []
    for values in drive:
        rows.append(model.read())
        model.apply(values)
    return np.array(rows)


def a_drive(steps: int = STEPS, size: float = 11.0) -> np.ndarray:
    return np.repeat(np.random.default_rng(3).uniform(-size, size, steps // 40 + 1), 40)[:steps, None]


@pytest.mark.parametrize("name", PLANTS)
def test_an_fmu_reads_what_the_simulator_reads(name: str, tmp_path: Path) -> None:
    text, more = PLANTS[name]
    project = tmp_path / "p.toml"
    project.write_text(text + more)
    drive = a_drive()
    got = replayed(exported(project, tmp_path / "p.fmu"), drive, STEP)
    wanted = stepped(project, drive, STEP)
    assert np.ptp(wanted, axis=0).min() > 0.0
    np.testing.assert_array_equal(got, wanted)
