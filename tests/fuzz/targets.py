"""Five doors that strangers' bytes come in by, each with what it may answer: a result or one of our own errors."""

from __future__ import annotations

import contextlib
import gzip
import io
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np
import scipy.io
from hypothesis import strategies as st

from firmloop.cli import main
from firmloop.identify.error import IdentifyError
from firmloop.identify.plants.expression import read_expression
from firmloop.identify.recordings.recording import read_recording
from firmloop.verify.links.frame import FrameError, seal, stuff, unseal, unstuff
from tests.fuzz.benches import heat, odd_benches
from tests.fuzz.projects import odd_projects

KNOWN = {name: ca.SX.sym(name) for name in ("x_m", "v_m_s", "k_N_m", "m_kg")}
WORDS = (*KNOWN, "sqrt", "exp", "log", "sin", "tan", "min", "max", "abs", "sign", "lambda", "__import__", "os", "if")
SIGNS = (*"+-*/(),.[]:= \né", "**", "1", "2.5", "1e400", "0x1F", "1j")
CELLS = (*"01x-\0\xff٣ ", "0.1", "0.2", "-1e300", "nan", "inf", "", '"1"', "1,5", "1e400", "1_0")


@dataclass(frozen=True, slots=True)
class Target:
    """What is drawn, and what is done with it; a fault is any exception, or the exit status of a fault of ours."""

    draw: st.SearchStrategy[Any]
    attempt: Callable[[Any], None]
    in_tests: int  # cases


def expression(text: str) -> None:
    """Read an equation."""
    with contextlib.suppress(IdentifyError):
        read_expression(text, KNOWN, "plant.derivatives.x_m")


def frame(block: bytes) -> None:
    """Read a message, and take one apart that was put together."""
    with contextlib.suppress(FrameError):
        unseal(block.replace(b"\0", b""), 7)
    assert unstuff(stuff(block)) == block
    assert unseal(seal(2, 3, block, 7)[:-1], 7) == (2, 3, block)


def recording(file: tuple[str, bytes]) -> None:
    """Read a recording of any format."""
    name, content = file
    with TemporaryDirectory(prefix="fuzz.") as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        with contextlib.suppress(IdentifyError), np.errstate(all="ignore"):
            read_recording(path, {})


def project(text: str) -> None:
    """Read a project whole, and design its controller where no plant asks for a search."""
    with TemporaryDirectory(prefix="fuzz.") as folder:
        path = Path(folder) / "x.toml"
        path.write_text(text, encoding="utf-8")
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            said = io.StringIO()
            with contextlib.redirect_stderr(said):
                status = main(["excite" if "[plant]" in text else "design", str(path), "--out", f"{folder}/out"])
        assert status in (0, 2, 3), said.getvalue()


def bench(asked: tuple[str, str]) -> None:
    """Run a verb of the bench on a project beside a recording."""
    verb, text = asked
    with TemporaryDirectory(prefix="fuzz.") as folder:
        path = Path(folder) / "x.toml"
        path.write_text(text, encoding="utf-8")
        (path.parent / "heat.csv").write_text(heat())
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            said = io.StringIO()
            with contextlib.redirect_stderr(said):
                status = main([verb, str(path), "--out", f"{folder}/out"])
        assert status in (0, 1, 2, 3), said.getvalue()


@st.composite
def odd_recordings(draw: st.DrawFn) -> tuple[str, bytes]:
    """Draw a file that is nearly one of the formats we read."""
    name = draw(st.sampled_from(("r.csv", "r.csv.gz", "r.npz", "r.mat", "r.parquet")))
    if name == "r.csv":
        cells = st.lists(st.sampled_from(CELLS), min_size=1, max_size=4)
        rows = [["time_s", "voltage_V"], *draw(st.lists(cells, max_size=8))]
        mark, end = draw(st.sampled_from(",;\t")), draw(st.sampled_from(("\n", "\r\n", "\r")))
        return name, end.join(mark.join(row) for row in rows).encode("latin-1", "replace")
    content = bytearray(_sound(name))
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(content) - 1))
        content[at] = draw(st.integers(0, 255))
    return name, bytes(content[: draw(st.sampled_from((None, len(content) // 2, len(content) - 1, 0)))])


def _sound(name: str) -> bytes:
    time = np.arange(5.0)
    buffer = io.BytesIO()
    if name == "r.csv.gz":
        return gzip.compress(b"time_s,voltage_V\n0,1\n1,2\n2,3\n", mtime=0)
    if name == "r.npz":
        np.savez_compressed(buffer, time_s=time, voltage_V=time)
    else:
        scipy.io.savemat(buffer, {"time_s": time, "voltage_V": time}, do_compression=name == "r.mat")
    return buffer.getvalue()


TARGETS: Mapping[str, Target] = {
    "expression": Target(st.lists(st.sampled_from(WORDS + SIGNS), max_size=24).map("".join), expression, 500),
    "frame": Target(st.binary(max_size=600), frame, 500),
    "recording": Target(odd_recordings(), recording, 500),
    "project": Target(odd_projects(), project, 500),
    "bench": Target(odd_benches(), bench, 150),
}
