"""Bash completes commands, their options and the values of these."""

from __future__ import annotations

import subprocess

import pytest

from firmloop.cli import main
from firmloop.commands import command_names


@pytest.fixture
def script(capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "wanted"),
    [
        ("ver", {"verify"}),
        ("", set(command_names())),
        ("export p.toml --o", {"--of", "--out"}),
        ("export p.toml --of ", {"controller", "plant"}),
        ("verify p.toml --target qemu_risc", {"qemu_riscv32"}),
        ("verify p.toml other", set()),  # which leaves it to the shell: file names
    ],
)
def test_bash_completes_what_is_typed(typed: str, wanted: set[str], script: str) -> None:
    words = ["firmloop", *typed.split(" ")]
    given = " ".join(f"'{word}'" for word in words)
    asked = (
        f"{script}\nCOMP_WORDS=({given}) COMP_CWORD={len(words) - 1}\n_firmloop\nprintf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == wanted and not done.stderr
