# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture holds, frame by frame, told by the bytes, without the decoder; and the tables of a board."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

from tests.meaning_modbus import rtu

from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from pathlib import Path

WAITS_S = 1.0
"""A request, from its end (docs/records.md 6)."""
SOCKETCAN = 227
CAN_SIZE, A5_SIZE = 16, 13
FIRST_REQUEST = 0x20
DALYS_MODBUS = frozenset((0xD2, *range(0x51, 0x61), *range(0x81, 0x91)))
BURSTS = frozenset((0x95, 0x96, 0x55, 0x56, 0x57, 0x62, 0x63, 0x6A))
BURST_QUIET_S = 0.5
SLOTS = {0x95: 3, 0x96: 7}
CLOCK_S = 1e-6
PAUSE_S = 1e-3
LONGEST = 257
"""Bytes of a frame of Modbus (docs/records.md 2)."""


class Frame(NamedTuple):
    """A packet: when it begins, s; of a good A5 frame, on a serial line or CAN, address, data ID and payload."""

    seconds: float
    size: int
    address: int = -1
    data_id: int = -1
    payload: bytes = b""
    first: int = -1
    """The first byte of what is no good A5 frame."""
    modbus: bool = False
    """A good frame of Modbus, of an address of Daly's."""
    falls_apart: bool = False
    """A piece of such a frame with another inside, which ends first and so is the frame (docs/records.md 3)."""

    @property
    def good(self) -> bool:
        """A good frame of A5."""
        return self.address >= 0

    @property
    def asks(self) -> bool:
        """A request in A5."""
        return self.address >= FIRST_REQUEST

    @property
    def replies(self) -> bool:
        """A reply in A5."""
        return 0 <= self.address < FIRST_REQUEST

    @property
    def begins(self) -> bool:
        """No later frame of a burst."""
        return self.data_id not in BURSTS or self.payload[0] <= 1

    @property
    def ends(self) -> float:
        """When its last byte ends, s; on CAN the time stamp is all there is."""
        return self.seconds if self.size == CAN_SIZE else self.seconds + self.size / 960


def frames(path: Path, start_ns: int) -> list[Frame]:
    """Return all packets of a capture that hold bytes."""
    out: list[Frame] = []
    said: list[bytes] = []
    for packet in read_capture(path):
        data, seconds = packet.data, (packet.time_ns - start_ns) / 1e9
        if packet.link_type == SOCKETCAN:
            asks = data[3] >= 0x20
            address = (data[3] if data[3] != 0x40 else data[2] + 0x3F) if asks else data[3]
            if data[0] == 0x98 and len(data) == CAN_SIZE:
                out.append(Frame(seconds, CAN_SIZE, address, data[1], data[8:]))
            else:
                out.append(Frame(seconds, len(data)))
        elif len(data) == A5_SIZE and data[0] == 0xA5 and sum(data[:12]) & 0xFF == data[12]:
            out.append(Frame(seconds, A5_SIZE, data[1], data[2], data[4:12]))
        elif data:
            modbus = data[0] in DALYS_MODBUS and len(data) > 4 and rtu(data[:-2].hex()) == data.hex()
            out.append(Frame(seconds, len(data), first=data[0], modbus=modbus))
        if data:
            said.append(data)
    apart = _apart(out, said)
    return [frame._replace(falls_apart=place in apart) for place, frame in enumerate(out)]


def _apart(heard: list[Frame], said: list[bytes]) -> set[int]:
    """Return the places of packets that together, without a pause, are a good frame of Modbus around another."""
    out: set[int] = set()
    for first, frame in enumerate(heard):
        if frame.first not in DALYS_MODBUS:
            continue
        whole, last = said[first], first
        while last + 1 < len(heard) and len(whole) < LONGEST and heard[last + 1].seconds - heard[last].ends < PAUSE_S:
            last += 1
            whole += said[last]
            if rtu(whole[:-2].hex()) == whole.hex() and any(part.good or part.modbus for part in heard[first:last]):
                out.update(range(first, last + 1))
                break
    return out


def between(heard: list[Frame], first: float, last: float) -> list[Frame]:
    """Return those that begin in that time, the last moment left out."""
    return heard[bisect_left(heard, first, key=_seconds) : bisect_left(heard, last, key=_seconds)]


def _seconds(frame: Frame) -> float:
    return frame.seconds


class Table(NamedTuple):
    """A table of one board: when it begins and when it is whole, s; whether anything but zeros is in it."""

    begins: float
    whole: float
    some: bool


def tables(mine: list[Frame], data_id: int) -> list[Table]:
    """Return one board's tables that became whole."""
    out: list[Table] = []
    count = following = 0
    begins = 0.0
    some = False
    before: Frame | None = None
    for frame in mine:
        if frame.data_id == 0x94:
            count = frame.payload[0 if data_id == 0x95 else 1] or count
        if frame.data_id == data_id:
            number = frame.payload[0]
            if before is not None and _goes_on(before, frame):
                following += 1 if following and number == before.payload[0] + 1 else -following
                some = some or any(frame.payload[1:7])
            else:
                begins, following, some = frame.seconds, int(number <= 1), any(frame.payload[1:7])
            if count and following == -(-count // SLOTS[data_id]):
                out.append(Table(begins, frame.seconds, some))
        before = frame
    return out


def _goes_on(before: Frame, frame: Frame) -> bool:
    """Tell whether two replies are of one burst (records.md 8)."""
    return (
        (frame.address, frame.data_id) == (before.address, before.data_id)
        and frame.seconds - before.ends < BURST_QUIET_S
        and frame.payload[0] > before.payload[0]
    )
