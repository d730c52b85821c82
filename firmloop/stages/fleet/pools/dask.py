"""Diagnose on the workers of a Dask cluster, through its own client."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from typing import Any

from firmloop.codegen.emit import tool_version
from firmloop.identify.extras import ToolError, extra
from firmloop.stages.fleet.member import FleetTask
from firmloop.stages.fleet.pools.pool import Answer, Failed, Pool, Work, answered, passed_on

AHEAD = 2  # tasks under way for each worker: one to do, and the next
PATIENCE = 10  # s that a scheduler has to answer
_ONE = threading.Lock()  # a worker may have many threads; the fit limits those of its whole process


def dask(address: str) -> Pool:
    """Return the pool of a cluster whose scheduler is at `address`, such as tcp://host:8786."""
    return partial(_work, address)


def _work(address: str, work: Work, tasks: Iterable[FleetTask]) -> Iterator[tuple[FleetTask, Answer]]:
    distributed = extra("distributed", "dask", "--dask")
    try:
        client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        words = " ".join(str(error).split())[:200]
        raise ToolError(f"--dask {address}: no scheduler answers: {words}; start one with: dask scheduler") from None
    with client:
        count = _checked(address, client)
        coming = iter(tasks)
        under_way = {_sent(client, work, task): task for task in islice(coming, AHEAD * count)}
        done = distributed.as_completed(list(under_way), loop=client.loop)
        for future in done:
            task = under_way.pop(future)
            for further in islice(coming, 1):
                sent = _sent(client, work, further)
                under_way[sent] = further
                done.add(sent)
            yield task, passed_on(_answer(future))


def _sent(client: Any, work: Work, task: FleetTask) -> Any:
    return client.submit(_alone, work, task, pure=False)


def _alone(work: Work, task: FleetTask) -> Answer | ToolError:
    with _ONE:
        return answered(work, task)


def _answer(future: Any) -> Answer | ToolError:
    """Return what a worker answered, or that none could, even though the scheduler has tried others."""
    if future.status == "finished":
        found: Answer | ToolError = future.result()
        return found
    words = " ".join(str(future.exception()).split())[:200] if future.status == "error" else future.status
    return Failed(f"no worker of the cluster could do it: {words}")


def _checked(address: str, client: Any) -> int:
    """Return how many workers there are; all of them have the firmloop of this process.

    Raises
    ------
    ToolError
        when there is none, or one has another version.
    """
    own = tool_version()
    try:
        versions = client.run(tool_version)
    except Exception as error:  # whatever a worker without firmloop makes of it
        words = " ".join(str(error).split())[:200]
        raise ToolError(f"--dask {address}: its workers do not know firmloop: {words}; install {own} there") from None
    if not versions:
        raise ToolError(f"--dask {address}: the cluster has no workers; start some with: dask worker {address}")
    for worker, version in sorted(versions.items()):
        if version != own:
            raise ToolError(
                f"--dask {address}: {worker} has firmloop {version}, and this is {own}; install {own} there"
            )
    return len(versions)
