# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus frames on a serial bus: by the plain decoder, one by one. They are few beside A5, or the capture is short."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref.modbus_bus import ModbusBus
from dalyref.packet import Packet
from dalyref.slate import Slate
from dalyref.soc import StatesOfCharge
from dalyref.streams import Located
from dalytools.bulk.packets import SIDES

if TYPE_CHECKING:
    from dalyref.options import Options
    from dalyref.values import Fields
    from dalytools.bulk.records import Records


class Modbus:
    """The Modbus frames of one bus."""

    now_ns = 0

    def __init__(self, options: Options) -> None:
        self._bus = ModbusBus(options, StatesOfCharge(options))

    def settle(self, slate: Slate, latest_ns: int) -> None:
        """Do nothing: what later records would add is left out."""

    def take(self, records: Records, row: int, latest_ns: int) -> Fields:
        """Take a frame; return its fields. latest_ns: the latest beginning of a frame on this bus."""
        data = records.others[row]
        start_ns = int(records.time_ns[row])
        packet = Packet(int(records.number[row]), start_ns, data, direction=SIDES[int(records.side[row])])
        self._bus.pass_time(latest_ns)
        fields: Fields = {}
        self._bus.frame(Located(None, packet, start_ns, int(records.end_ns[row])), data, Slate(fields, self))
        return fields
