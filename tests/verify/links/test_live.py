"""A controller that runs by itself: its samples are those of its steps, it never waits, and what is lost is counted."""

from __future__ import annotations

import json
import struct
import time
from pathlib import Path

import numpy as np
import pytest

from bench.links.live import SIGNALS, TARGET, running, stream
from firmloop.cli import main
from firmloop.codegen.bundle import CodegenError
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import live_firmware
from firmloop.codegen.target import load_target, target_names
from firmloop.identify.recordings.recording import read_recording
from firmloop.project.project import read_project
from firmloop.quantize.lower.lower import ARITHMETICS, lower
from firmloop.quantize.program import Program
from firmloop.stages.board.monitoring import Watch, settings_of
from firmloop.stages.board.tape import Seen, Setting
from firmloop.stages.making import design, generate
from firmloop.stages.plant import plant_of
from firmloop.verify.build.image import build_image
from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import binding, seal, unseal
from firmloop.verify.links.live import DATA, HELLO, WATCH, LiveLink, open_live_port, watchable
from firmloop.verify.reference import run
from tests.laws import FULL, pid

PROJECT = """\
schema = 1
name = "tank"
[recordings]
train = ["seen.csv"]
test = ["again.csv"]
[plant]
kind = "first_order"
input = "voltage_V"
outputs = ["temperature_C"]
[plant.parameters]
gain = { value = 10.0, free = true }
time_constant_s = { value = 1.0, free = true }
delay_s = { value = 0.0, free = false }
[controller]
kind = "pid"
period_s = 0.001
kp = 0.05
ki = 0.4
[signals]
reference = { unit = "degC", low = -400, high = 400 }
measurement = { unit = "degC", low = -400, high = 400 }
output = { unit = "V", low = -12, high = 12 }
[arithmetic]
number = "float32"
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "tank.toml").write_text(PROJECT)
    return tmp_path / "tank.toml"


def stream_without_loss(link: LiveLink, names: tuple[str, ...], every: int, steps: int) -> Seen:
    """Stream again if samples were lost: where the machine stands still long enough, they are, and are counted."""
    for _ in range(10):
        seen = stream(link, names, every, steps)
        if seen.lost_in_image + seen.lost_on_line == 0:
            return seen
    raise AssertionError("ten times in a row samples were lost")


class Echo:
    """An image that answers at once, after what an earlier watch left on the line."""

    def __init__(self, program: Program) -> None:
        self._hello = struct.pack("<5I16s", 2, 0, 0, 0, len(watchable(program)), program.id.encode())
        self._ahead = self._waiting = b""

    def leave(self, kind: int, sequence: int, payload: bytes, bound: int) -> None:
        self._ahead += b"\0" + seal(kind, sequence, payload, bound)

    def write(self, data: bytes) -> None:
        kind, sequence, payload = unseal(data[1:-1])
        reply = payload[:4] + self._hello if kind == HELLO else payload
        ahead, self._ahead = self._ahead, b""
        self._waiting += ahead + b"\0" + seal(kind | 0x80, sequence, reply)

    def read(self, timeout: float) -> bytes:
        waiting, self._waiting = self._waiting, b""
        return waiting

    def close(self) -> None:
        """Stay: the controller runs on."""


def test_what_an_earlier_watch_left_on_the_line_is_not_taken() -> None:
    program = lower(pid(FULL), "float32")
    echo = Echo(program)
    with LiveLink(echo, "test line", program, timeout=5.0, attempts=1) as link:
        mask_of_another = struct.pack("<4s2I", b"late", 1, 1)
        echo.leave(WATCH | 0x80, 2, mask_of_another, 0)
        link.watch(("output",), 1)
        row = struct.pack("<3If", 0, 8, 7, 1.5)
        echo.leave(DATA, 0, row, binding(int.from_bytes(b"late", "little"), 0))
        echo.leave(DATA, 0, row, 0)
        echo.leave(DATA, 0, struct.pack("<3If", 0, 9, 8, 2.5), binding(int.from_bytes(link._ticket, "little"), 0))
        link.state()
        (samples,) = link.samples(5.0)
    assert samples.rows.tolist() == [(8, 2.5)]


@pytest.mark.qemu
def test_what_is_watched_is_what_the_reference_computes() -> None:
    """From the samples alone: the inputs seen, fed to the bit-exact reference, give the outputs seen."""
    program = lower(pid({"kp": 0.05}), "float32")  # has no state, so that any first sample will do
    with running(program) as port, open_live_port(TARGET, port, program) as link:
        seen = stream_without_loss(link, SIGNALS, 2, 400)
        state = link.state()
    rows = seen.rows
    assert state.late == 0
    assert len(rows) == 200 and (np.diff(rows["step"]) == 2).all()
    inputs = np.stack([rows["reference"], rows["measurement"]], axis=-1)
    trace = run(program, inputs[None])
    np.testing.assert_array_equal(trace.outputs[0, :, 0], rows["output"])
    np.testing.assert_array_equal(trace.status[0], rows["status"])


@pytest.mark.qemu
def test_a_line_that_stalls_costs_samples_and_no_step() -> None:
    program = lower(pid(FULL), "float32")
    with running(program) as port, open_live_port(TARGET, port, program) as link:
        for pause in (1.5, 3.0, 6.0, 12.0):
            link.watch(SIGNALS, 1)
            before = link.state()
            time.sleep(pause)  # nobody reads: the terminal's memory fills, then the ring
            behind = link.state()
            if behind.lost:
                break
        parts, numbers, gaps = [], np.zeros(0), 0
        for _ in range(300):  # what was kept before the ring filled comes first; the gap follows it
            parts += link.samples(0.1)
            if parts:
                numbers = np.concatenate([part.rows["step"] for part in parts])
                gaps = int(numbers[-1] - numbers[0]) + 1 - len(numbers)
            if gaps:
                break
        seen = stream_without_loss(link, ("output",), 1, 100)
        after = link.state()
    assert behind.steps - before.steps > behind.lost
    assert behind.lost > 0 and behind.late == after.late == 0
    assert 0 < gaps <= behind.lost + after.lost
    assert len(seen.rows) == 100


@pytest.mark.qemu
def test_the_recording_is_one_that_identify_reads(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    read = read_project(project)
    program = generate(read, design(read, plant_of(read)), "test").program
    with running(program) as port:
        command = ["monitor", str(project), "--port", port, "--target", TARGET.name, "--seconds", "1.5"]
        for name in ("seen.csv", "again.csv"):
            said = ""
            for _ in range(10):  # where the machine stands still long enough samples are lost, and are counted
                if "lost: 0 in the image, 0 on the line" not in said:
                    assert main([*command, "--out", str(tmp_path / name)]) == 0
                    said = capsys.readouterr().out
            assert "1,500 samples of reference, measurement, output" in said
            assert "lost: 0 in the image, 0 on the line" in said
        assert main([*command, "--out", str(tmp_path / "no.csv"), "--signals", "speed"]) == 2
    recording = read_recording(tmp_path / "seen.csv", {})
    assert set(recording.columns) == {"reference_C", "temperature_C", "voltage_V"}
    assert main(["identify", str(project), "--out", str(tmp_path / "fit")]) == 0
    fitted = read_project(tmp_path / "fit" / "project.toml")
    parameters = {parameter.name: parameter.value for parameter in plant_of(fitted).parameters}
    assert parameters["gain"] == pytest.approx(40.0, rel=0.02)
    assert parameters["time_constant_s"] == pytest.approx(0.1, rel=0.03)


@pytest.mark.qemu
def test_a_parameter_is_set_between_two_steps() -> None:
    """What the controller held is seen; with it, the bit-exact reference gives the outputs seen, over every change."""
    program = lower(pid({"kp": 0.05, "tunable": ["kp"], "ranges": {"kp": [0.0, 0.2]}}), "float32")
    (kp,) = program.parameters
    low, high, middle, beyond = (np.array([x], dtype=np.float32) for x in (kp.low, kp.high, kp.high / 3, 0.25))
    settings = [Setting("kp", high, 0), Setting("kp", middle, 100), Setting("kp", low, 200)]
    with running(program) as port, open_live_port(TARGET, port, program) as link:
        for _ in range(10):
            seen = stream(link, (*SIGNALS, "kp"), 1, 400, settings)
            if seen.lost_in_image + seen.lost_on_line == 0:
                break
        with pytest.raises(LinkError, match=r"the image refused kp = 0\.25: it is out of its proven range"):
            link.set("kp", beyond)
        state = link.state()
    rows = seen.rows
    assert (len(rows), state.late) == (400, 0)
    steps = rows["step"]
    for made, value, before in zip(seen.made[1:], (middle, low), (high, middle), strict=True):
        assert rows["kp"][steps == made.step - 1] == before and rows["kp"][steps == made.step] == value
    assert set(rows["kp"]) == {low[0], middle[0], high[0]} and rows["kp"][0] == high[0]
    inputs = np.stack([rows["reference"], rows["measurement"]], axis=-1)
    trace = run(program, inputs[None], rows["kp"][None, :, None])
    np.testing.assert_array_equal(trace.outputs[0, :, 0], rows["output"])
    np.testing.assert_array_equal(trace.status[0], rows["status"])


TUNABLE = PROJECT.replace(
    "ki = 0.4", 'ki = 0.4\ntunable = ["kp", "ki"]\n[controller.ranges]\nkp = [0.0, 0.2]\nki = [0.0, 5.0]'
)


@pytest.mark.qemu
def test_the_recording_tells_when_a_parameter_was_set(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project.write_text(TUNABLE)
    read = read_project(project)
    program = generate(read, design(read, plant_of(read)), "test").program
    with running(program) as port:
        command = ["monitor", str(project), "--port", port, "--target", TARGET.name, "--seconds", "0.8", "--json"]
        asked = ["--set", "ki=2.5@0.5", "--set", "kp=0.2", "--set", "ki=0@0.2"]
        assert main([*command, "--out", str(tmp_path / "seen.csv"), *asked]) == 0
        said = json.loads(capsys.readouterr().out)
    assert [(entry["name"], entry["value"]) for entry in said["set"]] == [
        ("kp", pytest.approx(0.2)),
        ("ki", 0.0),
        ("ki", 2.5),
    ]
    assert said["late_steps"] == 0
    recording = read_recording(tmp_path / "seen.csv", {})
    time, kp, ki = recording.time, recording.columns["kp_V_degC"], recording.columns["ki_V_degC_s"]
    assert set(kp) == {said["set"][0]["value"]}
    for entry, wanted in zip(said["set"][1:], (0.2, 0.5), strict=True):
        assert entry["time_s"] > wanted
        assert (ki == entry["value"])[(time > entry["time_s"] - 5e-4) & (time < entry["time_s"] + 0.1)].all()
        assert (ki != entry["value"])[(time < entry["time_s"] - 5e-4) & (time > entry["time_s"] - 0.1)].all()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (
            "kp=0.201",
            "--set kp=0.201: is beyond its proven range, 0 to 0.2 V/degC; to go there, widen controller.ranges",
        ),
        ("kp=nan", "'nan' is not a number"),
        ("kd=0.1", "--set kd: is no tunable parameter of tank; tunable: kp, ki"),
        ("kp=0.1@10", "--set kp=0.1@10: comes after the last sample; watch for longer (--seconds)"),
        ("kp", "'kp' is not like kp=1.2 or kp=1.2@5.0"),
        ("kp=0.1@", "'kp=0.1@' is not like"),
        ("kp=0.1@-1", "'-1' is not a number from 0"),
        ("=0.1", "'=0.1' is not like"),
    ],
)
def test_what_cannot_be_set_is_told_before_the_line_is_opened(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: str, words: str
) -> None:
    project.write_text(TUNABLE)
    command = ["monitor", str(project), "--port", "nowhere", "--target", TARGET.name, "--out", str(tmp_path / "a.csv")]
    try:
        status = main([*command, "--set", asked])
    except SystemExit as stopped:
        status = stopped.code
    assert status == 2 and words in capsys.readouterr().err
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_both_ends_of_the_range_can_be_set(project: Path, arithmetic: str) -> None:
    program = lower(
        pid({**FULL, "tunable": ["kp", "ki"], "ranges": {"kp": [0.1 / 3, 0.7 / 3], "ki": [0, 5]}}), arithmetic
    )
    watch = Watch("", "", (), 1, 1.0, (("kp", 0.1 / 3, 0.0), ("kp", 0.7 / 3, 0.0)))
    low, high = settings_of(program, watch)
    assert (low.value[0], high.value[0]) == (program.parameters[0].low, program.parameters[0].high)


@pytest.mark.qemu
def test_another_program_and_a_dead_line_are_told() -> None:
    program = lower(pid(FULL), "float32")
    with running(program) as port:
        with pytest.raises(LinkError, match=r"the image runs program .* flash it again"):
            open_live_port(TARGET, port, lower(pid(FULL), "float64"))
    with pytest.raises(LinkError, match="cannot be opened"):
        open_live_port(TARGET, port, program)


@pytest.mark.cross
@pytest.mark.parametrize("name", [name for name in target_names() if load_target(name).uart is not None])
def test_a_live_image_builds_for_every_board(name: str, tmp_path: Path) -> None:
    target, program = load_target(name), lower(pid(FULL), "fixed32")
    own = {"io.c": f"{INPUT_OUTPUT.format(name=program.name)}"}
    image = build_image(live_firmware(program, emit(program, "test"), target, own), target, tmp_path)
    assert image.whole.text_bytes < 8_192


INPUT_OUTPUT = """\
#include "live.h"
void live_read({name}_in_t *in) {{
    in->reference = 0;
    in->measurement = 0;
}}
void live_write(const {name}_out_t *out) {{
    (void)out;
}}
"""


def test_a_period_that_cannot_be_timed_is_refused() -> None:
    program = lower(pid(FULL), "float32")
    with pytest.raises(CodegenError, match="target host has no UART to watch it by"):
        live_firmware(program, emit(program, "test"), load_target("host"), {})
    with pytest.raises(CodegenError, match=r"is called live\.c, as the image's own is"):
        live_firmware(program, emit(program, "test"), TARGET, {"live.c": ""})
