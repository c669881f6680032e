# SPDX-License-Identifier: GPL-2.0-or-later
"""HKMS, the CAN dialect of boards from about 2025: registers streamed by every board (docs/protocol.md, c.2).

    bit   28 ........ 16         15 .. 8         7 .. 0
        | register, 13 bits | destination | source |       board: its number; host: 80

    0400FF80   keep-alive, every 1 or 2 s: while it comes, every board sends 0400 to 040E by itself
    182A ..    writes of the host

The vendor's sheet is known from programs that read it (040E and the writes from one alone), and no capture is public.
Nobody asks, so nothing is unasked.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref import addresses, bursts, can_hkms_faults, cells, parts
from dalyref.bursts import Burst
from dalyref.can_classic import is_board, is_host
from dalyref.slate import Slate
from dalyref.values import put

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.options import Options
    from dalyref.packet import CanFrame
    from dalyref.streams import Located
    from dalyref.values import Fields, Value

KEEP_ALIVE: Final = 0x0400FF80
STREAMED: Final = range(0x0400, 0x040F)
CELLS, SENSORS, COUNTS = 0x0400, 0x0401, 0x0408
CHARGE_MOS, DISCHARGE_MOS, SOC_POWER, SOC_ENERGY = 0x182A, 0x182C, 0x161E, 0x181E
WRITES: Final = frozenset((CHARGE_MOS, DISCHARGE_MOS, SOC_POWER, SOC_ENERGY))

_BURSTS = {CELLS: cells.CELLS, SENSORS: cells.TEMPERATURES}
"""Whose frames they are laid out as."""
_MOST_BOARDS = 256


def register(identifier: int) -> int:
    """Return the register of an identifier."""
    return identifier >> 16


def is_streamed(identifier: int) -> bool:
    """Tell whether it is a register that a board sends by itself (Deye's frames have the same shape)."""
    return register(identifier) in STREAMED and is_board(identifier & 0xFF)


def is_write(identifier: int) -> bool:
    """Tell whether it is a host's write to a board."""
    return register(identifier) in WRITES and is_board(identifier >> 8 & 0xFF) and is_host(identifier & 0xFF)


def _tail(fields: Fields, data: bytes, *more: tuple[int, str, Callable[[int], Value]]) -> Fields:
    """Add values of one byte that shorter frames do not have: (place, name, meaning)."""
    fields.update({f"daly.{name}": meaning(data[at]) for at, name, meaning in more if at < len(data)})
    return fields


def _celsius(raw: int) -> int:
    return raw - 40


def _pack(data: bytes) -> Fields:
    current = int.from_bytes(data[2:4])
    fields: Fields = {
        "daly.pack.voltage": int.from_bytes(data[:2]) / 10,
        "daly.pack.current_raw": current,
        "daly.pack.current": (current - 30000) / 10,
        "daly.soc": int.from_bytes(data[4:6]) / 10,
    }
    return _tail(fields, data, (6, "life", int))


def _power(data: bytes) -> Fields:
    fields: Fields = {
        "daly.power": int.from_bytes(data[:2]),
        "daly.energy": int.from_bytes(data[2:4]),
        "daly.temperature.mos": _celsius(data[4]),
        "daly.temperature.board": _celsius(data[5]),
    }
    return _tail(fields, data, (6, "temperature.heater", _celsius), (7, "heater.current", int))


def _cell_extremes(data: bytes) -> Fields:
    return {
        "daly.cell.max_voltage": int.from_bytes(data[:2]),
        "daly.cell.max_number": data[2],
        "daly.cell.min_voltage": int.from_bytes(data[3:5]),
        "daly.cell.min_number": data[5],
        "daly.cell.difference": int.from_bytes(data[6:8]),
    }


def _temperature_extremes(data: bytes) -> Fields:
    fields: Fields = {
        "daly.temperature.max": _celsius(data[0]),
        "daly.temperature.max_number": data[1],
        "daly.temperature.min": _celsius(data[2]),
        "daly.temperature.min_number": data[3],
    }
    return _tail(fields, data, (4, "temperature.difference", int))


def _mos(data: bytes) -> Fields:
    fields: Fields = {
        "daly.mos.charge": bool(data[0]),
        "daly.mos.discharge": bool(data[1]),
        "daly.mos.precharge": bool(data[2]),
    }
    return _tail(fields, data, (3, "heater", bool), (4, "fan", bool))


def _state(data: bytes) -> Fields:
    return _tail({"daly.state": data[0]}, data, (1, "charger", int), (2, "load", int))


def _counts(data: bytes) -> Fields:
    return {
        "daly.cell_count": data[0],
        "daly.sensor_count": data[1],
        "daly.remaining_capacity": int.from_bytes(data[2:6]),  # mAh
        "daly.cycles": int.from_bytes(data[6:8]),
    }


def _balance(data: bytes) -> Fields:
    mask = int.from_bytes(data[4:8], "little")
    fields: Fields = {
        "daly.balance.state": data[0],
        "daly.balance.current": int.from_bytes(data[2:4]) - 30000,  # mA
        "daly.balance.mask": mask,
    }
    put(fields, "daly.balance.cell", [cell + 1 for cell in range(32) if mask >> cell & 1])
    return fields


def _charge(data: bytes) -> Fields:
    fields: Fields = {"daly.time_to_full": int.from_bytes(data[:2])}
    for woken in data[2:3]:
        fields.update({f"daly.wakeup.{name}": bool(woken >> bit & 1) for bit, name in enumerate(_WAKEUPS)})
    return fields


def _limits(data: bytes) -> Fields:
    return {
        "daly.limit.active": bool(data[0]),
        "daly.limit.current": (int.from_bytes(data[1:3]) - 30000) / 10,
        "daly.soh": int.from_bytes(data[3:5]),
        "daly.limit.duty": int.from_bytes(data[5:7]) / 10,
    }


def _fault_block(data: bytes) -> Fields:
    page = data[0]
    known = can_hkms_faults.block(page, data[1:]) if page in (1, 2) else {}
    return {"daly.frame_number": page, **known}


_WAKEUPS = ("key", "button", "rs485", "can", "current")
_DECODERS: dict[int, tuple[int, Callable[[bytes], Fields]]] = {
    0x0402: (6, _pack),
    0x0403: (6, _power),
    0x0404: (8, _cell_extremes),
    0x0405: (4, _temperature_extremes),
    0x0406: (3, _mos),
    0x0407: (1, _state),
    COUNTS: (8, _counts),
    0x0409: (8, can_hkms_faults.info),
    0x040A: (8, _balance),
    0x040B: (2, _charge),
    0x040D: (7, _limits),
    0x040E: (8, _fault_block),
}
"""By register: how many bytes it needs, and what they are. 040C, the clock: no layout is known."""


def written(number: int, data: bytes) -> Fields:
    """Return what a write to a register would set."""
    value = int.from_bytes(data[:2])
    if number == CHARGE_MOS:
        return {"daly.setting.mos_charge": value != 0}
    if number == DISCHARGE_MOS:
        return {"daly.setting.mos_discharge": value != 0}
    return {"daly.setting.soc": value / 10}


class Hkms:
    """What is remembered of the boards of one bus: how many cells they have, and the bursts that run."""

    def __init__(self, options: Options) -> None:
        self.now_ns = 0
        self._quiet_ns = options.limit_ns(options.burst)
        self._counts: dict[int, dict[int, int]] = {}  # by source: register 0400, 0401 -> cells, sensors
        self._running: dict[tuple[int, int], Burst[Slate]] = {}  # by register and source

    def frame(self, located: Located, frame: CanFrame, fields: Fields) -> Slate:
        """Take a frame of this dialect: add what it means to its `fields`, and to those of records before it."""
        slate = Slate(fields, self)
        number, destination, source = frame.identifier >> 16, frame.identifier >> 8 & 0xFF, frame.identifier & 0xFF
        asks = is_host(source)
        fields["daly.direction"] = addresses.REQUEST if asks else addresses.REPLY
        board = destination if asks else source
        if is_board(board):
            fields["daly.board"] = board
        data = frame.data
        if asks and number in WRITES:
            fields["daly.write"] = True
            if len(data) >= 2:
                fields.update(written(number, data))
        elif not asks and number in _BURSTS:
            if len(data) == 8:
                self._part(located, number, source, data, slate)
        elif not asks and number in _DECODERS:
            needed, decode = _DECODERS[number]
            if len(data) >= needed:
                fields.update(decode(data))
                if number == COUNTS:
                    self._take_counts(source, data)
        return slate

    def settle(self, slate: Slate, latest_ns: int) -> None:
        """Nothing more shall come to this record (``slate.Owner``)."""
        burst = slate.burst
        if burst is not None:
            key = next((key for key, running in self._running.items() if running is burst), None)
            if key is not None:
                del self._running[key]
            parts.end(burst, known=latest_ns > slate.waits_until())
        slate.close()

    def _take_counts(self, source: int, data: bytes) -> None:
        if source not in self._counts and len(self._counts) >= _MOST_BOARDS:
            return
        known = self._counts.setdefault(source, {})
        if 1 <= data[0] <= cells.MOST_CELLS:
            known[CELLS] = data[0]
        if 1 <= data[1] <= cells.MOST_SENSORS:
            known[SENSORS] = data[1]

    def _part(self, located: Located, number: int, source: int, data: bytes, slate: Slate) -> None:
        """Take one frame of several: they end each other by their numbers and by quiet alone."""
        page, data_id, key = data[0], _BURSTS[number], (number, source)
        if page == 0 or bursts.skipped(data_id, page, 1):
            parts.skip(data_id, data, slate)
            return
        burst = self._running.get(key)
        if burst is not None and (page <= burst.last or located.start_ns - burst.end_ns > self._quiet_ns):
            parts.end(burst)
            burst = None
        if burst is None:
            count = self._counts.get(source, {}).get(number, 0)
            burst = self._running[key] = Burst(data_id, source, 1, count, 0, slate)
        parts.take(burst, located, data, slate, self._quiet_ns)
