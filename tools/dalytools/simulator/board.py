# SPDX-License-Identifier: GPL-2.0-or-later
"""One BMS on the bus: a request comes in, reply frames go out, with the habits of real boards.

    A5  addr  id  08  d0 d1 d2 d3 d4 d5 d6 d7  sum      13 bytes; sum = low byte of the sum of the twelve before

    id   d0    d1    d2    d3    d4    d5    d6    d7        (paper, section 3; field notes a.1)
    90   pack 0.1 V  gather 0    current     SOC 0.1 %       current: 30000 + 0.1 A
    91   max mV      cell  min mV      cell  .     .
    92   max   no    min   no    .     .     .     .         40 + C
    93   state chg   dis   life  remaining mAh
    94   cells temps chgr  load  DI/DO cycles      .
    95   frame cell mV     cell mV     cell mV     .         one frame for three cells
    96   frame 40 + C of seven sensors
    97   mask, cell 1 = d0 bit 0             .     .
    98   fault bits                                code
    D8   wake-up source
    D9   discharge MOS on, off;  DA charge MOS on, off: 01 on, 00 off, answered with the new state (fact 7)

A dot is a byte the paper calls reserved. What old boards leave there (fact 2) is the default here:
91 d6-7 = SOC of the last 90; 92 d4-7 = d4-7 of the last 91; 94 d7, 95 d7 and 96 d7 (unless it is a sensor) = low byte
of the last 93's capacity; slots behind the last cell = the same slots of the frame before; D9, DA d1-7 = those of the
last 94 or 95.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dalytools.simulator.battery import Battery, Reading
    from dalytools.simulator.scenario import Asleep, Board

START, LENGTH = 0xA5, 8
FRAME_BYTES = 13
CELLS_A_FRAME, SENSORS_A_FRAME = 3, 7
CELL_FRAMES = 16  # of 0x95, to a host with address 0x80, whatever the number of cells (fact 6)
HOST_PC, HOST_APP, HOST_GPRS = 0x40, 0x80, 0x20

_NOTHING = bytes(8)


class Answer(NamedTuple):
    """What a board sends to a request, and how long (ms) after the request's end it begins. Frames back to back."""

    delay_ms: float
    frames: list[bytes]


def frame(address: int, data_id: int, payload: bytes) -> bytes:
    """Build a whole frame of 13 bytes from its address, data ID and 8 data bytes."""
    total = START + address + data_id + LENGTH + sum(payload)
    return bytes((START, address, data_id, LENGTH, *payload, total & 0xFF))


def is_request(data: bytes) -> bool:
    """Whether these bytes are a whole, undamaged frame from a host (address 0x20 and up, field notes, fact 3)."""
    return (
        len(data) == FRAME_BYTES
        and data[0] == START
        and data[3] == LENGTH
        and data[1] >= 0x20
        and sum(data[:12]) & 0xFF == data[12]
    )


