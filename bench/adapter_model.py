# SPDX-License-Identifier: GPL-2.0-or-later
"""A serial adapter with a buffer, as a model: what a computer reads, and when, of bytes that were on the wire.

FTDI's chips send what they have when the latency timer runs out, or 62 bytes wait (FTDI AN232B-04). The way to the
computer takes 0 to 1 ms, the computer 0 to 0.3 ms more (capture notes, section 2). Times are in ns.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, NamedTuple

from dalyref.a5 import SIZE, build

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

BUFFER = 62
WAY_NS, HOST_NS = 1_000_000, 300_000
BYTE_NS = 10 / 9600 * 1e9


class Sent(NamedTuple):
    """A frame, and when its first byte began."""

    time_ns: int
    data: bytes


def traffic(exchanges: int, seed: int) -> list[Sent]:
    """Requests and replies, one in seven of sixteen frames back to back, with pauses as people's buses have them."""
    chance = random.Random(seed)
    now, sent = 1_000_000_000, list[Sent]()
    for number in range(exchanges):
        data_id = 0x95 if number % 7 == 6 else 0x90 + number % 5
        now += chance.randrange(50_000_000)
        sent.append(Sent(now, build(0x40, data_id, bytes(8))))
        now += round(SIZE * BYTE_NS) + chance.randrange(5_000_000, 60_000_000)
        for part in range(16 if data_id == 0x95 else 1):
            sent.append(Sent(now, build(1, data_id, bytes([part + 1, *chance.randbytes(7)]))))
            now += round(SIZE * BYTE_NS)
    return sent


def reads(sent: Iterable[Sent], timer_ns: int, seed: int, *, clock: float = 1.0) -> Iterator[tuple[int, bytes]]:
    """Yield (time of the read, its bytes). clock: of the sender's UART, as a ratio; its bytes take so much longer."""
    chance = random.Random(seed)
    ends: list[tuple[int, int]] = []  # of each byte
    for frame in sent:
        ends += [(frame.time_ns + round((k + 1) * BYTE_NS * clock), value) for k, value in enumerate(frame.data)]
    buffer = bytearray()
    timer = chance.randrange(timer_ns) if timer_ns else 0  # it runs freely, and starts again with each sending
    last = 0

    def arrived(sent_ns: int) -> int:
        nonlocal last
        last = max(last, sent_ns + chance.randrange(WAY_NS) + chance.randrange(HOST_NS))
        return last

    for end_ns, value in ends:
        while timer_ns and timer < end_ns:
            if buffer:
                yield arrived(timer), bytes(buffer)
                buffer.clear()
                timer += timer_ns
            else:
                timer += timer_ns * max(1, (end_ns - timer) // timer_ns)
        buffer.append(value)
        if len(buffer) == BUFFER or not timer_ns:
            yield arrived(end_ns), bytes(buffer)
            buffer.clear()
            timer = end_ns + timer_ns
    if buffer:
        yield arrived(timer), bytes(buffer)
