"""Read server-sent events as a page does, without a browser."""

from __future__ import annotations

import base64
import json
import urllib.error
import urllib.request
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

PATIENCE = 60.0  # s


def events(url: str, begin: int, headers: dict[str, str] | None = None) -> Iterator[tuple[str, dict]]:
    """Yield kind and content of each event until the stream ends; closing the iterator closes the browser."""
    request = urllib.request.Request(f"{url}events?begin={begin}", headers=headers or {})
    with urllib.request.urlopen(request, timeout=PATIENCE) as stream:
        kind = ""
        for line in stream:
            key, _, rest = line.decode().rstrip("\n").partition(": ")
            if key == "event":
                kind = rest
            elif key == "data":
                yield kind, json.loads(rest)


def numbers(told: dict, wide: int) -> NDArray[np.float64]:
    """Return the rows of an event."""
    return np.frombuffer(base64.b64decode(told["rows"]), "<f8").reshape(-1, wide)


def ask(url: str, body: object = None, headers: dict[str, str] | None = None) -> tuple[int, str, dict[str, str]]:
    """Get, or post what is not None; return status, text and headers."""
    data = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(url, data, headers or {})
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE) as reply:
            return reply.status, reply.read().decode(), dict(reply.headers)
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode(), dict(error.headers)
