"""A scope gives every sample to the page and to the recording, sets what is within its range, and ends in order."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

from bench.links.live import TARGET, running
from bench.links.scope import PROJECT, SIGNALS, Running, scoping
from firmloop.cli import main
from firmloop.commands.scope import SPELLINGS as OFFERED
from firmloop.identify.recordings.recording import Recording, read_recording
from firmloop.project.project import read_project
from firmloop.scope.lines import SPELLINGS
from firmloop.stages.board.monitoring import program_of
from tests.firmloop.scope.sse import ask, events, numbers

WIDE = 1 + len(SIGNALS)
PERIOD = 0.001  # s


def collected(url: str, begin: int = 0) -> tuple[np.ndarray, list[dict], str]:
    """Read a page's events to their end: the rows, what else the events told, and how the watch ended."""
    parts, told, over = [], [], ""
    for kind, content in events(url, begin):
        if kind == "over":
            over = content["says"]
        else:
            parts.append(numbers(content, WIDE))
            told.append(content)
    return np.concatenate(parts), told, over


def as_numbers(recording: Recording) -> np.ndarray:
    return np.column_stack([np.round(recording.time / PERIOD), *recording.columns.values()])


@pytest.mark.qemu
def test_every_sample_sent_is_in_the_page_and_in_the_recording(tmp_path: Path) -> None:
    """Where the machine stands still long enough samples are lost, and are counted: then once more."""
    for attempt in range(10):
        (tmp_path / str(attempt)).mkdir()
        with scoping(tmp_path / str(attempt), "--seconds", "4", "--lines", "teleplot") as scope:
            rows, told, over = collected(scope.url)
            assert scope.process.wait(60) == 0
        if not told[-1]["missing"]:
            break
    assert over == "the watch has ended"
    assert [content["begin"] for content in told] == np.cumsum(
        [0, *(len(numbers(content, WIDE)) for content in told)][:-1]
    ).tolist()
    np.testing.assert_array_equal(rows[:, 0], np.arange(len(rows)))
    recording = read_recording(scope.file, {})
    assert len(recording.time) == 4000
    np.testing.assert_array_equal(rows[:4000], as_numbers(recording))
    lines = [line for line in scope.said().splitlines() if line.startswith(">")]
    assert len(lines) >= 4000 * len(SIGNALS)
    output = [line.split("§")[0].split(":") for line in lines if line.startswith(">output:")][:4000]
    assert [float(value) for _, _, value in output] == recording.columns["voltage_V"].tolist()
    assert [float(time_ms) for _, time_ms, _ in output] == pytest.approx(recording.time * 1e3)


@pytest.mark.qemu
def test_ctrl_c_keeps_the_recording(tmp_path: Path) -> None:
    with scoping(tmp_path) as scope:
        rows = next(content for _, content in events(scope.url, 0) if content["begin"] > 100)
        assert scope.stop() == 0
    assert len(read_recording(scope.file, {}).time) > rows["begin"]
    assert "samples of reference" in scope.said() and scope.told().count("firmloop:") == 0


@pytest.mark.qemu
def test_a_port_that_goes_ends_with_a_sentence_and_keeps_the_recording(tmp_path: Path) -> None:
    (tmp_path / "tank.toml").write_text(PROJECT)
    program = program_of(read_project(tmp_path / "tank.toml"), "scope").program
    with running(program) as port:
        scoped = scoping(tmp_path, "--port", port)
        scope = scoped.__enter__()
        stream = events(scope.url, 0)
        begin = next(content for _, content in stream if content["begin"] > 100)["begin"]
    over = [content for kind, content in stream if kind == "over"]
    assert scope.process.wait(60) == 3
    scoped.__exit__(None, None, None)
    assert f"port {port}: it is gone or cannot be used" in over[0]["says"]
    assert "it is gone or cannot be used" in scope.told() and "seen.csv holds what came before" in scope.told()
    assert len(read_recording(scope.file, {}).time) > begin


@pytest.mark.qemu
def test_an_emulated_core_that_dies_is_told_in_its_own_words(tmp_path: Path) -> None:
    with scoping(tmp_path) as scope:
        stream = events(scope.url, 0)
        next(content for _, content in stream if content["begin"] > 100)
        children = Path(f"/proc/{scope.process.pid}/task/{scope.process.pid}/children").read_text().split()
        os.kill(int(children[0]), signal.SIGKILL)
        assert scope.process.wait(60) == 3
    assert f"the emulated core {TARGET.name}: QEMU ended with status -9" in scope.told()
    assert scope.file.exists()


