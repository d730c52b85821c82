"""Let a hundred boards lie to `verify` over a port, one by one: `python -m bench.links.lying [--seed N]`.

Each board speaks the protocol and runs the right C, but for its lie: a bit or a step of an answer is another one, a
reset or a step is left out or done twice, messages are short, of another session or program, or there is only noise.
One more tells the truth, and must agree. Prints a row a kind; the exit status is 1 where a lie agrees, a board hangs
the run, or it ends in anything but a verdict or a sentence.
"""

from __future__ import annotations

import argparse
import random
import socket
import struct
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from firmloop.codegen.emit import emit
from firmloop.codegen.target import load_target
from firmloop.quantize.lower.lower import lower
from firmloop.verify.build.host import build_host
from firmloop.verify.link import LinkError
from firmloop.verify.links.frame import (
    HELLO,
    NAK,
    PROTOCOL_VERSION,
    REPLY,
    RESET,
    STACK,
    STEP,
    FrameError,
    binding,
    seal,
    unseal,
)
from firmloop.verify.links.library import LibraryLink
from firmloop.verify.run import verify_on
from firmloop.verify.trial import try_out
from tests.laws import FULL, pid

STEPS = 2_000
FRAME = 8  # steps of one message
LONGEST = 60.0  # s that a liar may take before it counts as hanging the run


@dataclass(slots=True)
class Board:
    """The right C and what the board knows of its line; `steps` and `replies` count what it has done."""

    controller: LibraryLink
    sizes: tuple[int, int]
    program: bytes
    session: int = 0
    number: int = 0
    steps: int = 0
    replies: int = 0
    last: bytes = b""  # of the results
    dice: random.Random = field(default_factory=random.Random)


@dataclass(frozen=True, slots=True)
class Lie:
    """What a board does otherwise; each takes the board and what it would do, and returns what it does."""

    kind: str
    results: Callable[[Board, bytes, bytes], bytes] = lambda board, inputs, results: results
    told: Callable[[Board, int, bytes], bytes] = lambda board, kind, payload: payload  # the payload of a reply
    sent: Callable[[Board, int, bytes], bytes] = lambda board, kind, message: message  # the bytes on the line
    resets: Callable[[Board], bool] = lambda board: True


def record(board: Board) -> int:
    """Return the bytes of one step's answer."""
    return board.sizes[1] + 8


