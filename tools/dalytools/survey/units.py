# SPDX-License-Identifier: GPL-2.0-or-later
"""From a decoded record to the places and payloads that it carries."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref import bursts, can_hkms
from dalyref.kinds import Kind
from dalytools.survey.place import A5, CAN, ECHO, HKMS, MODBUS, REPLY, REQUEST, Place

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.packet import CanFrame
    from dalyref.values import Fields, Value

_DIRECTIONS: Final = {1: REQUEST, 2: REPLY, 3: ECHO}
_HKMS_PAGES: Final = frozenset((can_hkms.CELLS, can_hkms.SENSORS, 0x040E))
MOST_PAGES: Final = 48


def units(record: Decoded, bus: str) -> Iterator[tuple[Place, bytes]]:
    """Give each place that a record fills, with its bytes. Nothing for what is no good frame of Daly's."""
    fields = record.fields
    if record.kind is not Kind.FRAME:
        return
    dialect = str(fields.get("daly.dialect", ""))
    direction = _DIRECTIONS.get(_number(fields, "daly.direction"), "")
    board = _number(fields, "daly.board")
    if dialect in MODBUS:
        register = fields.get("daly.modbus.register")
        if isinstance(register, int):
            yield from _registers(fields, Place(bus, board, dialect, direction, register, size=2))
    elif dialect in (A5, HKMS):
        number = _number(fields, "daly.data_id" if dialect == A5 else "daly.can.register")
        data = bytes.fromhex(str(fields.get("daly.data", "")))
        page = -1
        if direction == REPLY and data and number in (bursts.IDS if dialect == A5 else _HKMS_PAGES):
            page = min(data[0], MOST_PAGES)
        yield Place(bus, board, dialect, direction, number, page, len(data)), data


def _registers(fields: Fields, first: Place) -> Iterator[tuple[Place, bytes]]:
    values: Value | list[Value] | None = fields.get("daly.modbus.value")
    if values is None:
        count = _number(fields, "daly.modbus.count")
        yield Place(first.bus, first.board, first.dialect, first.direction, first.number, size=0, read=count), b""
        return
    for offset, value in enumerate(values if isinstance(values, list) else [values]):
        if isinstance(value, int):
            place = Place(first.bus, first.board, first.dialect, first.direction, first.number + offset, size=2)
            yield place, value.to_bytes(2)


def of_can(frame: CanFrame, bus: str) -> tuple[Place, bytes]:
    """Give place and bytes of a CAN frame that the reference does not know, or knows to be somebody else's."""
    place = Place(bus, 0, CAN, "", frame.identifier, size=len(frame.data), extended=frame.extended)
    return place, frame.data


def _number(fields: Fields, name: str) -> int:
    value = fields.get(name)
    return value if isinstance(value, int) else 0
