# SPDX-License-Identifier: GPL-2.0-or-later
r"""The debug log of dbus-serialbattery (Louisvdw's, mr-manuel's) on Venus OS.

    2025-03-17 14:45:01.471894500 DEBUG:SerialBattery:[can0] Received: ID=0x18904001, Daten=bytearray(b'\x01\r..')
    @4000000067d8.. INFO:SerialBattery:reply: a50190080215000075300271c4

Frames of CAN become frames of CAN. The driver changes the identifiers of bursts before it logs them (field notes c.1):
0x18A64001 was 0x18954001, with frame number 1 in the data; that is undone. A line of the driver without bytes
is known and left out. Sources: logs in mr-manuel/venus-os_dbus-serialbattery 212 and 249; the driver's
read_sentence.
"""

from __future__ import annotations

import re

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes, literal_bytes
from dalytools.logs.stamps import split_stamp

_CAN = re.compile(r".{0,60}?(?:Received|Sent|Send)[^=]{0,20}ID=0x([0-9A-Fa-f]{1,8}),? ?\w{1,8}[=:] ?(.*)")
_HEX = re.compile(
    r".{0,80}?(?P<what>reply|request|command|sent|received|Sending|Receiving)[^:=]{0,20}[:=] ?(?P<rest>.*)", re.I
)
_BYTES = re.compile(r"(?:(?:0x|\\x)?[0-9A-Fa-f]{2}[ ,:]{0,2}){8}|bytearray\(")  # of which nobody told what they are
_LINE = re.compile(r"(?:DEBUG|INFO|WARNING|ERROR|CRITICAL):\s*SerialBattery:|.{0,20}\*\*\* CCGX booted")


class SerialBattery(PlainLineLog):
    """A log of dbus-serialbattery."""

    name = "serialbattery"
    about = "dbus-serialbattery's debug log, serial and CAN"
    stamped_at_end = True

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        if not _LINE.match(rest):
            return None
        said = rest.partition("SerialBattery:")[2]
        if found := _CAN.match(said):
            data = literal_bytes(found[2])
            if data is None:
                data = hex_bytes(found[2])
            if data is None or len(data) > 8:
                return None
            return [Entry(data, stamp, can_id=on_the_wire(int(found[1], 16) & 0x1FFFFFFF, data))]
        if found := _HEX.match(said):
            data = hex_bytes(found["rest"])
            if data is None:
                data = literal_bytes(found["rest"])
            if data:
                out = found["what"].lower() in {"request", "command", "sent", "sending"}
                return [Entry(data, stamp, OUT if out else IN)]
        return None if _BYTES.search(said) else []


def on_the_wire(identifier: int, data: bytes) -> int:
    """Undo what the driver adds to the identifier of a burst's frame: 0x100000 and the frame number << 16."""
    if identifier >> 24 != 0x18 or not data:
        return identifier
    data_id = (identifier >> 16 & 0xFF) - 0x10 - data[0]
    if data_id in {0x95, 0x96} and data[0] <= 16:
        return identifier & 0x1F00FFFF | data_id << 16
    return identifier