@pytest.mark.qemu
def test_a_controller_behind_a_socket_is_watched(tmp_path: Path) -> None:
    (tmp_path / "tank.toml").write_text(PROJECT)
    program = program_of(read_project(tmp_path / "tank.toml"), "scope").program
    with running(program) as port, relayed(port) as url:
        with scoping(tmp_path, "--port", url, "--seconds", "0.5") as scope:
            rows, _, over = collected(scope.url)
            assert scope.process.wait(60) == 0
    assert over == "the watch has ended" and len(rows) >= 500
    assert len(read_recording(scope.file, {}).time) == 500


@contextmanager
def relayed(terminal: str) -> Iterator[str]:
    """Give the address of a socket that stands for a terminal, as a serial server's does."""
    line = os.open(terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(line)

    def relay(listener: socket.socket) -> None:
        with suppress(OSError):
            far, _ = listener.accept()
            with far:
                while True:
                    for ready in select.select([far, line], [], [])[0]:
                        data = far.recv(4096) if ready is far else os.read(line, 4096)
                        if not data:
                            return
                        os.write(line, data) if ready is far else far.sendall(data)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=relay, args=(listener,), daemon=True)
        thread.start()
        yield f"socket://127.0.0.1:{listener.getsockname()[1]}"
        listener.close()
    thread.join(5.0)
    os.close(line)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ([], "--live: is missing: on qemu_mps2_an386 the controller needs its two functions"),
        (["--live", "tank.c", "--port", "nowhere"], "--live tank.c: is for an emulated core, but --port nowhere"),
        (["--target", "nucleo_f401re"], "--port: is missing, and target nucleo_f401re is no emulated core"),
        (["--signals", "speed", "--port", "nowhere"], "--signals speed: is no signal of tank"),
        (["--live", "no.c"], "--live no.c: cannot be read"),
    ],
)
@pytest.mark.parametrize("verb", ["scope", "monitor"])
def test_what_is_missing_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], verb: str, asked: list[str], words: str
) -> None:
    (tmp_path / "tank.toml").write_text(PROJECT)
    command = [verb, str(tmp_path / "tank.toml"), "--out", str(tmp_path / "no.csv"), "--target", TARGET.name, *asked]
    assert main(command) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "no.csv").exists()


def test_every_spelling_is_offered() -> None:
    assert set(OFFERED) == set(SPELLINGS)


