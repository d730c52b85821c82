"""A value that a project holds, and that is a little off, is told beside the effect that would do the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.diagnose.cases import BY_NAME, concealed, said_of, shortened


@pytest.mark.parametrize(
    ("factor", "verdict", "names"),
    [
        pytest.param(0.85, "ambiguous", {"sensor_gain"}, id="a seventh too small"),
        pytest.param(1.0, "no_mismatch", set(), id="as it is"),
    ],
)
def test_a_held_inductance_that_is_off_is_told(factor: float, verdict: str, names: set[str], tmp_path: Path) -> None:
    project = shortened(concealed(tmp_path, "", 0.0, False), 3000)
    text = project.read_text(encoding="utf-8")
    inductance, torque = (BY_NAME["flat_motor"].values[name] for name in ("L", "kt"))
    for name, value in (("L_H", factor * inductance), ("kt_N_m_A", torque)):
        text = re.sub(f"{name} = .*", f"{name} = {{ value = {value}, free = false }}", text)
    project.write_text(text, encoding="utf-8")
    said = said_of(project)
    assert (said["verdict"], {each["name"] for each in said["effects"]}) == (verdict, names)
    (told,) = re.findall(r"L_H, which the project holds at .*, fitted is (\S+) ± (\S+) H", said["says"][0]) or [None]
    assert (told is not None) == bool(names)
    assert told is None or abs(float(told[0]) - inductance) < 2.0 * float(told[1])
