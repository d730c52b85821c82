"""Build every real board's images and print what they take: `python -m bench.codegen.boards`.

Each is linked with every warning an error; its vector table and initial stack pointer are checked from the ELF file.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench.links.live import TANK
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import firmware, live_firmware
from firmloop.codegen.target import load_target, target_names
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.image import build_image
from tests.laws import FULL, pid

KINDS = ("verify", "monitor")


def main() -> None:
    program = lower(pid(FULL), "float32")
    bundle = emit(program, "firmloop generate bench.toml")
    own = {"tank.c": TANK.format(name=program.name)}
    print(f"{'board':20} {'core':14} {'image':8} {'flash':>6} {'RAM':>6} {'of it stack':>11}  step(): flash, stack")
    for name in target_names():
        target = load_target(name)
        if target.tested != "built":
            continue
        for kind in KINDS:
            files = (
                firmware(program, bundle, target, "uart")
                if kind == "verify"
                else live_firmware(program, bundle, target, own)
            )
            with tempfile.TemporaryDirectory() as folder:
                image = build_image(files, target, Path(folder))
            whole = image.whole
            print(
                f"{name:20} {target.core:14} {kind:8} {whole.text_bytes + whole.data_bytes:6} "
                f"{whole.data_bytes + whole.bss_bytes:6} {target.stack_bytes:11}  "
                f"{image.controller.text_bytes}, {'not known' if image.stack_bytes is None else image.stack_bytes}"
            )


if __name__ == "__main__":
    main()
