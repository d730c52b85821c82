"""The compilers, emulators and flags that a target's file may ask for; whatever else it asks for is refused by name.

A target's file comes with a project, and a project may be a stranger's. A compiler's command line runs programs
(-specs, -B, -wrapper, -fplugin) and reads or writes any file (@file, -include, -o): flags are chosen here one by one.
"""

from __future__ import annotations

import re

COMPILERS = ("gcc", "arm-none-eabi-gcc", "riscv64-unknown-elf-gcc")
EMULATORS = ("qemu-system-arm", "qemu-system-riscv32")

_NAME = r"[a-z0-9]+(?:[._+-][a-z0-9]+)*"  # of a core or an architecture, with its extensions: armv7e-m+fp
VALUED = {
    "-march=": _NAME,
    "-mcpu=": _NAME,
    "-mtune=": _NAME,
    "-mfpu=": _NAME,
    "-mabi=": _NAME,
    "-mcmodel=": "tiny|small|medium|large|medlow|medany",
    "-mfloat-abi=": "soft|softfp|hard",
    "-mfpmath=": "sse",
    "-msmall-data-limit=": "[0-9]{1,6}",
    "-O": "[0-3sg]",
}
# None of these lets floating point round another way: the reference rounds after every operation. The one file of specs
# is the C library's own, which the compiler finds in its folders by that name.
PLAIN = frozenset(
    """
    --specs=picolibc.specs
    -mthumb -mlittle-endian -munaligned-access -mno-unaligned-access -mslow-flash-data -mpure-code -mlong-calls
    -mword-relocations -mcmse -mfix-cortex-m3-ldrd -mstrict-align -mno-strict-align -mrelax -mno-relax -msave-restore
    -mno-save-restore -m32 -m64 -msse2
    -fcommon -fno-common -fshort-enums -fno-short-enums -fjump-tables -fno-jump-tables -fno-strict-aliasing -fwrapv
    -fomit-frame-pointer -fno-omit-frame-pointer -fno-inline -fno-inline-functions -fno-unroll-loops -fno-ivopts
    -fno-tree-vectorize -fno-tree-slp-vectorize -fno-tree-loop-distribute-patterns -fno-move-loop-stores
    -fno-schedule-insns -fno-schedule-insns2 -fno-gcse -fno-ipa-sra -ffp-contract=off
    """.split()
)
FLAG_RULE = (
    "is not a plain compiler flag such as '-mcpu=cortex-m4': leave it out; a target may ask for "
    f"{' '.join(VALUED)} and named ones such as -mthumb (codegen/toolchain.py lists them)"
)
SOURCE_RULE = "names a .c file in the folder of the target's own, by letters, digits, '_', '-' and '.'"


def is_flag(flag: str) -> bool:
    """Say whether a target may ask for this compiler flag."""
    return flag in PLAIN or any(
        flag.startswith(name) and re.fullmatch(value, flag.removeprefix(name)) for name, value in VALUED.items()
    )


def is_source_name(name: str) -> bool:
    """Say whether a C file of the user's may be called so: the name stands in a command line and in a Makefile."""
    return re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\.c", name) is not None
