# SPDX-License-Identifier: GPL-2.0-or-later
"""Which fields stand in which bytes, found out by trying: the reference decoder reads a payload, and the same payload
with one byte changed; the fields that differ stand in that byte. So nothing is written down here a second time.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from dalyref import a5, can_hkms, registers_81, registers_d2
from dalyref.decoder import Decoder
from dalyref.packet import CanFrame, Packet
from dalytools.survey.place import A5, D2, HKMS, MODBUS, REPLY, REQUEST, Place

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.register_map import RegisterMap
    from dalyref.values import Fields

Names = tuple[tuple[str, ...], ...]
"""By byte: the fields (without ``daly.``) that stand in it."""

_CHANGES: Final = (0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x40, 0x80, 0xFF, 0x55)
_NO_NAMES: Final = re.compile(
    r"daly\.(data|checksum.*|changed.*|contradict.*|unknown_id|write.*|fault_(count|raised|cleared)|cells\..*"
    r"|sensors\..*|cell\.\d\d|burst\..*|reassembled_in|pack\.(state|current_raw)|start|address|length|modbus\..*|soh)"
)


def names(place: Place, data: bytes) -> Names:
    """Return the names of the bytes of a place, by a payload that was seen there."""
    if place.dialect in MODBUS:
        return (_register_names(place),) * len(data)
    if place.dialect not in (A5, HKMS) or len(data) != 8 or place.direction not in (REPLY, REQUEST):
        return ((),) * len(data)
    plain = _read(place, data)
    out: list[tuple[str, ...]] = []
    for index, value in enumerate(data):
        if place.page >= 0 and not index:
            out.append(("frame_number",))
            continue
        found: dict[str, None] = {}
        for change in _CHANGES:
            changed = data[:index] + bytes((value ^ change,)) + data[index + 1 :]
            for name in _differing(plain, _read(place, changed)):
                found[name] = None
        out.append(tuple(found))
    return tuple(out)


def _read(place: Place, data: bytes) -> Fields:
    decoder = Decoder()
    if place.dialect == A5:
        address = place.board if place.direction == REPLY else 0x3F + (place.board or 1)
        packets: list[Packet] = [Packet(1, 0, a5.build(address, place.number, data))]
    else:
        ends = 0x8000 | place.board if place.direction == REPLY else place.board << 8 | 0x80
        keep_alive = CanFrame(1, 0, bytes(8), identifier=can_hkms.KEEP_ALIVE)
        packets = [keep_alive, CanFrame(2, 1, data, identifier=place.number << 16 | ends)]
    records = [record for packet in packets for record in decoder.feed(packet)] + decoder.finish()
    return records[-1].fields


def _differing(one: Fields, other: Fields) -> list[str]:
    out: list[str] = []
    for name in {**one, **other}:
        a, b = one.get(name), other.get(name)
        if a == b or _NO_NAMES.fullmatch(name):
            continue
        short = name.removeprefix("daly.")
        if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
            out += [f"{short}[{at}]" for at, (x, y) in enumerate(zip(a, b, strict=True)) if x != y]
        else:
            out.append(short)
    return out


def _register_names(place: Place) -> tuple[str, ...]:
    table: RegisterMap = registers_d2.MAP if place.dialect == D2 else registers_81.MAP
    register = place.number
    found = [
        name
        for first, last, name, _ in (*table.told, *table.settings)
        if first <= register <= last and name != "pack.current_raw"
    ]
    for numbers, name in ((table.cells, "cell.voltage"), (table.sensors, "temperature"), (table.faults, "fault")):
        if register in numbers:
            found.append(f"{name}[{numbers.index(register)}]")
    if table.commands and register in table.commands:
        found.append(f"command {table.commands[register]}")
    return tuple(found)


def shortened(names_of_byte: Sequence[str], most: int = 2) -> str:
    """Say some names in little room."""
    rest = len(names_of_byte) - most
    return ", ".join(names_of_byte[:most]) + (f" and {rest} more" if rest > 0 else "")
