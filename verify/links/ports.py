"""Find the serial ports of this machine, and the boards that show such a port."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from serial.tools import list_ports

from firmloop.codegen.target import Target


@dataclass(frozen=True, slots=True)
class Port:
    """One serial port: what --port takes, its USB vendor:product (or empty), and what it calls itself."""

    device: str
    usb: str
    says: str


def find_ports() -> tuple[Port, ...]:
    """Ask the operating system; sorted by name."""
    found = []
    for info in list_ports.comports():
        usb = f"{info.vid:04x}:{info.pid:04x}" if info.vid is not None and info.pid is not None else ""
        words = (info.manufacturer, info.product, info.serial_number) if usb else (info.description,)
        found.append(Port(info.device, usb, " ".join(word for word in words if word and word != "n/a")))
    return tuple(sorted(found, key=lambda port: port.device))


def boards_at(port: Port, targets: Sequence[Target]) -> tuple[str, ...]:
    """Return the names of the targets whose boards show such a port; several boards carry the same probe."""
    return tuple(target.name for target in targets if port.usb and port.usb in target.usb)
