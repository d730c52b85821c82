"""Look into the searches of a run: which limits were active, how much work each took, and what its budget bounds.

The work of a search is counted as `quantize/twins/qp.py` says. An instruction of the target is bounded by
what it takes without a search, and the most that one unit of work took in the hardest steps seen, times the budget and
what a search may take beyond it before it notices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from firmloop.quantize.formats.quadratic import rows_of
from firmloop.quantize.program import Program
from firmloop.quantize.twins.qp import solve
from firmloop.verify.block import Block
from firmloop.verify.reference import Machine, Raw, Trace, working_type
from firmloop.verify.verdict import Searches

SHOWN = 240  # steps about the hardest one, of its lane
HARDEST = 600  # steps that tell what a unit of work takes


def searches(
    program: Program, blocks: Sequence[Block], traces: Sequence[Trace], counts: NDArray[np.int64]
) -> Searches | None:
    """Return what the searches did; None for a program without any. `counts` are the instructions of each step."""
    place = next((k for k, op in enumerate(program.body) if op.function == "solve"), None)
    if place is None:
        return None
    rows = rows_of(program.tables[0], working_type(program))
    inputs = np.concatenate([block.inputs.reshape(-1, len(program.inputs)) for block in blocks])
    state = np.concatenate([trace.state.reshape(-1, len(program.state)) for trace in traces])
    status = np.concatenate([trace.status.ravel() for trace in traces])
    bits = {bit.name: bit.bit for bit in program.status}
    capped, infeasible = (
        status >> bits[name] & 1 if name in bits else np.zeros_like(status) for name in ("capped", "infeasible")
    )
    low, high = (np.array([getattr(value, end) for value in program.inputs]) for end in ("low", "high"))
    within = np.all((inputs >= low) & (inputs <= high), axis=1)
    worst = int(counts.argmax())
    shown = _around(worst, blocks)
    chosen = np.concatenate([shown, np.argsort(-counts, kind="stable")[:HARDEST], [int(counts.argmin())]])
    parameters = _parameters(program, place, inputs[chosen], state[chosen])
    with np.errstate(all="ignore"):
        solution = solve(rows, parameters)
    took, searched = counts[chosen], solution.work > 0
    least = int(took[~searched].max(initial=int(counts.min())))
    unit = float(np.max((took - least)[searched] / solution.work[searched], initial=0.0))
    first = slice(0, len(shown))
    return Searches(
        begins=int(shown[0]),
        side=tuple(tuple(int(x) for x in row) for row in solution.side[first]),
        work=tuple(int(x) for x in solution.work[first]),
        instructions=tuple(int(x) for x in took[first]),
        budget=rows.budget,
        work_max=int(solution.work.max(initial=0)),
        instructions_bound=int(np.ceil(least + unit * rows.longest)),
        capped=int(np.count_nonzero(capped)),
        infeasible=int(np.count_nonzero(infeasible)),
        within=int(np.count_nonzero(within & ((capped | infeasible) > 0))),
    )


def _around(step: int, blocks: Sequence[Block]) -> NDArray[np.int64]:
    """Return the steps of the lane that `step` is in, SHOWN at most; steps are counted through all lanes and blocks."""
    begins = 0
    for block in blocks:
        lanes, length, _ = block.inputs.shape
        if step < begins + lanes * length:
            first = begins + (step - begins) // length * length
            start = min(max(first, step - SHOWN // 2), max(first, first + length - SHOWN))
            return np.arange(start, min(start + SHOWN, first + length))
        begins += lanes * length
    raise AssertionError("a step of no block")


def _parameters(program: Program, place: int, inputs: Raw, state: Raw) -> Raw:
    """Return the parameters (steps, p) that the operation at `place` solves for."""
    asking = replace(program, body=program.body[:place], next_state=(), results=(), status=(), safe=())
    machine, kind = Machine(asking), working_type(program)
    with np.errstate(all="ignore"):
        slots = machine.step(list(inputs.T.astype(kind)), list(state.T.astype(kind)))
    named = machine.named(slots)
    _, *names = program.body[place].arguments
    found = [named[name] if isinstance(name, str) else kind.type(name) for name in names]
    return np.stack([np.broadcast_to(x, len(inputs)) for x in found], axis=-1)
