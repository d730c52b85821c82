"""What the study could only claim about a Cortex-M4: generated controllers, run on an emulated one and counted."""

from __future__ import annotations

from examples.audit_table import Row, compared, implied, stated
from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.design.kinds import kinds
from firmloop.identify.simulation.compiler import ToolError
from firmloop.quantize.lower.lower import lower
from firmloop.verify.link import LinkError
from firmloop.verify.run import verify

TARGET, STEPS, CLOCK = "qemu_mps2_an386", 2_000, 84e6  # instructions of a Cortex-M4F; clock of a common one, Hz


def rows() -> list[Row]:
    """Return the rows; without the cross compiler or the emulator they say so."""
    try:
        sliding, pid, monitor = (_instructions(name) for name in ("sliding_mode", "pid", "start_monitor"))
    except (ToolError, LinkError) as error:
        return [stated("discussion", "cost on a Cortex-M4", "68 % less, FPGA", f"not measured here: {error}")]
    state = 4 * len(kinds()["start_monitor"].design(kinds()["start_monitor"].example).law.state)
    return [
        compared(
            "discussion",
            "complexity saved against sliding mode, which needs an FPGA",
            "68",
            "%",
            lambda: 100 * (1 - pid / sliding),
            f"in float32 a sliding mode with boundary layer takes {sliding} instructions a sample, a PID {pid}; at "
            f"1 kHz that is {100 * sliding * 1e3 / CLOCK:.2f} % of a Cortex-M4F at 84 MHz, one instruction a cycle",
        ),
        implied(
            "limitations",
            "Cortex-M4 cost of Monte Carlo on line",
            "left open",
            lambda: f"{monitor} instructions, {state} B",
            "start_monitor in float32, one draw a sample: at most so many instructions and bytes of state",
        ),
    ]


def _instructions(name: str) -> int:
    """Count the most instructions a sample that the example of a kind takes."""
    kind = kinds()[name]
    law = kind.design(kind.example).law
    program = lower(law, "float32")
    bundle = emit(program, "examples")
    verdict = verify(law, program, bundle, load_target(TARGET), (), STEPS, 1, None, lambda share, label: None)
    if not verdict.agrees or verdict.cost.instructions_max is None:
        raise LinkError(f"{name} differs from its reference")
    return int(verdict.cost.instructions_max)
