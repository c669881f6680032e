# SPDX-License-Identifier: GPL-2.0-or-later
"""One pass over a capture: packets in, packets of the same number, times and lengths out.

packet --> carriers --> decoder --> records, each blanked by its kind --> back into the packets they came from
packet --> writer, once all is decided
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Final, Protocol

from dalyref import a5, addresses
from dalyref.decoder import Decoder
from dalyref.kinds import Dialect, Kind, Record
from dalytools.redact import a5_data, damaged, modbus_data
from dalytools.redact.carriers import Carriers
from dalytools.redact.labels import comment
from dalytools.redact.lines import Held
from dalytools.redact.structure import Structure
from dalytools.redact.what import LOOKED_FOR_FIELDS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalycapture.captured import CapturedPacket
    from dalyref.decoder import Decoded
    from dalyref.options import Options
    from dalyref.values import Fields
    from dalytools.redact.blanker import Blanker
    from dalytools.redact.tally import Tally

_A5_HEAD: Final = 4
_MOST_HELD: Final = 100_000
"""Packets that wait for the rest of a record, which may never come."""


class Taker(Protocol):
    """Who takes the packets of the copy, in order."""

    def __call__(self, packet: CapturedPacket, data: bytes, said: str, /) -> None:
        """Take a packet of the capture with the bytes and the comment that the copy has."""
        ...


class Redactor:
    """Blanks one capture in one pass. Give it each packet by ``feed``, then ``finish``."""

    def __init__(self, options: Options, blanker: Blanker, tally: Tally, take: Taker) -> None:
        self.structure = Structure()
        self._decoder = Decoder(options)
        self._blanker = blanker
        self._tally = tally
        self._take = take
        self._a5 = a5_data.A5Data(blanker)
        self._carriers = Carriers(blanker, self._a5)
        self._held: deque[Held] = deque()
        self._number = 0

    def feed(self, packet: CapturedPacket) -> None:
        """Take the next packet of the file."""
        tally = self._tally
        tally.packets += 1
        tally.blocks += packet.number - self._number - 1
        self._number = packet.number
        if packet.number != tally.packets:
            packet = replace(packet, number=tally.packets)  # as in the copy
        tally.next_record()
        held = Held(packet, bytearray(packet.data))
        self._held.append(held)
        for inner in self._carriers.feed(held):
            self._records(self._decoder.feed(inner))
        if len(self._held) > _MOST_HELD:
            self._carriers.give_up(self._held[0])
        self._release()

    def finish(self) -> None:
        """Take the end of the file."""
        for inner in self._carriers.finish():
            self._records(self._decoder.feed(inner))
        self._records(self._decoder.finish())
        self._release()

    def _release(self) -> None:
        while self._held and (self._held[0].gone or not self._held[0].undecided):
            held = self._held.popleft()
            packet = held.packet
            if held.close is not None:
                held.close(held.data)
            said = comment(packet.comment, event=not packet.data)
            self._tally.comments += bool(packet.comment) and said != packet.comment
            self._take(packet, bytes(held.data), said)

    def _records(self, records: Iterable[Decoded]) -> None:
        for record in records:
            self._tally.records += record.kind is not Kind.EVENT
            self.structure.add(record)
            self._learn(record.fields)
            if record.transport == "can" or not record.data:
                continue
            self._tally.next_record()
            new = self._blank(record)
            line = self._carriers.lines[record.connection or record.interface, record.direction]
            line.replace(record.data, new)

    def _learn(self, fields: Fields) -> None:
        """Take what was put together of several frames."""
        for name in LOOKED_FOR_FIELDS:
            if isinstance(value := fields.get(name), str):
                self._blanker.learn(value.encode())

    def _blank(self, record: Decoded) -> bytes:
        data, fields = record.data, record.fields
        dialect = fields.get("daly.dialect")
        if record.kind is not Kind.FRAME:
            foreign = fields.get("daly.foreign", "")
            return damaged.blank(Record(0, data, record.kind, foreign=str(foreign)), self._blanker)
        if dialect == Dialect.A5:
            return self._a5_frame(record)
        register = fields.get("daly.modbus.register")
        new = modbus_data.blank(data, register if isinstance(register, int) else None, self._blanker)
        if new != data:
            self._a5.buffers.secret()
        return new

    def _a5_frame(self, record: Decoded) -> bytes:
        data = record.data
        content, data_id = data[_A5_HEAD:-1], data[2]
        where = f"A5 0x{data_id:02X}"
        if addresses.is_request(data[1]):
            new = self._a5.request(data_id, content, where)
        else:
            board = record.connection or record.interface, data[1]
            new = self._a5.reply(data_id, content, board, where)
        return data if new == content else a5.build(data[1], data_id, new)