class SimulatedBoard:
    """The firmware of one board in front of its battery."""

    def __init__(self, board: Board, battery: Battery) -> None:
        self.board = board
        self.battery = battery
        self.asleep: Asleep = board.asleep
        self.battery.forced |= set(board.faults)
        self.battery.refresh()
        self._addresses = {0x3F + board.number}
        if board.number == 1:
            self._addresses |= {HOST_APP, HOST_GPRS}
        self._zero_left = 0
        self._life = 0
        self._soc = b"\0\0"  # of the last 0x90 as sent
        self._tail_91 = bytes(4)
        self._capacity_low = 0
        self._behind_switch = bytes(7)  # d1..d7 of the last 0x94 or 0x95

    def wake(self) -> None:
        """Wake up; the first replies will be all zero."""
        if self.asleep:
            self.asleep = ""
            self._zero_left = self.board.habits.zero_replies

    def answer(self, request: bytes) -> Answer | None:
        """Answer a good request (13 bytes), or None: not for this board, an unknown ID, or fast asleep."""
        if request[1] not in self._addresses:
            return None
        habits = self.board.habits
        if self.asleep:
            return Answer(habits.echo_ms, [request]) if self.asleep == "echo" else None
        data_id = request[2]
        payloads = self._payloads(data_id, request)
        if not payloads:
            return None
        if self._zero_left:
            self._zero_left -= 1
            bursts = data_id in {0x95, 0x96}  # a burst still counts its frames
            payloads = [payload[:1] + bytes(7) if bursts else _NOTHING for payload in payloads]
        number = self.board.number
        return Answer(habits.reply_ms, [frame(number, data_id, payload) for payload in payloads])

    def _payloads(self, data_id: int, request: bytes) -> list[bytes]:
        reading = self.battery.reading
        match data_id:
            case 0x90:
                return [self._pack(reading)]
            case 0x91:
                return [self._cell_extremes(reading)]
            case 0x92:
                return [self._temperature_extremes(reading)]
            case 0x93:
                return [self._mos(reading)]
            case 0x94:
                return [self._status(reading)]
            case 0x95:
                return self._cells(reading, everything=request[1] == HOST_APP)
            case 0x96:
                return self._temperatures(reading)
            case 0x97:
                return [reading.balance_mask.to_bytes(6, "little") + self._reserved(b"\0\0")]
            case 0x98:
                return [reading.fault_bytes]
            case 0xD8:
                return [_NOTHING]
            case 0xD9 | 0xDA:
                return [self._switch(data_id, request[4])]
            case _:
                return []

    def _reserved(self, stale: bytes) -> bytes:
        match self.board.habits.reserved:
            case "zero":
                return bytes(len(stale))
            case "ff":
                return b"\xff" * len(stale)
            case _:
                return stale

    def _pack(self, reading: Reading) -> bytes:
        sign = -1 if self.board.habits.discharge_high else 1
        current = 30000 + sign * reading.current_da
        self._soc = reading.soc_permille.to_bytes(2)
        return reading.pack_dv.to_bytes(2) + b"\0\0" + min(65535, max(0, current)).to_bytes(2) + self._soc

    def _cell_extremes(self, reading: Reading) -> bytes:
        cells = reading.cells_mv
        high, low = max(cells), min(cells)
        payload = b"".join(
            (
                high.to_bytes(2),
                bytes((cells.index(high) + 1,)),
                low.to_bytes(2),
                bytes((cells.index(low) + 1,)),
                self._reserved(self._soc),
            )
        )
        self._tail_91 = payload[4:]
        return payload

    def _temperature_extremes(self, reading: Reading) -> bytes:
        sensors = reading.sensors_c
        high, low = max(sensors), min(sensors)
        values = (_celsius(high), sensors.index(high) + 1, _celsius(low), sensors.index(low) + 1)
        return bytes(values) + self._reserved(self._tail_91)

    def _mos(self, reading: Reading) -> bytes:
        self._life = (self._life + 1) & 0xFF
        remaining = reading.remaining_mah.to_bytes(4)
        self._capacity_low = remaining[3]
        return bytes((reading.state, reading.charge_mos, reading.discharge_mos, self._life)) + remaining

    def _status(self, reading: Reading) -> bytes:
        pack = self.board.pack
        di_do = 0x02  # DI2 set: very common (field notes a.1)
        known = bytes((pack.cells, pack.sensors, reading.charger, reading.load, di_do))
        payload = known + min(65535, reading.cycles).to_bytes(2) + self._reserved(bytes((self._capacity_low,)))
        self._behind_switch = payload[1:]
        return payload

    def _cells(self, reading: Reading, *, everything: bool) -> list[bytes]:
        habits = self.board.habits
        slots = b"".join([millivolts.to_bytes(2) for millivolts in reading.cells_mv])
        last = self._reserved(bytes((self._capacity_low,)))
        count = -(-len(reading.cells_mv) // CELLS_A_FRAME)
        if everything:
            count = CELL_FRAMES
            slots = slots.ljust(6 * count, b"\0")
            last = b"\0"
        payloads: list[bytes] = []
        before = bytes(6)
        for index in range(count):
            values = slots[6 * index : 6 * index + 6]
            values += self._reserved(before[len(values) :])
            payloads.append(bytes((index + habits.frame_base,)) + values + last)
            before = values
        self._behind_switch = payloads[-1][1:]
        return payloads

    def _temperatures(self, reading: Reading) -> list[bytes]:
        habits = self.board.habits
        raw = bytes([_celsius(degrees) for degrees in reading.sensors_c])
        payloads: list[bytes] = []
        for index in range(max(habits.sensor_frames, -(-len(raw) // SENSORS_A_FRAME))):
            values = raw[SENSORS_A_FRAME * index : SENSORS_A_FRAME * (index + 1)]
            if not values:
                values = bytes(SENSORS_A_FRAME)  # a frame without a sensor is all zero (tano-96-2)
            elif len(values) < SENSORS_A_FRAME:
                unused = bytes(SENSORS_A_FRAME - 1 - len(values)) + bytes((self._capacity_low,))
                values += self._reserved(unused)
            payloads.append(bytes((index + habits.frame_base,)) + values)
        return payloads

    def _switch(self, data_id: int, value: int) -> bytes:
        if value in {0, 1} and not self._zero_left:
            if data_id == 0xD9:
                self.battery.discharge_mos = bool(value)
            else:
                self.battery.charge_mos = bool(value)
            self.battery.refresh()
        state = self.battery.discharge_mos if data_id == 0xD9 else self.battery.charge_mos
        return bytes((state,)) + self._reserved(self._behind_switch)


def _celsius(degrees: int) -> int:
    return min(255, max(0, degrees + 40))
