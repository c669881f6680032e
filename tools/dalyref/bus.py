# SPDX-License-Identifier: GPL-2.0-or-later
"""One bus and what is remembered of it: from frames to fields (docs/records.md, sections 5 to 9).

Only frames with a right checksum take part. What a request or an echo carries is not decoded, and changes nothing that
is known about the batteries.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalyref import addresses, bursts, cells, faults, payload
from dalyref.bursts import Burst
from dalyref.exchange import Exchange
from dalyref.options import NANO, TOLERANCE_NS
from dalyref.values import put

if TYPE_CHECKING:
    from dalyref.options import Options
    from dalyref.streams import Located
    from dalyref.values import Fields


@dataclass(slots=True, eq=False)
class Slate:
    """The fields of one record, and until when something may be added to them."""

    fields: Fields
    bus: Bus
    open_until_ns: int = 0
    """A record of this bus that begins later settles it; 0: settled."""


@dataclass(slots=True, eq=False)
class Board:
    """What is known of the battery that answers with one address byte."""

    cells: int = 0
    sensors: int = 0
    state: int | None = None
    faults: int | None = None


class Bus:
    """One interface, or several that are one bus."""

    def __init__(self, options: Options) -> None:
        self.now_ns = 0
        """The latest beginning of a record."""
        self._reply_ns = options.limit_ns(options.reply)
        self._burst_ns = options.limit_ns(options.burst)
        self._exchange = Exchange[Slate](options)
        self._asked: dict[int, int] = {}  # requests seen, by data ID
        self._boards: dict[int, Board] = {}  # by address byte of replies
        self._burst: Burst[Slate] | None = None

    def frame(self, located: Located, data: bytes, fields: Fields) -> Slate:
        """Take an A5 frame: add what it means to its `fields`, and to those of records before it."""
        slate = Slate(fields, self)
        self._exchange.pass_time(located.start_ns)
        if addresses.is_request(data[1]):
            self._request(located, data, slate)
        else:
            self._reply(located, data, slate)
        return slate

    def settle(self, slate: Slate) -> None:
        """Nothing more shall come to this record: its time is over."""
        if self._burst is not None and self._burst.owner is slate:
            self._end_burst()
        slate.open_until_ns = 0

    def _request(self, located: Located, data: bytes, slate: Slate) -> None:
        packet = located.packet
        direction, retry = self._exchange.ask(
            data, packet.number, located.start_ns, located.end_ns, side=packet.direction, owner=slate
        )
        fields = slate.fields
        fields["daly.direction"] = direction
        board = addresses.board(data[1])
        if board:
            fields["daly.board"] = board
        if direction == addresses.ECHO:
            return
        if retry:
            fields["daly.retry"] = True
        self._asked[data[2]] = self._asked.get(data[2], 0) + 1
        slate.open_until_ns = located.end_ns + self._reply_ns

    def _reply(self, located: Located, data: bytes, slate: Slate) -> None:
        fields = slate.fields
        fields["daly.direction"] = addresses.REPLY
        board = addresses.board(data[1])
        if board:
            fields["daly.board"] = board
        if data[2] in bursts.IDS:
            self._part(located, data, board, slate)
        else:
            self._end_burst()
            self._answer(located, data[2], board, slate)
            self._whole(data, fields)

    def _answer(self, located: Located, data_id: int, board: int, slate: Slate) -> int:
        """Find the request of a reply; return its number, 0: none."""
        request = self._exchange.answer(data_id, board)
        if request is None:
            return 0
        fields = slate.fields
        fields["daly.request_in"] = request.number
        after_ns = located.start_ns - request.end_ns
        if after_ns >= -TOLERANCE_NS:  # else the time stamps can't tell
            fields["daly.response_time"] = max(after_ns, 0) / NANO
        request.owner.fields["daly.reply_in"] = located.packet.number
        request.owner.open_until_ns = 0
        return request.number

    def _whole(self, data: bytes, fields: Fields) -> None:
        """Values of a reply that is one frame, and what is remembered of it."""
        values = payload.decode(data[2], data[4:12])
        if not values:
            return
        fields.update(values)
        board = self._board(data[1])
        match data[2]:
            case 0x90:
                if board.state is not None:
                    fields["daly.pack.state"] = board.state
            case 0x93:
                board.state = data[4]
            case 0x94:
                if 1 <= data[4] <= cells.MOST_CELLS:
                    board.cells = data[4]
                if 1 <= data[5] <= cells.MOST_SENSORS:
                    board.sensors = data[5]
            case 0x98:
                found = faults.bits(data[4:12])
                if board.faults is not None:
                    put(fields, "daly.fault_raised", faults.names(found & ~board.faults))
                    put(fields, "daly.fault_cleared", faults.names(board.faults & ~found))
                board.faults = found
            case _:
                pass

    def _board(self, address: int) -> Board:
        board = self._boards.get(address)
        if board is None:
            board = self._boards[address] = Board()
        return board

    def _part(self, located: Located, data: bytes, board: int, slate: Slate) -> None:
        """Take a reply that is one frame of several."""
        fields, data_id, number = slate.fields, data[2], data[4]
        burst = self._burst
        if burst is not None and not burst.continues(data_id, data[1], located.start_ns, self._burst_ns):
            burst = None
        if bursts.skipped(data_id, number, burst.base if burst is not None else 1):
            fields["daly.frame_number"] = number
            if data_id in cells.SLOTS:
                fields["daly.reserved"] = data[5:12].hex()
            return
        asked = self._asked.get(data_id, 0)
        if burst is not None and (number < burst.last or (number == burst.last and asked > burst.asked)):
            burst = None
        if burst is None:
            self._end_burst()
            request = self._answer(located, data_id, board, slate)
            burst = self._begin(data, request, slate)
            missing = range(burst.base, number)
        else:
            if burst.request:
                fields["daly.request_in"] = burst.request
            burst.owner.open_until_ns = 0
            burst.owner = slate
            missing = range(burst.last + 1, number)
            if number == burst.last:
                fields["daly.burst.repeat"] = True
        if missing:
            burst.whole = False
            put(fields, "daly.burst.missing", missing)
        burst.last, burst.end_ns, burst.asked = number, located.end_ns, asked
        self._part_values(burst, data, fields)
        if burst.needs_end:
            slate.open_until_ns = located.end_ns + self._burst_ns

    def _begin(self, data: bytes, request: int, slate: Slate) -> Burst[Slate]:
        address, data_id, number = data[1], data[2], data[4]
        board = self._board(address)
        count = board.cells if data_id == cells.CELLS else board.sensors
        base = 0 if number == 0 else 1
        self._burst = Burst(data_id, address, base, count, request, 0, number, 0, slate, whole=True)
        return self._burst

    @staticmethod
    def _part_values(burst: Burst[Slate], data: bytes, fields: Fields) -> None:
        data_id, number, content = data[2], data[4], data[4:12]
        if data_id not in cells.SLOTS:
            fields["daly.frame_number"] = number
            return
        real = cells.used(data_id, number, burst.base, burst.count)
        fields.update(cells.decode(data_id, content, real))
        if data_id == cells.CELLS:
            burst.voltages[number] = cells.cells(content)
            first = 3 * (number - burst.base) + 1
            if burst.whole and first <= burst.count < first + 3:
                fields.update(burst.table())

    def _end_burst(self) -> None:
        burst, self._burst = self._burst, None
        if burst is not None and burst.needs_end:
            burst.owner.fields.update(burst.table())
            burst.owner.open_until_ns = 0
