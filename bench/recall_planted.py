# SPDX-License-Identifier: GPL-2.0-or-later
"""What no simulated board does, put into a finished capture of a serial line: into its pauses, behind a reply.

events      port lost, line errors, dropped bytes, a clock that steps back, as the sniffer writes them
exchanges   an exception, registers that are not there, an unknown ID, a reply that nobody asked for, a reply that fits
            two requests, a write that is answered with another value
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from tests.meaning import a5
from tests.meaning_modbus import brings, read, rtu

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.tools.dalytools.findings.moments import Note

    from dalyref.packet import Packet

MS = 1_000_000
PAUSE_NS = 300 * MS
BYTE_NS = 1_041_667
EVENTS = {
    "port_lost": "port lost: the adapter was unplugged",
    "line_errors": "line errors: 2 bytes marked, driver counts framing errors 2",
    "dropped": "bytes dropped: overrun of the driver's buffer",
    "clock_step": "mark",
}
EXCHANGES = {
    "modbus_exception": (read(0xF0F0, 1), rtu("d28302")),
    "absent_registers": (read(0x63, 2), brings(0xFFFF, 0xFFFF)),
    "unknown_id": (a5(0x40, 0xC1), a5(1, 0xC1)),
    "unasked": (a5(1, 0x66, "01"),),
    "write_denied": (a5(0x40, 0xD9, "00"), a5(1, 0xD9, "01")),
    "modbus_ambiguous": (read(0x63, 2), read(0x83, 2), brings(0xFFFF, 0xFFFF)),
}
OF_MODBUS = {"modbus_exception", "absent_registers"}
WAITS_NS = 1100 * MS
"""So long an ambiguous reply leaves one of its requests waiting, which the next answer of Modbus would fit too."""
AMONG = 4
"""One pause in so many, on average, gets something."""


def into(number: int) -> Callable[[Path], list[Note]]:
    """Return what plants into a capture, by lot of that number, and says what."""

    def plant(path: Path) -> list[Note]:
        return _planted(random.Random(f"planted {number}"), path)

    return plant


def _planted(r: random.Random, path: Path) -> list[Note]:
    packets = list(read_capture(path))
    start = packets[0].time_ns
    notes: list[Note] = []
    waits_until = start
    with open_writer(path.with_suffix(".planted"), application="test") as writer:
        writer.add_interface(Interface("made", packets[0].description))
        for packet, following in zip(packets, [*packets[1:], None], strict=True):
            writer.write_packet(packet.time_ns, packet.data)
            end = packet.time_ns + len(packet.data) * BYTE_NS
            if following is None or following.time_ns - end < PAUSE_NS or not _replies(packet) or r.randrange(AMONG):
                continue
            at = end + 60 * MS
            what = r.choice((*EVENTS, *EXCHANGES))
            if what in OF_MODBUS and at < waits_until:
                continue
            if what == "modbus_ambiguous":
                waits_until = at + WAITS_NS
            if what in EVENTS:
                event_ns = packet.time_ns - 1000 * MS if what == "clock_step" else at
                writer.write_packet(event_ns, b"", comment=EVENTS[what])
                notes.append({"time": (event_ns - start) / 1e9, "what": what})
                continue
            notes.append({"time": (at - start) / 1e9, "what": what})
            for frame in map(bytes.fromhex, EXCHANGES[what]):
                writer.write_packet(at, frame)
                at += len(frame) * BYTE_NS + 20 * MS
    path.with_suffix(".planted").replace(path)
    return notes


def _replies(packet: Packet) -> bool:
    """Tell whether a packet is a good reply of a board in A5."""
    data = packet.data
    return len(data) == 13 and data[0] == 0xA5 and data[1] < 0x20 and sum(data[:12]) & 0xFF == data[12]
