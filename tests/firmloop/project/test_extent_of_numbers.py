"""A quantity beyond all that is measured is refused; a coefficient of a high order, which is no quantity, is not."""

from __future__ import annotations

from pathlib import Path

import pytest
import scipy.signal

from firmloop.cli import main

FILTER = """schema = 1
name = "bw"
[controller]
kind = "transfer_function"
period_s = 1e-5
domain = "s"
discretize = "tustin"
numerator = {numerator}
denominator = {denominator}
[signals]
reference = {{ unit = "V", low = -1, high = 1 }}
measurement = {{ unit = "V", low = -1, high = 1 }}
output = {{ unit = "V", low = -1, high = 1 }}
[arithmetic]
number = "float64"
"""


def test_a_filter_of_order_10_at_4_khz_designs_though_its_coefficients_reach_1e44(tmp_path: Path) -> None:
    numerator, denominator = scipy.signal.butter(10, 25132.0, analog=True)
    assert float(denominator[-1]) > 1e43
    text = FILTER.format(numerator=[float(x) for x in numerator], denominator=[float(x) for x in denominator])
    (tmp_path / "p.toml").write_text(text)
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize("value", ["1e251", "1e-251", "nan"])
def test_a_coefficient_that_no_double_can_compute_with_is_refused(
    value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(FILTER.format(numerator=f"[{value}]", denominator="[1.0, 1.0]"))
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "numerator" in capsys.readouterr().err


def test_windows_do_not_hide_how_many_moments_a_recording_is_resampled_to(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = "[recordings.conditioning]\nwindow_s = 0.2\nresample_s = 1e-5\n[plant]"
    project.write_text(project.read_text().replace("[plant]", keys, 1))
    assert main(["identify", str(project), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "resample_s is 1e-05" in said and "at most 100,000: make it longer" in said, said


@pytest.mark.parametrize("clock", ["5.0", "1e30"])
def test_a_clock_in_which_an_excitation_never_changes_is_refused(
    clock: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = f'signal = "prbs"\nlow = -6\nhigh = 6\nperiod_s = 0.01\nduration_s = 5\nclock_s = {clock}\n'
    (tmp_path / "p.toml").write_text(f'schema = 1\nname = "x"\n[experiment]\n{keys}')
    assert main(["excite", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "experiment.clock_s is" in said and "never changes; give a shorter clock_s" in said, said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[arithmetic]", f"[{'a.' * 3000}b]\n[arithmetic]"), "tables in one another"),
        (("[arithmetic]", f"[{'a.' * 40}b]\n[arithmetic]"), "tables in one another"),
        (("domain = ", f"numerators = {'{a = ' * 200}1{'}' * 200}\ndomain = "), "tables in one another"),
    ],
)
def test_what_is_nested_beyond_any_project_is_refused_in_one_sentence(
    change: tuple[str, str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.toml").write_text(FILTER.format(numerator="[1.0]", denominator="[1.0, 1.0]").replace(*change, 1))
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert words in said and "internal" not in said, said


@pytest.mark.parametrize("domain", ["z", "s"])
@pytest.mark.parametrize("order", [65, 2000])
def test_an_order_that_cannot_be_proven_is_refused_before_its_roots_are_asked_for(
    order: int, domain: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = FILTER.format(numerator="[1.0]", denominator=[1.0] * (order + 1))
    text = text if domain == "s" else text.replace('"s"\ndiscretize = "tustin"', '"z"')
    (tmp_path / "p.toml").write_text(text)
    assert main(["design", str(tmp_path / "p.toml"), "--out", str(tmp_path / "out")]) == 2
    assert f"make {order} states; at most 64" in capsys.readouterr().err
