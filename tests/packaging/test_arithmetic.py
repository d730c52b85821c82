"""Every processor with AVX2 adds in the same order."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from firmloop import arithmetic

KERNELS = """
import json
from firmloop.arithmetic import settle
settle()
import numpy, scipy.linalg
from threadpoolctl import threadpool_info
from numpy._core._multiarray_umath import __cpu_features__ as known
blas = [each["architecture"] for each in threadpool_info() if each["internal_api"] == "openblas"]
print(json.dumps([blas, [name for name in known if known[name] and ("AVX512" in name or name == "X86_V4")]]))
"""
CPU = Path("/proc/cpuinfo")
WITH_AVX2 = CPU.is_file() and " avx2 " in CPU.read_text()


def kernels(**own: str) -> tuple[list[str], list[str]]:
    """Return which kernels OpenBLAS took in a new process, and which features beyond AVX2 numpy did."""
    unset = ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES")
    environment = {name: value for name, value in os.environ.items() if name not in unset} | own
    made = subprocess.run([sys.executable, "-c", KERNELS], env=environment, capture_output=True, text=True, check=True)
    blas, wider = json.loads(made.stdout)
    return blas, wider


@pytest.mark.skipif(not WITH_AVX2, reason="this processor is not known to have AVX2")
def test_no_kernel_is_wider_than_every_processor_with_avx2_has_it() -> None:
    blas, wider = kernels()
    if not blas:
        pytest.skip("numpy has no OpenBLAS here")
    assert set(blas) == {"Haswell"}
    assert not {"X86_V4", "AVX512_SKX"} & set(wider)


@pytest.mark.skipif(not WITH_AVX2, reason="this processor is not known to have AVX2")
def test_what_the_user_asks_for_stays() -> None:
    own = {"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "3"}
    blas, _ = kernels(**own)
    assert not blas or set(blas) == {"Nehalem"}
    arithmetic.settle(own)
    assert own["OPENBLAS_CORETYPE"] == "Nehalem" and own["OPENBLAS_NUM_THREADS"] == "3"


@pytest.mark.parametrize("about", ["flags : fpu sse4_2 avx\n", "Features : fp asimd\n", None])
def test_a_processor_of_another_kind_is_left_alone(
    about: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arithmetic, "_ABOUT", tmp_path / "cpuinfo")
    if about is not None:
        (tmp_path / "cpuinfo").write_text(about)
    written: dict[str, str] = {}
    arithmetic.settle(written)
    assert written == {"OPENBLAS_NUM_THREADS": "1"}