def wrong_bit(place: int, bit: int, offset: int) -> Lie:
    """Turn one bit of the answer to one step, `offset` 0 of the output and `sizes[1]` of the status."""

    def results(board: Board, inputs: bytes, answer: bytes) -> bytes:
        at = place - board.steps
        if not 0 <= at < len(answer) // record(board):
            return answer
        turned = bytearray(answer)
        turned[at * record(board) + offset + bit // 8] ^= 1 << bit % 8
        return bytes(turned)

    return Lie("a bit of an output" if offset == 0 else "a bit of the status word", results=results)


def reordered(place: int, shift: int) -> Lie:
    """Give the answer of another step at one step that differs from it."""

    def results(board: Board, inputs: bytes, answer: bytes) -> bytes:
        size = record(board)
        parts = [answer[k : k + size] for k in range(0, len(answer), size)]
        if board.steps <= place and len(parts) > shift and parts[0][: board.sizes[1]] != parts[shift][: board.sizes[1]]:
            parts[0], parts[shift] = parts[shift], parts[0]
        return b"".join(parts)

    return Lie("steps swapped", results=results)


def late() -> Lie:
    """Answer each message with what was the answer to the one before."""

    def results(board: Board, inputs: bytes, answer: bytes) -> bytes:
        before, board.last = board.last, answer
        return before if len(before) == len(answer) else answer

    return Lie("the answer before", results=results)


def other_inputs(first: int) -> Lie:
    """Run one message twice: the state goes on too far."""

    def results(board: Board, inputs: bytes, answer: bytes) -> bytes:
        return board.controller.step(inputs, len(inputs) // board.sizes[0]) if board.replies >= first else answer

    return Lie("steps done twice", results=results)


def constant(value: bytes) -> Lie:
    """Give every output one value."""

    def results(board: Board, inputs: bytes, answer: bytes) -> bytes:
        size = record(board)
        return b"".join(value + answer[k + board.sizes[1] : k + size] for k in range(0, len(answer), size))

    return Lie("one value", results=results)


def about(position: str, value: object) -> Lie:
    """Say something else in HELLO."""
    fields = ("session", "protocol", "in", "out", "most", "overhead", "program")

    def told(board: Board, kind: int, payload: bytes) -> bytes:
        if kind != HELLO:
            return payload
        said = list(struct.unpack("<IHHHHI16s", payload))
        said[fields.index(position)] = value
        return struct.pack("<IHHHHI16s", *said)

    return Lie("a false greeting", told=told)


def resized(change: int, of: int) -> Lie:
    """Make replies of one type longer or shorter."""

    def told(board: Board, kind: int, payload: bytes) -> bytes:
        return payload if kind != of else payload + bytes(change) if change > 0 else payload[:change]

    return Lie("a reply of another size", told=told)


def on_line(kind: str, change: Callable[[Board, int, bytes], bytes]) -> Lie:
    """Put something else on the line."""
    return Lie(kind, sent=change)


def lies(seed: int) -> list[Lie]:
    """Draw a hundred."""
    dice = random.Random(seed)
    made = [wrong_bit(dice.randrange(STEPS), bit, 0) for bit in range(32)]
    made += [wrong_bit(dice.randrange(STEPS), dice.randrange(32), 4) for _ in range(21)]
    made += [reordered(dice.randrange(STEPS // 2), shift) for shift in range(1, FRAME)]
    made += [late(), *(other_inputs(first) for first in (1, 5, 20, 50))]
    made += [constant(struct.pack("<I", word)) for word in (0, 1, 0x80000000, 0xFFFFFFFF)]
    made += [Lie("no reset", resets=lambda board: board.replies < 4)]
    made += [about("protocol", 1), about("protocol", 0xFFFF), about("in", 12), about("in", 0), about("out", 0)]
    made += [about("out", 8), about("most", 0), about("most", 0xFFFF), about("program", bytes(16)), about("session", 1)]
    made += [resized(change, of) for change in (-1, -4, 1, 4) for of in (STEP, STACK, HELLO)]
    made += [
        on_line("another session", lambda board, kind, message: _resealed(board, kind, board.session ^ 1)),
        on_line("another type", lambda board, kind, message: seal(0x42, board.number & 0xFF, b"", _bound(board))),
        on_line("silence", lambda board, kind, message: b"" if kind != HELLO else message),
        on_line("silence from the first", lambda board, kind, message: b""),
        on_line("noise", lambda board, kind, message: board.dice.randbytes(4000) if kind != HELLO else message),
        on_line("noise without an end", lambda board, kind, message: b"\1" * 400_000 if kind != HELLO else message),
        on_line("all refused", lambda board, kind, message: seal(NAK, 0, struct.pack("<BI", 1, 0), 0)),
        on_line("refused for no reason", lambda board, kind, message: seal(NAK, 0, struct.pack("<BI", 77, 0), 0)),
    ]
    assert len(made) == 100, len(made)
    return made


def _resealed(board: Board, kind: int, session: int) -> bytes:
    return seal(kind | REPLY, board.number & 0xFF, b"", 0 if kind == HELLO else binding(session, board.number))


def _bound(board: Board) -> int:
    return binding(board.session, board.number)


def served(line: socket.socket, board: Board, lie: Lie) -> None:
    """Answer until the line is closed."""
    waiting = b""
    while True:
        try:
            waiting += (data := line.recv(65536))
        except OSError:
            return
        if not data:
            return
        *blocks, waiting = waiting.split(b"\0")
        for block in filter(None, blocks):
            with_answer = _answer(board, lie, block)
            if with_answer:
                try:
                    line.sendall(with_answer)
                except OSError:
                    return


def _answer(board: Board, lie: Lie, block: bytes) -> bytes:
    """Do what a request asks, in the lie's way; return the bytes of the reply."""
    for number in (board.number, board.number + 1):
        try:
            kind, sequence, payload = unseal(block, binding(board.session, number))
        except FrameError:
            continue
        if kind != HELLO and sequence != number & 0xFF:
            continue
        board.number = number
        break
    else:
        return b""
    reply = b""
    if kind == HELLO:
        board.session, board.number = int.from_bytes(payload, "little"), 0
        reply = struct.pack("<IHHHHI16s", board.session, PROTOCOL_VERSION, *board.sizes, FRAME, 0, board.program)
    elif kind == RESET and lie.resets(board):
        board.controller.reset()
    elif kind == STEP:
        count = len(payload) // board.sizes[0]
        reply = lie.results(board, payload, board.controller.step(payload, count))
        board.steps += count
    elif kind == STACK:
        reply = struct.pack("<I", 96)
    board.replies += 1
    reply = lie.told(board, kind, reply)
    whole = seal(kind | REPLY, board.number & 0xFF, reply, 0 if kind == HELLO else _bound(board))
    return lie.sent(board, kind, whole)


def main() -> int:
    """Meet all of them, and one that tells the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    seed = parser.parse_args().seed
    law = pid(FULL)
    program = lower(law, "fixed32")
    bundle = emit(program, "firmloop")
    trial = try_out(law, program, bundle, (), STEPS, seed, lambda share, doing: None)
    library, target = build_host(bundle, load_target("host")), load_target("nucleo_f401re")
    hello = LibraryLink(library, program).hello()
    counts: dict[str, Counter[str]] = {}
    slowest = 0.0
    truth = Lie("the truth")
    for lie in (truth, *lies(seed)):
        controller = LibraryLink(library, program)
        controller.reset()
        board = Board(controller, (hello.in_bytes, hello.out_bytes), program.id.encode(), dice=random.Random(seed))
        with socket.create_server(("127.0.0.1", 0)) as listening:
            address = f"socket://127.0.0.1:{listening.getsockname()[1]}"

            def serve(listening: socket.socket = listening, board: Board = board, lie: Lie = lie) -> None:
                line, _ = listening.accept()
                with line:
                    served(line, board, lie)

            threading.Thread(target=serve, daemon=True).start()
            began = time.monotonic()
            try:
                verdict = verify_on(trial, target, address, lambda share, doing: None)
                came = "agrees" if verdict.agrees else "differs"
            except LinkError:
                came = "refused"
            took = time.monotonic() - began
        slowest = max(slowest, took)
        counts.setdefault(lie.kind, Counter())[came if took < LONGEST else "hangs"] += 1
    words = ("agrees", "differs", "refused", "hangs")
    print(f"{'lie':<26}" + "".join(f"{word:>9}" for word in words))
    for kind, found in counts.items():
        print(f"{kind:<26}" + "".join(f"{found[word]:>9}" for word in words))
    honest = counts.pop(truth.kind)
    total = sum(counts.values(), Counter())
    print(f"{total.total()} lying boards: {total['agrees']} false agrees, {total['hangs']} without an end; ", end="")
    print(f"the longest took {slowest:.1f} s; the one that tells the truth agrees: {honest['agrees'] == 1}")
    return int(total["agrees"] > 0 or total["hangs"] > 0 or honest["agrees"] != 1)


if __name__ == "__main__":
    sys.exit(main())