@pytest.fixture(scope="module")
def scope(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A scope that runs from here to the end of this file: its emulated core takes a processor as long as it does."""
    with scoping(tmp_path_factory.mktemp("scope")) as running_scope:
        next(content for _, content in events(running_scope.url, 0) if content["begin"])  # samples have come
        yield running_scope
        assert running_scope.stop() == 0
        assert "internal error" not in running_scope.told()


@pytest.mark.qemu
def test_a_setting_moves_the_parameter_on_the_target(scope: Running) -> None:
    status, text, _ = ask(f"{scope.url}set", {"name": "kp", "value": 0.125})
    done = json.loads(text)
    assert (status, done["name"], done["value"]) == (200, "kp", 0.125)
    kp = 1 + SIGNALS.index("kp")
    before, at = None, round(done["time_s"] / PERIOD)
    for kind, content in events(scope.url, max(0, at - 50)):
        assert kind == "rows"
        for row in numbers(content, WIDE):
            if row[0] >= at:
                assert row[kp] == 0.125 and content["now"]["kp"] == 0.125
                break
            before = row[kp]
        else:
            continue
        break
    assert before == np.float32(0.05)


@pytest.mark.qemu
@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"name": "kp", "value": 0.201}, "kp=0.201: is beyond its proven range, 0 to 0.2 V/degC; to go there, widen"),
        ({"name": "kp", "value": -1e-9}, "is beyond its proven range"),
        ({"name": "kd", "value": 0.1}, "kd: is no tunable parameter of tank; tunable: kp, ki, u_max, u_min"),
        ({"name": "kp", "value": float("nan")}, "kp=nan: is no number"),
        ({"name": "kp", "value": "high"}, 'a setting is {"name": "kp", "value": 1.2}'),
        ([1], 'a setting is {"name": "kp", "value": 1.2}'),
        (b"\xff{", 'a setting is {"name": "kp", "value": 1.2}'),
        (b"9" * 2000, 'a setting is {"name": "kp", "value": 1.2}'),
    ],
)
def test_what_cannot_be_set_is_refused_with_a_sentence(scope: Running, body: object, words: str) -> None:
    status, text, _ = ask(f"{scope.url}set", body)
    assert status == 400 and words in json.loads(text)["error"]
    assert scope.process.poll() is None


@pytest.mark.qemu
def test_only_this_page_on_this_machine_is_answered(scope: Running) -> None:
    status, page, headers = ask(scope.url)
    assert status == 200 and "<canvas" in page
    assert (
        "default-src 'none'" in headers["Content-Security-Policy"] and "http" not in headers["Content-Security-Policy"]
    )
    assert not any(name.lower().startswith("access-control") for name in headers)
    root = scope.url.rsplit("/", 2)[0]
    own = root.removeprefix("http://")
    setting = {"name": "ki", "value": 1.0}
    for url, headers in (
        (f"{root}/set", {}),
        (f"{root}/AAAAAAAAAAAAAAAAAAAAAA/set", {}),
        (f"{scope.url}set", {"Origin": "http://example.com"}),
        (f"{scope.url}set", {"Origin": "null"}),
        (f"{scope.url}set", {"Sec-Fetch-Site": "cross-site"}),
        (f"{scope.url}set", {"Host": "example.com"}),
        (f"{scope.url}set", {"Host": "["}),
    ):
        assert ask(url, setting, headers)[0] == 403, (url, headers)
    assert ask(f"{root}/")[0] == 403 and ask(root)[0] == 403
    assert ask(f"{scope.url}other")[0] == 404 and ask(f"{scope.url}other", setting)[0] == 404
    assert ask(f"{scope.url}set", setting, {"Origin": f"http://{own}", "Sec-Fetch-Site": "same-origin"})[0] == 200


@pytest.mark.qemu
def test_a_browser_that_closes_ends_nothing_and_one_that_was_cut_off_goes_on(scope: Running) -> None:
    first = events(scope.url, 0)
    told = [content for _, content in takewhile(lambda event: event[1]["begin"] < 200, first)]
    first.close()
    at = told[-1]["begin"] + len(numbers(told[-1], WIDE))
    time.sleep(2.5)  # long enough for the server to find out
    again = events(scope.url, 0, {"Last-Event-ID": str(at)})
    kind, content = next(again)
    again.close()
    assert kind == "rows" and content["begin"] == at
    assert scope.process.poll() is None


@pytest.mark.qemu
def test_what_is_shown_can_be_saved(scope: Running, tmp_path: Path) -> None:
    kind, content = next(event for event in events(scope.url, 0) if event[1]["begin"] > 300)
    assert kind == "rows"
    status, text, headers = ask(f"{scope.url}recording.csv?begin=100&end=300")
    assert status == 200 and headers["Content-Type"].startswith("text/csv")
    (tmp_path / "view.csv").write_text(text)
    saved = read_recording(tmp_path / "view.csv", {})
    _, content = next(events(scope.url, 100))
    np.testing.assert_array_equal(as_numbers(saved)[:, 1:], numbers(content, WIDE)[:200, 1:])
    assert (len(saved.time), saved.time[0]) == (200, 0.0)
    status, text, _ = ask(f"{scope.url}recording.csv?begin=900000000&end=900000001")
    assert status == 400 and "there are none" in json.loads(text)["error"]


@pytest.mark.qemu
def test_a_page_port_that_is_taken_is_told(scope: Running, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tank.toml").write_text(PROJECT)
    taken = scope.url.split(":")[2].split("/")[0]
    program = program_of(read_project(tmp_path / "tank.toml"), "scope").program
    with running(program) as port:
        command = ["scope", str(tmp_path / "tank.toml"), "--target", TARGET.name, "--port", port]
        assert main([*command, "--page-port", taken, "--out", str(tmp_path / "no.csv")]) == 2
    assert f"--page-port {taken}: cannot be used" in capsys.readouterr().err
    assert not (tmp_path / "no.csv").exists()
