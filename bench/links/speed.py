"""Measure how fast the lines to a controller in QEMU are: `python -m bench.links.speed`."""

from __future__ import annotations

import os
import struct
import tempfile
import time
from pathlib import Path

from firmloop.codegen.firmware import firmware
from firmloop.codegen.target import load_target
from firmloop.verify.build.image import build_image
from firmloop.verify.links.framed import FramedLink
from firmloop.verify.links.opener import openers
from tests.verify.tiny import tiny

TARGET = load_target("qemu_mps2_an386")
ROUNDS = 5  # the best one is told beside the median: the others shared the machine with something else
SECONDS = 1.0  # per round
ONE = struct.pack("<2f", 1.2345, -0.777)


def exchanges_per_second(link: FramedLink, steps: int) -> float:
    inputs = ONE * steps
    count = 0
    begin = time.perf_counter()
    while (elapsed := time.perf_counter() - begin) < SECONDS:
        for _ in range(10):
            link.step(inputs, steps)
        count += 10
    return count / elapsed


def measure(name: str) -> None:
    program, bundle = tiny(2.0)
    opener = openers()[name]
    with tempfile.TemporaryDirectory() as folder:
        image = build_image(firmware(program, bundle, TARGET, opener.transport), TARGET, Path(folder))
        for steps in (1, 64):
            rates = []
            for _ in range(ROUNDS):
                with opener.open(TARGET, image.elf, program.id) as link:
                    rates.append(exchanges_per_second(link, steps))
            rates.sort()
            best, median = rates[-1], rates[ROUNDS // 2]
            print(
                f"{name:12} frames of {steps:2}: {median:9,.0f} exchanges/s median, {best:9,.0f} best; "
                f"{median * steps:11,.0f} steps/s median, {best * steps:11,.0f} best"
            )


if __name__ == "__main__":
    print(f"load average {os.getloadavg()[0]:.2f} on {os.cpu_count()} processors")
    for link_name in openers():
        measure(link_name)
