# SPDX-License-Identifier: GPL-2.0-or-later
"""Eight data bytes of a reply to values, by data ID. All numbers are big-endian.

Those of the vendor's paper V1.2, section 3, are here; the others in ``settings``, ``alarms`` and ``writes``.

         byte  0     1     2     3     4     5     6     7
    90       | pack V x 10 | gather x10| A x 10 + 30000 | SOC x 10 |
    91       | max mV    | no. | min mV    | no. | -         |
    92       | max | no. | min | no. | -                     |     C + 40
    93       |state| MOS chg, dis | life | remaining mAh         |
    94       |cells|temps|chgr |load |DI DO| cycles    | -   |     cycles: field notes, a.1
    97       | one bit a cell, cell 1 = byte 0 bit 0 | -         |     byte 1: active balance, field notes, a.1

The sign of the current is as sent: boards do not agree on it (field notes, fact 5). Reserved bytes (-) are stale on
many boards and shown as they are (fact 2).
"""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING

from dalyref import alarms, cells, faults, settings, writes
from dalyref.values import put

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.values import Fields

_PACK = Struct(">4H")
_CELL_EXTREMES = Struct(">HBHB2s")
_TEMPERATURE_EXTREMES = Struct(">4B4s")
_MOS = Struct(">B??BL")
_STATUS = Struct(">5BH")


PACK = 0x90


def charge(data: bytes) -> int:
    """Return the state of charge of a 90, 0.1 %."""
    return int.from_bytes(data[6:8])


def pack(data: bytes) -> Fields:
    """90: pack and gather voltage (V), current (A, as sent), state of charge (%)."""
    voltage, gather, current, soc = _PACK.unpack(data)
    return {
        "daly.pack.voltage": voltage / 10,
        "daly.pack.gather_voltage": gather / 10,
        "daly.pack.current": (current - 30000) / 10,
        "daly.pack.current_raw": current,
        "daly.soc": soc / 10,
    }


def cell_extremes(data: bytes) -> Fields:
    """91: highest and lowest cell (mV) and their numbers."""
    high, high_number, low, low_number, reserved = _CELL_EXTREMES.unpack(data)
    return {
        "daly.cell.max_voltage": high,
        "daly.cell.max_number": high_number,
        "daly.cell.min_voltage": low,
        "daly.cell.min_number": low_number,
        "daly.reserved": reserved.hex(),
    }


def temperature_extremes(data: bytes) -> Fields:
    """92: highest and lowest temperature (C) and their sensors' numbers."""
    high, high_number, low, low_number, reserved = _TEMPERATURE_EXTREMES.unpack(data)
    return {
        "daly.temperature.max": high - 40,
        "daly.temperature.max_number": high_number,
        "daly.temperature.min": low - 40,
        "daly.temperature.min_number": low_number,
        "daly.reserved": reserved.hex(),
    }


def mos(data: bytes) -> Fields:
    """93: state, both MOS switches, the running counter "life", what is left (mAh)."""
    state, charge, discharge, life, remaining = _MOS.unpack(data)
    return {
        "daly.state": state,
        "daly.mos.charge": charge,
        "daly.mos.discharge": discharge,
        "daly.life": life,
        "daly.remaining_capacity": remaining,
    }


def status(data: bytes) -> Fields:
    """94: how many cells and sensors, charger, load, inputs and outputs, charge cycles."""
    cell_count, sensor_count, charger, load, pins, cycles = _STATUS.unpack_from(data)
    return {
        "daly.cell_count": cell_count,
        "daly.sensor_count": sensor_count,
        "daly.charger": charger,
        "daly.load": load,
        "daly.di1": pins & 0x01 != 0,
        "daly.di2": pins & 0x02 != 0,
        "daly.di3": pins & 0x04 != 0,
        "daly.di4": pins & 0x08 != 0,
        "daly.do1": pins & 0x10 != 0,
        "daly.do2": pins & 0x20 != 0,
        "daly.do3": pins & 0x40 != 0,
        "daly.do4": pins & 0x80 != 0,
        "daly.cycles": cycles,
        "daly.reserved": data[7:].hex(),
    }


def balance(data: bytes) -> Fields:
    """97: the mask of cells being balanced; and byte 1 as boards with an active balancer mean it."""
    mask = int.from_bytes(data[:6], "little")
    fields: Fields = {"daly.balance.mask": mask}
    if mask:
        put(fields, "daly.balance.cell", [cell + 1 for cell in range(48) if mask >> cell & 1])
    fields["daly.balance.active_cell"] = data[1]
    fields["daly.reserved"] = data[6:].hex()
    return fields


def _cells(data: bytes) -> Fields:
    return cells.decode(cells.CELLS, data, 3)


def _temperatures(data: bytes) -> Fields:
    return cells.decode(cells.TEMPERATURES, data, 7)


DECODERS: dict[int, Callable[[bytes], Fields]] = {
    PACK: pack,
    0x91: cell_extremes,
    0x92: temperature_extremes,
    0x93: mos,
    0x94: status,
    0x95: _cells,
    0x96: _temperatures,
    0x97: balance,
    0x98: faults.decode,
}
"""By data ID. 95 and 96 as they stand alone, all slots taken for cells or sensors: see ``bursts`` for more."""


_KNOWN = frozenset(
    (0x00, 0x02, *range(0x10, 0x2B), *range(0x50, 0x6B), *range(0x70, 0x8B), *range(0x90, 0x9B), 0xD8, 0xD9, 0xDA)
)


def is_known(data_id: int) -> bool:
    """Tell whether a data ID stands in any table of docs/protocol.md."""
    return data_id in _KNOWN


def decode(data_id: int, data: bytes) -> Fields:
    """Decode the eight data bytes of one reply; an ID whose bytes nobody has explained has no values."""
    decoder = DECODERS.get(data_id)
    if decoder:
        return decoder(data)
    if data_id in alarms.IDS:
        return alarms.decode(data_id, data)
    if data_id in writes.SWITCHES:
        return writes.switched(data_id, data)
    return settings.decode(data_id, data)
