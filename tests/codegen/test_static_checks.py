"""The C checker that is no test of numbers: MISRA C:2012 rules that are hit have their reason."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from bench.codegen.static import REASONS, misra
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.design.kinds import kinds
from firmloop.quantize.lower.lower import lower


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
@pytest.mark.parametrize(("kind", "arithmetic"), [("fuzzy_pid", "float32"), ("pid", "fixed16"), ("mpc", "float32")])
def test_every_misra_rule_that_is_hit_has_its_reason(kind: str, arithmetic: str, tmp_path: Path) -> None:
    found = kinds()[kind]
    bundle = emit(lower(found.design(found.example).law, arithmetic), "firmloop generate project.toml")
    write_files(bundle.files, tmp_path)
    assert set(misra(tmp_path, bundle.sources)) - set(REASONS) == set()
