"""`firmloop targets`: what can be built for."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from firmloop.console import Console, table

NAME = "targets"
HELP = "what can be built for"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Ask whether the serial ports are meant."""
    parser.add_argument("--ports", action="store_true", help="the serial ports of this machine instead")


def run(arguments: argparse.Namespace, console: Console) -> int:
    """Show every target, or every serial port and the boards that it may belong to."""
    return _ports(console) if arguments.ports else _targets(console)


def _targets(console: Console) -> int:
    from firmloop.codegen.target import load_target, target_names

    known = [load_target(name) for name in target_names()]
    ran = {"run": "run in the tests", "built": "only built and measured in the tests"}
    console.lines(table([(target.name, target.says, ran[target.tested]) for target in known]))
    told = ("name", "says", "core", "tested", "links")
    console.result("targets", [{key: getattr(target, key) for key in told} for target in known])
    return 0


def _ports(console: Console) -> int:
    from firmloop.codegen.target import load_target, target_names
    from firmloop.verify.links.ports import boards_at, find_ports

    known = [load_target(name) for name in target_names()]
    found = [(port, boards_at(port, known)) for port in find_ports()]
    console.lines(table([(port.device, port.usb or "-", port.says, ", ".join(boards)) for port, boards in found]))
    if not found:
        console.lines(["no serial port: is the board plugged in, and may you use it (group dialout)?"])
    console.result("ports", [{**asdict(port), "targets": list(boards)} for port, boards in found])
    return 0
