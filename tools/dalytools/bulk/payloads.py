# SPDX-License-Identifier: GPL-2.0-or-later
"""Eight data bytes to values, for many frames of one ID at once: 90 to 94, 97, 98 (the layouts: dalyref.payload).

Other IDs come seldom and say the same again and again: each of their payloads that is different is decoded by the
plain decoder, once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import faults, payload, writes
from dalytools.bulk.columns import Column

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.values import Fields, Value
    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints

Columns = dict[str, Column]


def _u16(data: Bytes, at: int) -> Ints:
    return data[:, at].astype(np.int64) << 8 | data[:, at + 1]


def _u32(data: Bytes, at: int) -> Ints:
    return _u16(data, at) << 16 | _u16(data, at + 2)


def _pack(data: Bytes) -> Columns:
    current = _u16(data, 4)
    return {
        "daly.pack.voltage": Column(_u16(data, 0) / 10),
        "daly.pack.gather_voltage": Column(_u16(data, 2) / 10),
        "daly.pack.current": Column((current - 30000) / 10),
        "daly.pack.current_raw": Column(current),
        "daly.soc": Column(_u16(data, 6) / 10),
    }


def _cell_extremes(data: Bytes) -> Columns:
    return {
        "daly.cell.max_voltage": Column(_u16(data, 0)),
        "daly.cell.max_number": Column(data[:, 2]),
        "daly.cell.min_voltage": Column(_u16(data, 3)),
        "daly.cell.min_number": Column(data[:, 5]),
    }


def _temperature_extremes(data: Bytes) -> Columns:
    return {
        "daly.temperature.max": Column(data[:, 0].astype(np.int64) - 40),
        "daly.temperature.max_number": Column(data[:, 1]),
        "daly.temperature.min": Column(data[:, 2].astype(np.int64) - 40),
        "daly.temperature.min_number": Column(data[:, 3]),
    }


def _mos(data: Bytes) -> Columns:
    return {
        "daly.state": Column(data[:, 0]),
        "daly.mos.charge": Column(data[:, 1] != 0),
        "daly.mos.discharge": Column(data[:, 2] != 0),
        "daly.life": Column(data[:, 3]),
        "daly.remaining_capacity": Column(_u32(data, 4)),
    }


def _status(data: Bytes) -> Columns:
    pins = ("di1", "di2", "di3", "di4", "do1", "do2", "do3", "do4")
    return {
        "daly.cell_count": Column(data[:, 0]),
        "daly.sensor_count": Column(data[:, 1]),
        "daly.charger": Column(data[:, 2]),
        "daly.load": Column(data[:, 3]),
        **{"daly." + name: Column(data[:, 4] & np.uint8(1 << bit) != 0) for bit, name in enumerate(pins)},
        "daly.cycles": Column(_u16(data, 5)),
    }


def _balance(data: Bytes) -> Columns:
    mask = sum(data[:, at].astype(np.int64) << 8 * at for at in range(6))
    return {
        "daly.balance.mask": Column(np.asarray(mask, np.int64)),
        "daly.balance.active_cell": Column(data[:, 1]),
    }


def _faults(data: Bytes) -> Columns:
    some = bool(data[:, :7].any())
    bits: Flags = np.zeros((8 * data.shape[1], len(data)), np.bool_)
    if some:
        bits[:] = np.unpackbits(data, axis=1, bitorder="little").T
    columns = {name: Column(bits[at]) for at, name in _FAULTS}
    columns["daly.fault_code"] = Column(data[:, 7])
    columns["daly.fault_count"] = Column(bits[_COUNTED].sum(0) if some else np.zeros(len(data), np.int64))
    return columns


_FAULTS: Final = [
    (8 * byte + bit, faults.PREFIX + name) for byte, row in enumerate(faults.TABLE) for bit, name in enumerate(row)
]
_COUNTED: Final = [at for at, _ in _FAULTS if at not in {52, 53}]
"""Without bits 4 and 5 of byte 6, which are not among the paper's faults."""
_AT_ONCE: Final[dict[int, Callable[[Bytes], Columns]]] = {
    0x90: _pack,
    0x91: _cell_extremes,
    0x92: _temperature_extremes,
    0x93: _mos,
    0x94: _status,
    0x97: _balance,
    0x98: _faults,
}
LEFT_OUT: Final = frozenset(("daly.reserved", "daly.balance.cell"))
"""Fields of single replies that have no column: reserved bytes stand in the frame, the cells in the mask."""


def of_replies(data_id: int, data: Bytes) -> Columns:
    """Return the values of replies with one ID. data: N x 8."""
    at_once = _AT_ONCE.get(data_id)
    return at_once(data) if at_once else _each_once(data, lambda content: payload.decode(data_id, content))


def of_writes(data_id: int, data: Bytes) -> Columns:
    """Return what requests with one ID, which writes, would set. data: N x 8."""
    return _each_once(data, lambda content: writes.would_set(data_id, content))


def _each_once(data: Bytes, decode: Callable[[bytes], Fields]) -> Columns:
    wide = np.ascontiguousarray(data).view(np.uint64)[:, 0]
    if (wide == wide[0]).all():
        different, which = wide[:1], np.zeros(len(wide), np.int64)
    else:
        different, which = np.unique(wide, return_inverse=True)
    found = [decode(one.tobytes()) for one in different]
    names = dict.fromkeys(name for fields in found for name in fields if name not in LEFT_OUT)
    return {name: _expanded([fields.get(name) for fields in found], which) for name in names}


def _expanded(values: list[Value | list[Value] | None], which: Ints) -> Column:
    """Make a column of the values of different payloads, and of which row has which."""
    some = next(value for value in values if value is not None)
    present: Flags = np.array([value is not None for value in values], np.bool_)
    spread: Array
    if isinstance(some, str):
        spread = np.array([value if value is not None else "" for value in values], object)
    else:
        spread = np.array([value if value is not None else type(some)() for value in values])
    return Column(spread[which], None if present.all() else present[which])
