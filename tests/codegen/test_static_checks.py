"""The generated C needs no run to be judged: MISRA rules that are hit have their reason, and it needs no C library."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from pathlib import Path

import pytest

from firmloop.codegen.bundle import Bundle, write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.static_checks import CPPCHECK, read_statically


@cache
def bundle_of(kind: str, arithmetic: str) -> Bundle:
    found = kinds()[kind]
    return emit(lower(found.design(found.example).law, arithmetic), "firmloop generate project.toml")


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
@pytest.mark.parametrize(("kind", "arithmetic"), [("fuzzy_pid", "float32"), ("pid", "fixed16"), ("mpc", "float32")])
def test_every_misra_rule_that_is_hit_has_its_reason(kind: str, arithmetic: str) -> None:
    (reading,) = (each for each in read_statically(bundle_of(kind, arithmetic)) if each.tool == CPPCHECK)
    rules = [each for each in reading.findings if each.of_misra]
    assert rules and not reading.not_run
    assert not {each.rule for each in rules if not each.reason}


@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="arm-none-eabi-gcc is not installed")
@pytest.mark.parametrize("level", ["-O2", "-Os"])
@pytest.mark.parametrize("kind", kinds())
def test_no_kind_asks_the_c_library_for_anything(kind: str, level: str, tmp_path: Path) -> None:
    """Compilers make memset and memcpy of loops that clear and copy."""
    bundle = bundle_of(kind, "float32")
    write_files(bundle.files, tmp_path)
    flags = (*load_target("qemu_mps2_an386").flags, "-std=c99", "-ffp-contract=off", level)
    subprocess.run(["arm-none-eabi-gcc", *flags, "-c", *bundle.sources], cwd=tmp_path, check=True)
    objects = [path.name for path in tmp_path.glob("*.o")]
    said = subprocess.run(
        ["arm-none-eabi-nm", "-u", *objects], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert objects and " U " not in said.stdout
