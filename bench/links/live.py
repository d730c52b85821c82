"""Watch a controller at 1 kHz for 60 s of its time over an emulated UART: `python -m bench.links.live [--seconds 60]`.

Four signals, as 32-bit floats. The exit status is 0 if no sample was lost and no step late.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import live_firmware
from firmloop.codegen.target import Qemu, load_target
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.stages.board.taking import Extent, never, schedule, take
from firmloop.stages.board.tape import Seen, Setting, Tape
from firmloop.verify.build.image import build_image
from firmloop.verify.links.live import LiveLink, open_live_port
from firmloop.verify.links.pty import start_on_terminal
from tests.laws import FULL, pid

# 32 ns an instruction: about what the emulated 25 MHz would give, where the counting of instructions takes 256 ns.
TARGET = replace(load_target("qemu_mps2_an386"), qemu=Qemu("mps2-an386", 5))
SIGNALS = ("reference", "measurement", "output", "status")

# A tank that the controller heats: it follows its input with gain 40 and time constant 0.1 s.
TANK = """\
#include "live.h"
static float level;
static uint32_t count;
void live_read({name}_in_t *in) {{
    in->reference = ((count / 1000U) % 2U == 0U) ? 60.0F : -25.0F;
    in->measurement = level;
    count++;
}}
void live_write(const {name}_out_t *out) {{
    level = level + 0.01F * (40.0F * out->output - level);
}}
"""


@contextmanager
def running(program: Program) -> Iterator[str]:
    """Run the live image; give the path of its port."""
    with tempfile.TemporaryDirectory() as folder:
        own = {"tank.c": TANK.format(name=program.name)}
        files = live_firmware(program, emit(program, "firmloop flash bench.toml"), TARGET, own)
        process, port = start_on_terminal(TARGET, build_image(files, TARGET, Path(folder)).elf)
        try:
            yield port
        finally:
            process.stop()


def stream(link: LiveLink, names: tuple[str, ...], every: int, steps: int, settings: Sequence[Setting] = ()) -> Seen:
    """Take samples over so many steps."""
    tape = Tape(every)
    take(link, Extent(names, every, steps), tape, schedule(settings), never, lambda share, doing: None)
    return tape.seen(steps)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the controller's time")
    arguments = parser.parse_args()
    program = lower(pid(FULL), "float32")
    with running(program) as port, open_live_port(TARGET, port, program) as link:
        before, begin = link.state(), time.perf_counter()
        seen = stream(link, SIGNALS, 1, round(arguments.seconds / program.period))
        wall, after = time.perf_counter() - begin, link.state()
    print(
        f"{len(seen.rows):,} samples of {len(SIGNALS)} signals at {1 / program.period:g} Hz, {wall:.1f} s of wall; "
        f"lost: {seen.lost_in_image} in the image, {seen.lost_on_line} on the line; "
        f"late steps: {after.late - before.late} of {after.steps - before.steps:,}"
    )
    return int(seen.lost_in_image + seen.lost_on_line + after.late - before.late > 0)


if __name__ == "__main__":
    raise SystemExit(main())
