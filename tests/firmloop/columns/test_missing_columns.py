"""A column of the plant that a recording lacks is named with those it has, by every verb that asks for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from tests.firmloop.columns.plain_file import HEAT, TIME, VOLT, alike

PLANTS = {
    "first_order": ("temperature_C", "gain = 1.0\ntime_constant_s = 1.0"),
    "second_order": (
        "temperature_C",
        "gain = 1.0\nnatural_frequency_rad_s = 1.0\ndamping_ratio = 1.0\ndelay_s = 0.0",
    ),
    "dc_motor": (
        "speed_rad_s",
        "R_ohm = 1.0\nL_H = 0.001\nke_V_s_rad = 0.05\nkt_N_m_A = 0.05\nJ_kg_m2 = 1e-5\nb_N_m_s_rad = 1e-5",
    ),
}


@pytest.mark.parametrize("verb", ["identify", "diagnose", "examine"])
@pytest.mark.parametrize("kind", list(PLANTS))
@pytest.mark.parametrize("hold", ["zero_order", "linear"])
def test_an_input_that_a_recording_lacks_is_named(
    verb: str, kind: str, hold: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, starts = PLANTS[kind]
    values = np.column_stack([TIME, VOLT, HEAT]).tolist()
    rows = [f"time_s,volts,{output}", *(",".join(map(repr, row)) for row in values), ""]
    (tmp_path / "r.csv").write_text("\n".join(rows))
    (tmp_path / "p.toml").write_text(
        f'schema = 1\nname = "a"\n[recordings]\ntrain = ["r.csv"]\nhold = "{hold}"\n[plant]\nkind = "{kind}"\n'
        f'input = "voltage_V"\noutputs = ["{output}"]\n[plant.parameters]\n{starts}\n'
    )
    status = main([verb, str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")])
    said = capsys.readouterr().err
    assert status == 2, said
    assert f"r.csv: column voltage_V is missing; it has volts, {output} (map a foreign name in" in said


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_exponents_of_fortran_are_numbers(mark: str, bench: Callable[..., tuple]) -> None:
    rows = [
        f"{t:.5E}{mark}{u:.3f}D+00{mark}{y:.17e}".replace("e", "d") for t, u, y in zip(TIME, VOLT, HEAT, strict=True)
    ]
    status, columns, said = bench("\n".join([mark.join(("time_s", "voltage_V", "temperature_C")), *rows, ""]))
    assert status == 0, said
    assert "has exponents with a D, as Fortran writes them" in said
    alike(columns)


def test_words_with_a_d_between_digits_stay_words(bench: Callable[..., tuple]) -> None:
    rows = [
        f"{t!r},{u!r},{y!r},3D{k % 7}"
        for k, (t, u, y) in enumerate(zip(TIME.tolist(), VOLT.tolist(), HEAT.tolist(), strict=True))
    ]
    status, columns, said = bench("\n".join(["time_s,voltage_V,temperature_C,serial", *rows, ""]))
    assert status == 0 and "has a column without numbers, left aside" in said, said
    assert "Fortran" not in said
    alike(columns)
