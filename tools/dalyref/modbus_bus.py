# SPDX-License-Identifier: GPL-2.0-or-later
"""The Modbus frames of one bus: from frames to fields (docs/wires.md, section 1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import addresses, links, modbus, modbus_frame, modbus_proof, register_map, registers_81, registers_d2
from dalyref.board import Seen
from dalyref.modbus_board import ModbusBoard
from dalyref.modbus_exchange import ModbusExchange, ModbusRequest
from dalyref.modbus_frame import Shape
from dalyref.register_map import Registers
from dalyref.values import put
from dalyref.writes import CONFIRMED, DENIED

if TYPE_CHECKING:
    from dalyref.modbus_exchange import ModbusAnswer
    from dalyref.modbus_frame import ModbusFrame
    from dalyref.options import Options
    from dalyref.slate import Slate
    from dalyref.soc import StatesOfCharge
    from dalyref.streams import Located


class ModbusBus:
    """What is remembered of Modbus on one bus."""

    def __init__(self, options: Options, charge: StatesOfCharge) -> None:
        """Begin with nothing known. charge: what A5 says of the same boards."""
        self._reply_ns = options.limit_ns(options.reply)
        self._exchange = ModbusExchange["Slate"](options)
        self._boards: dict[int, ModbusBoard] = {}  # by address of replies
        self._charge = charge

    def pass_time(self, start_ns: int) -> None:
        """Take the beginning of any frame of the bus."""
        self._exchange.pass_time(start_ns)

    def frame(self, located: Located, data: bytes, slate: Slate) -> None:
        """Take a frame: add what it means to the fields of its slate, and to those of records before it."""
        frame = modbus_frame.parse(data)
        modbus_frame.describe(frame, slate.fields)
        if self._exchange.is_request(frame, located.packet.direction):
            self._request(located, frame, slate)
        else:
            self._reply(located, frame, slate)

    def _request(self, located: Located, frame: ModbusFrame, slate: Slate) -> None:
        slate.fields["daly.direction"] = addresses.REQUEST
        if frame.function in (modbus.WRITE_ONE, modbus.WRITE_MANY):
            slate.fields["daly.write"] = True
            registers = Registers(frame.register, frame.data)
            slate.fields.update(register_map.would_set(registers, _table(frame)))
        slate.open_until_ns = located.end_ns + self._reply_ns
        slate.asks = True
        packet = located.packet
        self._exchange.ask(ModbusRequest(frame, packet.number, located.end_ns, packet.direction, slate))

    def _reply(self, located: Located, frame: ModbusFrame, slate: Slate) -> None:
        fields = slate.fields
        fields["daly.direction"] = addresses.REPLY
        answer = self._exchange.answer(frame, located.start_ns)
        if answer.unasked:
            fields["daly.unasked"] = True
        if answer.late_to:
            fields["daly.late_to"] = answer.late_to
        if answer.ambiguous is not None:
            fields["daly.modbus.ambiguous"] = True
            links.waits_no_longer(answer.ambiguous)
        if answer.request is not None:
            links.link(answer.request, located, slate)
            if answer.request.frame.shape is not Shape.READ_REQUEST:
                fields["daly.write_result"] = _result(frame, answer.request.frame)
        if frame.shape is Shape.READ_REPLY:
            registers = self._registers(frame, answer, slate)
            if registers is not None:
                self._read(located, frame, registers, slate)

    @staticmethod
    def _registers(frame: ModbusFrame, answer: ModbusAnswer[Slate], slate: Slate) -> Registers | None:
        """Find out which registers a read reply brings; None where that is not known."""
        if answer.request is not None:
            return Registers(answer.request.frame.register, frame.data)
        if answer.ambiguous is not None:
            return None
        registers = modbus_proof.assume(frame.data, d2=frame.d2)
        if registers is not None:
            slate.fields["daly.modbus.assumed"] = True
        return registers

    def _read(self, located: Located, frame: ModbusFrame, registers: Registers, slate: Slate) -> None:
        fields, table = slate.fields, _table(frame)
        fields["daly.modbus.register"] = registers.start
        fields["daly.modbus.count"] = registers.count
        put(fields, "daly.modbus.absent", registers.absent(table))
        board = self._boards.get(frame.address)
        if board is None:
            board = self._boards[frame.address] = ModbusBoard(table)
        board.reply(registers, located.packet.number, fields)
        charge = registers.value(table.charge)
        if charge is not None:
            seen = Seen(located.packet.number, located.start_ns, located.end_ns)
            self._charge.told_by_modbus(seen, frame.address, charge, fields)


def _table(frame: ModbusFrame) -> register_map.RegisterMap:
    return registers_d2.MAP if frame.d2 else registers_81.MAP


def _result(reply: ModbusFrame, request: ModbusFrame) -> str:
    """Return what the reply to a write says of it. That of a write of many tells no values."""
    if reply.shape is Shape.EXCEPTION:
        return DENIED
    return CONFIRMED if reply.shape is not Shape.WRITE_ONE or reply.data == request.data else DENIED
