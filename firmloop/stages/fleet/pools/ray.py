"""Diagnose on the workers of a Ray cluster, through its own client."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from typing import Any

from firmloop.codegen.emit import tool_version
from firmloop.identify.extras import ToolError, extra
from firmloop.stages.fleet.member import FleetTask
from firmloop.stages.fleet.pools.pool import Answer, Failed, Pool, Work, answered, passed_on

AHEAD = 2  # tasks under way for each processor: one to do, and the next


def ray(address: str) -> Pool:
    """Return the pool of a cluster at `address`, such as ray://host:10001 or auto."""
    return partial(_work, address)


def _work(address: str, work: Work, tasks: Iterable[FleetTask]) -> Iterator[tuple[FleetTask, Answer]]:
    library = extra("ray", "ray", "--ray")
    try:
        context = library.init(address=address, log_to_driver=False, logging_level="error")
    except (OSError, ValueError, RuntimeError) as error:
        words = " ".join(str(error).split())[:200]
        raise ToolError(f"--ray {address}: no cluster answers: {words}; start one with: ray start --head") from None
    try:
        _check(address, library)
        count = max(1, int(library.cluster_resources().get("CPU", 1)))
        remote, coming = library.remote(answered), iter(tasks)
        under_way = {remote.remote(work, task): task for task in islice(coming, AHEAD * count)}
        while under_way:
            (reference, *_), _ = library.wait(list(under_way), num_returns=1)
            task = under_way.pop(reference)
            under_way |= {remote.remote(work, further): further for further in islice(coming, 1)}
            yield task, passed_on(_answer(library, reference))
    finally:
        context.disconnect() if hasattr(context, "disconnect") else library.shutdown()


def _answer(library: Any, reference: Any) -> Answer | ToolError:
    try:
        found: Answer | ToolError = library.get(reference)
    except library.exceptions.RayError as error:
        words = " ".join(str(error).split())[:200]
        return Failed(f"no worker of the cluster could do it: {words}")
    return found


def _check(address: str, library: Any) -> None:
    """See that a worker has the firmloop of this process; each process of Ray is of the same environment."""
    own = tool_version()
    try:
        version = library.get(library.remote(tool_version).remote())
    except library.exceptions.RayError as error:
        words = " ".join(str(error).split())[:200]
        raise ToolError(f"--ray {address}: its workers do not know firmloop: {words}; install {own} there") from None
    if version != own:
        raise ToolError(f"--ray {address}: its workers have firmloop {version}, and this is {own}; install {own} there")
