"""Ask numerical libraries, before they are loaded, for kernels that every processor with AVX2 has.

Left alone they take the widest that a processor has. Those add in another order and so round otherwise, and a search of
a million steps may end elsewhere: a recording that is explained on one machine was unknown on the next.
"""

from __future__ import annotations

import os
import re
from collections.abc import MutableMapping
from importlib.util import find_spec
from pathlib import Path

_WIDER = (  # what numpy calls those beyond AVX2, and from which release on
    ((2, 4), "X86_V4 AVX512_ICL AVX512_SPR"),
    ((0, 0), "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR"),
)
_ABOUT = Path("/proc/cpuinfo")


def settle(environment: MutableMapping[str, str] = os.environ) -> None:
    """Write what numpy and OpenBLAS read when they are loaded; what the user has written there stays.

    Nothing for processors that are known to have no AVX2, or not known to have it: each kind rounds as it does.
    """
    environment.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small here: threads only wait for each other
    if not _has_avx2():
        return
    environment.setdefault("OPENBLAS_CORETYPE", "Haswell")
    release = _release()
    wider = next((names for first, names in _WIDER if release >= first), "")
    environment.setdefault("NPY_DISABLE_CPU_FEATURES", wider)


def _release() -> tuple[int, ...]:
    """Return the release of numpy that would be loaded, without loading it; () where there is none."""
    found = find_spec("numpy")
    try:
        text = Path(str(found and found.origin)).with_name("version.py").read_text(encoding="utf-8")
    except OSError:
        return ()
    told = re.search(r"^version = \"(\d+)\.(\d+)", text, re.MULTILINE)
    return tuple(map(int, told.groups())) if told else ()


def _has_avx2() -> bool:
    try:
        return " avx2 " in _ABOUT.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
