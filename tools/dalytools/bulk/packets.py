# SPDX-License-Identifier: GPL-2.0-or-later
"""Packets of a capture as columns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref.packet import Packet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Direction
    from dalytools.bulk.arrays import Bytes, Ints, Words

SIDES: Final[tuple[Direction, ...]] = ("", "inbound", "outbound")
"""What a side's number means."""
SPARE: Final = 16
"""So many bytes behind the last packet's first can be read: a frame's length, and more."""


@dataclass(slots=True)
class Interfaces:
    """The interfaces of a file, by their number over the file: more come as it is read."""

    link_type: list[int] = field(default_factory=list[int])
    description: list[str] = field(default_factory=list[str])


@dataclass(slots=True)
class Packets:
    """Some packets in the order of the file, a row each."""

    buffer: Bytes
    """Holds their data, and SPARE bytes behind. What reads the file writes over it for the next packets."""
    number: Ints
    time_ns: Ints
    interface: Ints
    """Over the whole file."""
    side: Bytes
    """Index into SIDES."""
    offset: Ints
    """Of the first byte of data in `buffer`: a multiple of four."""
    length: Ints
    words: Words
    """The first sixteen bytes of each, whatever it has less than that."""
    comments: dict[int, str]
    """By packet number, of the few that have one."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.number)

    def packet(self, row: int, interfaces: Interfaces) -> Packet:
        """Return one as the plain decoder takes it."""
        number, interface, offset = int(self.number[row]), int(self.interface[row]), int(self.offset[row])
        return Packet(
            number,
            int(self.time_ns[row]),
            self.buffer[offset : offset + int(self.length[row])].tobytes(),
            interface,
            interfaces.description[interface],
            SIDES[int(self.side[row])],
            self.comments.get(number, ""),
            interfaces.link_type[interface],
        )


@dataclass(slots=True)
class Gathered:
    """Rows that are collected one by one: of packets that come as objects."""

    number: list[int] = field(default_factory=list[int])
    time_ns: list[int] = field(default_factory=list[int])
    interface: list[int] = field(default_factory=list[int])
    side: list[int] = field(default_factory=list[int])
    offset: list[int] = field(default_factory=list[int])
    length: list[int] = field(default_factory=list[int])

    def add(self, packet: Packet, offset: int) -> None:
        """Take a packet whose data will stand at `offset`."""
        self.number.append(packet.number)
        self.time_ns.append(packet.time_ns)
        self.interface.append(packet.interface)
        self.side.append(SIDES.index(packet.direction))
        self.offset.append(offset)
        self.length.append(len(packet.data))


def from_objects(packets: Sequence[Packet], interfaces: Interfaces) -> Packets:
    """Return packets as columns. interfaces: takes those that are new."""
    rows = Gathered()
    data = bytearray()
    comments: dict[int, str] = {}
    for packet in packets:
        while len(interfaces.link_type) <= packet.interface:
            interfaces.link_type.append(packet.link_type)
            interfaces.description.append("")
        interfaces.link_type[packet.interface] = packet.link_type
        interfaces.description[packet.interface] = packet.description
        rows.add(packet, len(data))
        data += packet.data + bytes(-len(packet.data) % 4)
        if packet.comment:
            comments[packet.number] = packet.comment
    data += bytes(SPARE)
    buffer = np.frombuffer(bytes(data), np.uint8)
    offset = np.array(rows.offset, np.int64)
    return Packets(
        buffer,
        np.array(rows.number, np.int64),
        np.array(rows.time_ns, np.int64),
        np.array(rows.interface, np.int64),
        np.array(rows.side, np.uint8),
        offset,
        np.array(rows.length, np.int64),
        gather(buffer, offset),
        comments,
    )


def gather(buffer: Bytes, offset: Ints) -> Words:
    """Return the sixteen bytes at each offset, a multiple of four."""
    if len(offset) > 1:
        first, step = int(offset[0]), int(offset[1] - offset[0])
        if step > 0 and (offset[1:] - offset[:-1] == step).all():
            evenly = np.ndarray((len(offset),), "V16", buffer.data, first, (step,))
            return evenly.copy().view(np.uint64).reshape(-1, 2)
    at_every_word = np.ndarray(((len(buffer) - 16) // 4 + 1,), "V16", buffer.data, 0, (4,))
    return at_every_word[offset >> 2].view(np.uint64).reshape(len(offset), 2)
