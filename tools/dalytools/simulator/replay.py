# SPDX-License-Identifier: GPL-2.0-or-later
"""A capture played back at its own pace: its packets become bytes on the wire again.

capture   |pkt|---- 40 ms ----|pkt|--------------- 1 h ---------------|pkt|
played    |pkt|---- 40 ms ----|pkt|---- longest silence ----|pkt|              / speed
"""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalytools.problem import Problem
from dalytools.simulator.bus import BITS_A_BYTE
from dalytools.simulator.sent import Sent

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dalyref.packet import Packet

LINK_TYPES = range(147, 163)  # USER0..USER15: raw bytes of a bus
REPLAY = "replay"
_PIECE = 256  # bytes


def open_replay(path: Path, *, baud: int, speed: float = 1.0, longest_silence_s: float = 2.0) -> Iterator[Sent]:
    """Open a capture for playing (see ``replay``). Raises Problem when there is nothing in it that can be played.

    A capture that ends in the middle of a packet raises ``dalycapture.CaptureError`` when its end is reached.
    """
    try:
        packets = (packet for packet in read_capture(path) if packet.data and packet.link_type in LINK_TYPES)
        first = next(packets, None)
    except CaptureError as error:
        raise Problem(str(error)) from error
    if first is None:
        raise Problem(f"{path} holds no bytes of a serial bus (link type USER0 to USER15): nothing to play back")
    return replay(chain([first], packets), baud=baud, speed=speed, longest_silence_s=longest_silence_s)


def replay(packets: Iterable[Packet], *, baud: int, speed: float, longest_silence_s: float) -> Iterator[Sent]:
    """Yield the packets' bytes with times from 0 on (ns): no overlap, no silence longer than that, ``speed`` x as fast.

    Byte times inside a packet follow from the baud rate; packets whose times overlap or run backwards follow each
    other directly.
    """
    longest_ns = int(longest_silence_s * 1e9)
    free_ns = 0  # in played time: when the wire is free again
    heard_until = None  # in the capture's time
    for packet in packets:
        length_ns = len(packet.data) * BITS_A_BYTE * 1_000_000_000 // baud
        silence = 0 if heard_until is None else min(max(0, packet.time_ns - heard_until), longest_ns)
        start = free_ns + int(silence / speed)
        for at in range(0, len(packet.data), _PIECE):  # whoever plays it can stop inside a packet of any size
            time_ns = start + int(at * BITS_A_BYTE * 1_000_000_000 / baud / speed)
            yield Sent(time_ns, REPLAY, packet.data[at : at + _PIECE])
        free_ns = start + int(length_ns / speed)
        heard_until = packet.time_ns + length_ns
