# SPDX-License-Identifier: GPL-2.0-or-later
"""One bus and what is remembered of it: from frames to fields (docs/records.md, sections 5 to 9).

Only frames with a right checksum take part, and on CAN classic frames. What a request or an echo carries is not
decoded, and changes nothing that is known about the batteries.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import addresses, bursts, cells, links, parts, payload, writes
from dalyref.board import Board, Seen
from dalyref.bursts import Burst
from dalyref.exchange import Exchange
from dalyref.modbus_bus import ModbusBus
from dalyref.slate import Slate
from dalyref.soc import StatesOfCharge

if TYPE_CHECKING:
    from dalyref.message import Message
    from dalyref.options import Options
    from dalyref.streams import Located
    from dalyref.values import Fields


class Bus:
    """One interface, or several that are one bus."""

    def __init__(self, options: Options, *, echoes: bool = True) -> None:
        """Begin with nothing known. echoes: the wire may give a request back."""
        self.now_ns = 0
        """The latest beginning of a record."""
        self._options = options
        self._reply_ns = options.limit_ns(options.reply)
        self._burst_ns = options.limit_ns(options.burst)
        self._exchange = Exchange[Slate](options, echoes=echoes)
        self._charge = StatesOfCharge(options)
        self._modbus = ModbusBus(options, self._charge)
        self._asked: dict[tuple[int, int], int] = {}  # requests seen, by data ID and the one board that may answer
        self._boards: dict[int, Board] = {}  # by address byte of replies
        self._running: dict[tuple[int, int], Burst[Slate]] = {}  # bursts, by the wire's lanes

    def frame(self, located: Located, message: Message, fields: Fields) -> Slate:
        """Take a frame: add what it means to its `fields`, and to those of records before it."""
        slate = self._slate(located, fields)
        if not payload.is_known(message.data_id):
            fields["daly.unknown_id"] = True
        if message.route.asks:
            self._request(located, message, slate)
        else:
            self._reply(located, message, slate)
        return slate

    def modbus_frame(self, located: Located, data: bytes, fields: Fields) -> Slate:
        """Take a Modbus frame, all of its bytes, in the same way."""
        slate = self._slate(located, fields)
        self._modbus.frame(located, data, slate)
        return slate

    def _slate(self, located: Located, fields: Fields) -> Slate:
        """Begin with a frame of any dialect: time passes for all."""
        self._exchange.pass_time(located.start_ns)
        self._modbus.pass_time(located.start_ns)
        return Slate(fields, self)

    def settle(self, slate: Slate, latest_ns: int) -> None:
        """Nothing more shall come to this record: its time is over, or the capture.

        latest_ns: when the latest packet of the capture began.
        """
        known = latest_ns > slate.waits_until()
        if slate.asks and known:
            slate.fields["daly.unanswered"] = True
        if slate.burst is not None and slate.burst in self._running.values():
            parts.end(slate.burst, known=known)  # one that began in time, and ends later, goes on with it
        slate.close()

    def _request(self, located: Located, message: Message, slate: Slate) -> None:
        packet, data_id = located.packet, message.data_id
        asked = self._exchange.ask(
            message, packet.number, located.start_ns, located.end_ns, side=packet.direction, owner=slate
        )
        fields = slate.fields
        fields["daly.direction"] = asked.direction
        if message.route.board:
            fields["daly.board"] = message.route.board
        if asked.direction == addresses.ECHO:
            return
        if asked.retry:
            fields["daly.retry"] = True
        if asked.second_host:
            fields["daly.second_host"] = True
        if writes.is_write(data_id):
            fields["daly.write"] = True
            if message.whole:
                fields.update(writes.would_set(data_id, message.content))
        for whose in {0, message.route.only}:
            self._asked[data_id, whose] = self._asked.get((data_id, whose), 0) + 1
        slate.open_until_ns = located.end_ns + self._reply_ns
        slate.asks = True

    def _reply(self, located: Located, message: Message, slate: Slate) -> None:
        fields, data_id, address = slate.fields, message.data_id, message.route.address
        fields["daly.direction"] = addresses.REPLY
        self._charge.replied(address)
        if message.route.board:
            fields["daly.board"] = message.route.board
        if not message.whole:
            self._answer(located, message, slate)
        elif data_id in bursts.IDS:
            self._part(located, message, slate)
        else:
            self._end_burst(_lane(message))
            self._answer(located, message, slate)
            fields.update(payload.decode(data_id, message.content))
            seen = _seen(located)
            self._board(address).reply(seen, data_id, message.content, fields)
            if data_id == payload.PACK:
                self._charge.told_by_a5(seen, address, payload.charge(message.content), fields)

    def _answer(self, located: Located, message: Message, slate: Slate) -> int:
        """Find the request of a reply; return its number, 0: none."""
        fields = slate.fields
        answer = self._exchange.answer(message.data_id, message.route, located.start_ns)
        if answer.unasked:
            fields["daly.unasked"] = True
        if answer.late_to:
            fields["daly.late_to"] = answer.late_to
        if answer.other_board:
            fields["daly.other_board"] = True
        if answer.follows:
            fields["daly.request_in"] = answer.follows
        if answer.request is None:
            return 0
        links.link(answer.request, located, slate)
        if answer.request.written and message.whole:
            fields["daly.write_result"] = writes.result(message.data_id, answer.request.written, message.content)
        return answer.request.number

    def _board(self, address: int) -> Board:
        board = self._boards.get(address)
        if board is None:
            board = self._boards[address] = Board(self._options)
        return board

    def _part(self, located: Located, message: Message, slate: Slate) -> None:
        """Take a reply that is one frame of several."""
        fields, data_id, content = slate.fields, message.data_id, message.content
        number = content[0]
        lane = _lane(message)
        burst = self._running.get(lane)
        if burst is not None and not burst.continues(data_id, message.route.address, located.start_ns, self._burst_ns):
            burst = None
        asked = self._asked.get((data_id, lane[0]), 0)
        if burst is not None and (number < burst.last or (number == burst.last and asked > burst.asked)):
            burst = None
        base = self._base(located, message) if burst is None else burst.base
        if bursts.skipped(data_id, number, base):
            parts.skip(data_id, content, slate)
            return
        if burst is None:
            self._end_burst(lane)
            request = self._answer(located, message, slate)
            burst = self._running[lane] = self._begin(message, base, request, slate)
        elif burst.request:
            fields["daly.request_in"] = burst.request
        burst.asked = asked
        if parts.take(burst, located, content, slate, self._burst_ns):
            board = self._board(message.route.address)
            if data_id == cells.CELLS:
                board.cell_table(_seen(located), burst.slots(), fields)
            else:
                board.sensor_table(_seen(located), burst.slots(), fields)

    def _base(self, located: Located, message: Message) -> int:
        """Return what the frames of a burst are counted from, given its first; remember of the board where it is 0."""
        counted_from_0 = self._board(message.route.address).counted_from_0
        if message.content[0] == 0:
            counted_from_0.add(message.data_id)
            return 0
        lost = located.behind_damage and message.data_id in counted_from_0
        return 0 if lost else 1

    def _begin(self, message: Message, base: int, request: int, slate: Slate) -> Burst[Slate]:
        address, data_id = message.route.address, message.data_id
        board = self._board(address)
        count = {cells.CELLS: board.cells, cells.TEMPERATURES: board.sensors}.get(data_id, 0)
        return Burst(data_id, address, base, count, request, slate)

    def _end_burst(self, lane: tuple[int, int]) -> None:
        """End the running burst of a lane."""
        burst = self._running.pop(lane, None)
        if burst is not None:
            parts.end(burst)


def _lane(message: Message) -> tuple[int, int]:
    """Return by what bursts run side by side: on CAN board and host; a serial line has one at a time."""
    route = message.route
    return (route.address, route.host) if route.host else (0, 0)


def _seen(located: Located) -> Seen:
    return Seen(located.packet.number, located.start_ns, located.end_ns)
