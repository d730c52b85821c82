"""Every measurement tells what it measures when it is asked for help, and starts nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__"): path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "bench").rglob("*.py"))
}
MODULES = sorted(name for name, text in FILES.items() if '__name__ == "__main__"' in text)
PARSING = [name for name in MODULES if "ArgumentParser(" in FILES[name]]  # with their libraries loaded, see bench
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}

# Loads once what most of them import; then runs each in a process of its own, as `python -m` does.
FORKED = """
import os, runpy, sys
import casadi, numpy, scipy.linalg, scipy.optimize
import firmloop.codegen.emit, firmloop.stages.plant, firmloop.stages.proving, firmloop.verify.run, tests.laws
for name in sys.argv[2:]:
    child = os.fork()
    if child == 0:
        for descriptor, ending in ((1, "out"), (2, "err")):
            os.dup2(os.open(f"{sys.argv[1]}/{name}.{ending}", os.O_WRONLY | os.O_CREAT), descriptor)
        sys.argv = [name, "--help"]
        runpy.run_module(name, run_name="__main__", alter_sys=True)
        sys.exit(0)
    print(name, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


def wrong(module: str, status: int, out: str, err: str) -> str:
    """Return what is wrong with the help of a module; nothing where it is sound."""
    sound = status == 0 and not err and len(out) > 40
    return "" if sound else f"{module}: {status} {out[:80]} {err[-300:]}"


def asked(module: str, flag: str = "--help") -> str:
    words = [sys.executable, "-m", module, flag]
    done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    return wrong(f"{module} {flag}", done.returncode, done.stdout, done.stderr)


def test_every_measurement_answers_for_help(tmp_path: Path) -> None:
    assert len(MODULES) > 50 and len(PARSING) > 10
    with ThreadPoolExecutor(2) as pool:
        assert not [*filter(None, pool.map(asked, sorted({*MODULES} - {*PARSING})))]
    words = [sys.executable, "-c", FORKED, str(tmp_path), *PARSING]
    done = subprocess.run(words, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    ended = dict(line.split() for line in done.stdout.splitlines())
    assert sorted(ended) == PARSING
    outputs = {name: [(tmp_path / f"{name}.{ending}").read_text() for ending in ("out", "err")] for name in PARSING}
    assert not [*filter(None, (wrong(name, int(ended[name]), *outputs[name]) for name in PARSING))]


def test_the_short_flag_asks_for_help_too() -> None:
    assert not asked("bench.host.power_loss", "-h")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["bench.host.fuzz", "1", "1", "window"], "'window' is no door; there are expression, frame"),
        (["bench.host.power_loss", "fly"], "'fly' is no verb that is swept; there are simulate"),
        (["bench.host.kills", "fly"], "'fly' is no verb that is killed; there are simulate"),
    ],
)
def test_a_name_that_a_bench_does_not_know_is_told_with_those_it_does(words: list[str], said: str) -> None:
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith(said), done.stderr
