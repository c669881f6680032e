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
    99   on    current     place .     .     .     .         balance; 9A SOH, D8 wake-up source
    50 .. 6A   settings and texts: settings.py;  70 .. 8A   alarm grid, where the firmware has one
    9C, 9D     made up for practice: undocumented.py
    10 .. 2A   writes = read - 40, answered with the same bytes (field notes a.3);  00   restart, not answered
    D9   discharge MOS on, off;  DA charge MOS on, off: 01 on, 00 off, answered with the new state (fact 7)

A dot is a byte the paper calls reserved. What old boards leave there (fact 2) is the default here:
91 d6-7 = SOC of the last 90; 92 d4-7 = d4-7 of the last 91; 94 d7, 95 d7 and 96 d7 (unless it is a sensor) = low byte
of the last 93's capacity; slots behind the last cell = the same slots of the frame before; D9, DA d1-7 = those of the
last 94 or 95.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, NamedTuple

from dalytools.simulator import modbus, undocumented
from dalytools.simulator.registers import ABSENT, CLOCKS, MOS_SWITCHES, SETTINGS, SOC_WRITES, Measured, d2, p81
from dalytools.simulator.settings import TEXT_FRAMES, WRITE_OFFSET, Settings
from dalytools.simulator.undocumented import Undocumented

if TYPE_CHECKING:
    from dalytools.simulator.battery import Battery, Reading
    from dalytools.simulator.scenario import Asleep, Board, Dialect

START, LENGTH = 0xA5, 8
FRAME_BYTES = 13
CELLS_A_FRAME, SENSORS_A_FRAME = 3, 7
CELL_FRAMES = 16  # of 0x95, to a host with address 0x80, whatever the number of cells (fact 6)
HOST_PC, HOST_APP, HOST_GPRS = 0x40, 0x80, 0x20

WRITE_IDS = range(0x10, 0x2B)
SET_CLOCK_AND_SOC = 0x21
RESTART = 0x00
RESTART_S = 3.0  # field notes a.3

_NOTHING = bytes(8)
_EPOCH = datetime(2026, 1, 1, tzinfo=UTC)

# Which reply carries which contradiction (docs/records.md, 11)
LIE_IDS = {
    "pack_voltage": 0x90,
    "soc": 0x90,
    "cell_max": 0x91,
    "cell_min": 0x91,
    "cell_number": 0x91,
    "temperature_max": 0x92,
    "temperature_min": 0x92,
    "sensor_number": 0x92,
}


class Answer(NamedTuple):
    """What a board sends to a request, and how long (ms) after the request's end it begins. Frames back to back."""

    delay_ms: float
    frames: list[bytes]


def frame(address: int, data_id: int, payload: bytes) -> bytes:
    """Build a whole frame of 13 bytes from its address, data ID and 8 data bytes."""
    total = START + address + data_id + LENGTH + sum(payload)
    return bytes((START, address, data_id, LENGTH, *payload, total & 0xFF))


def is_request(data: bytes) -> bool:
    """Whether these bytes are a whole, undamaged A5 frame from a host (address 0x20 and up, field notes, fact 3)."""
    return (
        len(data) == FRAME_BYTES
        and data[0] == START
        and data[3] == LENGTH
        and data[1] >= 0x20
        and sum(data[:12]) & 0xFF == data[12]
    )


def request_length(data: bytes) -> int:
    """Length of the good request, of any dialect, that begins these bytes; 0 where there is none."""
    return FRAME_BYTES if is_request(data[:FRAME_BYTES]) else modbus.request_length(data)


def may_become_request(data: bytes) -> bool:
    """Whether these bytes begin like a request that is not whole yet."""
    if not data:
        return False
    if data[0] == START:
        return len(data) < FRAME_BYTES
    return modbus.may_become_request(data)


def writes(request: bytes) -> bool:
    """Whether a good request changes something."""
    if request[0] == START:
        return request[2] in WRITE_IDS or request[2] in {RESTART, 0xD9, 0xDA}
    return request[1] != modbus.READ


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
        self.settings = Settings(board, battery)
        self.now_s = 0.0  # of bus time, set by the bus
        self.lies: set[str] = set()  # names of Lie, for the next answer
        self.silent_until_s = 0.0  # while it restarts
        self.start = _EPOCH  # its clock at bus time 0
        self._zero_left = 0
        self._life = 0
        self._soc = b"\0\0"  # of the last 0x90 as sent
        self._tail_91 = bytes(4)
        self._capacity_low = 0
        self._undocumented = Undocumented()
        self._behind_switch = bytes(7)  # d1..d7 of the last 0x94 or 0x95

    def wake(self) -> None:
        """Wake up; the first replies will be all zero."""
        if self.asleep:
            self.asleep = ""
            self._zero_left = self.board.habits.zero_replies

    @property
    def zero_replies_left(self) -> int:
        """How many of the next replies will be all zero."""
        return self._zero_left

    def listens_to(self, request: bytes) -> bool:
        """Whether a good request is for this board, whatever it then says."""
        dialects = self.board.dialects
        if request[0] == START:
            return "a5" in dialects and request[1] in self._addresses
        if request[0] == modbus.D2:
            return "d2" in dialects
        return "81" in dialects and request[0] == modbus.ASKS_81 + self.board.number

    def answer(self, request: bytes) -> Answer | None:
        """Answer a good request, or None: not for this board, an unknown ID, or fast asleep."""
        if self.now_s < self.silent_until_s:
            return None
        if not self.listens_to(request):
            return None
        if request[0] != START:
            return self._answer_modbus(request)
        habits = self.board.habits
        if self.asleep:
            return Answer(habits.echo_ms, [request]) if self.asleep == "echo" else None
        data_id = request[2]
        if data_id in habits.unanswered or (habits.writes == "silent" and writes(request)):
            return None
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
            case 0x99:
                active = (reading.balance_mask & -reading.balance_mask).bit_length()
                return [bytes((active > 0,)) + (30000).to_bytes(2) + bytes((active,)) + bytes(4)]
            case 0x9A:
                return [b"\0\x64" + bytes(6)]
            case undocumented.VALUES | undocumented.LETTERS if self.board.habits.undocumented:
                return [self._practice(data_id, reading)]
            case 0xD9 | 0xDA:
                return [self._switch(data_id, request[4])]
            case _:
                return self._setting(data_id, request[4:12])

    def _practice(self, data_id: int, reading: Reading) -> bytes:
        balancer = self.settings.values["balancer"] != 0
        current = int.from_bytes(self._pack(reading)[4:6])
        return self._undocumented.payload(data_id, current, balancer=balancer, now_s=self.now_s)

    def settable(self, data_id: int) -> bool:
        """Whether a write with this ID changes something here."""
        return data_id in {RESTART, 0xD9, 0xDA, SET_CLOCK_AND_SOC} or (
            data_id in WRITE_IDS and self.settings.payload(data_id + WRITE_OFFSET) is not None
        )

    def _setting(self, data_id: int, payload: bytes) -> list[bytes]:
        """Answer a read or a write of settings, texts and the clock; nothing for what it does not know."""
        settings, habits = self.settings, self.board.habits
        if data_id == SET_CLOCK_AND_SOC:
            taken = habits.writes == "accept" and not self._zero_left
            if taken:
                self._set_clock(payload[:6])
                self.battery.set_soc(int.from_bytes(payload[6:8]))
            return [bytes((taken or habits.writes == "pretend",)) + self._reserved(self._behind_switch)]
        if data_id == RESTART:
            if habits.writes == "accept":
                self.silent_until_s = self.now_s + RESTART_S
            return []
        if data_id in WRITE_IDS and settings.payload(data_id + WRITE_OFFSET) is not None:
            if habits.writes == "accept" and not self._zero_left:
                settings.take(data_id + WRITE_OFFSET, payload)
                return [payload]
            return [payload if habits.writes == "pretend" else settings.payload(data_id + WRITE_OFFSET) or _NOTHING]
        if data_id in TEXT_FRAMES:
            return settings.text_payloads(data_id, habits.frame_base)
        if data_id == 0x52:
            reading = self.battery.reading
            return [reading.charged_ah.to_bytes(4) + reading.discharged_ah.to_bytes(4)]
        if data_id == 0x54:
            return [settings.texts.firmware_index.encode("ascii", "replace")[:8].ljust(8, b"\0")]
        if data_id == 0x61:
            return [self._clock() + b"\0\0"]
        if 0x70 <= data_id <= 0x8A and habits.alarm_grid:
            return [self._alarm(data_id)]
        known = settings.payload(data_id)
        return [] if known is None else [known]

    def _clock(self) -> bytes:
        now = self.start + timedelta(seconds=int(self.now_s))
        return bytes((now.year % 100, now.month, now.day, now.hour, now.minute, now.second))

    def _set_clock(self, said: bytes) -> None:
        """Take year, month .. second; zeros mean that only the SOC is written (field notes a.3)."""
        if not any(said):
            return
        try:
            now = datetime(2000 + said[0], *said[1:6], tzinfo=UTC)
            self.start = now - timedelta(seconds=int(self.now_s))
        except (ValueError, OverflowError):
            return  # no such day

    def _alarm(self, data_id: int) -> bytes:
        """One cell of the alarm grid: ID = 70 + 9 x (level - 1) + class; the third level is the second's."""
        level, kind = divmod(data_id - 0x70, 9)
        values = self.settings.values
        level = min(2, level + 1)
        delay = 500  # 0.01 s
        if kind == 2:
            discharge = 30000 + values[f"discharge_current_{level}"]
            charge = 30000 + values[f"charge_current_{level}"]
            return b"".join(word.to_bytes(2) for word in (discharge, delay, charge, delay))
        if kind in {3, 4}:
            side = "high" if kind == 3 else "low"
            limit = values[f"charge_temp_{side}_{level}"] + 40
            back = limit - 3 if kind == 3 else limit + 3
            return bytes((limit, 5, back, 5, limit, 5, back, 5))
        name = {
            0: "cell_high",
            1: "cell_low",
            5: "pack_high",
            6: "pack_low",
            7: "cell_difference",
            8: "temp_difference",
        }
        limit = values[f"{name[kind]}_{level}"]
        back = limit + limit // 50 if kind in {1, 6} else limit - limit // 50
        return b"".join(word.to_bytes(2) for word in (limit, delay, back, delay))

    def registers(self, dialect: Dialect) -> dict[int, int]:
        """All registers that it has in this Modbus dialect, as they stand now; all zero just after waking up."""
        habits = self.board.habits
        soc_off = -50 if "soc" in self.lies else 0
        now = Measured(
            self.battery.reading, self.settings, self._clock(), habits.reserved, habits.discharge_high, soc_off
        )
        words = d2(now) if dialect == "d2" else p81(now)
        return dict.fromkeys(words, 0) if self._zero_left else words

    def _answer_modbus(self, data: bytes) -> Answer | None:
        request = modbus.parse(data)
        if request is None or self.asleep:  # Modbus knows no echo
            return None
        dialect: Dialect = "d2" if request.address == modbus.D2 else "81"
        habits = self.board.habits
        if request.writes and habits.writes == "silent":
            return None
        if not request.writes:
            words = self.registers(dialect)
            values = [words.get(request.register + place, ABSENT) for place in range(request.count)]
        else:
            if habits.writes == "accept" and not self._zero_left:
                for place, value in enumerate(request.values):
                    self._write_register(dialect, request.register + place, value)
                self._write_clock(dialect, request)
                values = list(request.values)
            elif habits.writes == "pretend":
                values = list(request.values)
            else:
                old = self.registers(dialect).get(request.register, ABSENT)
                values = [old, *request.values[1:]]
            self.battery.refresh()
        self._zero_left = max(0, self._zero_left - 1)
        return Answer(habits.reply_ms, [modbus.reply(request, values)])

    def _write_register(self, dialect: Dialect, register: int, value: int) -> None:
        charge, discharge = MOS_SWITCHES[dialect]
        if register == charge:
            self.battery.charge_mos = bool(value)
        elif register == discharge:
            self.battery.discharge_mos = bool(value)
        elif register == SOC_WRITES[dialect]:
            self.battery.set_soc(value)
        elif dialect == "d2" and register in {0xF0, 0xF3}:
            self.silent_until_s = self.now_s + RESTART_S
        elif setting := SETTINGS[dialect].get(register):
            self.settings.values[setting.name] = (value - setting.offset) * setting.scale

    def _write_clock(self, dialect: Dialect, request: modbus.Request) -> None:
        if request.register == CLOCKS[dialect] and request.count >= 3:
            self._set_clock(b"".join(value.to_bytes(2) for value in request.values[:3]))

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
        soc, pack_dv = reading.soc_permille, reading.pack_dv
        if self.lies:
            soc = max(0, soc - 50) if "soc" in self.lies else soc
            pack_dv = pack_dv * 21 // 20 if "pack_voltage" in self.lies else pack_dv
        self._soc = soc.to_bytes(2)
        return pack_dv.to_bytes(2) + b"\0\0" + min(65535, max(0, current)).to_bytes(2) + self._soc

    def _cell_extremes(self, reading: Reading) -> bytes:
        cells = reading.cells_mv
        high, low = max(cells), min(cells)
        numbers = [cells.index(high) + 1, cells.index(low) + 1]
        if self.lies:
            high = high + 100 if "cell_max" in self.lies else high
            low = low - 100 if "cell_min" in self.lies else low
            numbers[0] = len(cells) + 1 if "cell_number" in self.lies else numbers[0]
        payload = b"".join(
            (
                high.to_bytes(2),
                bytes((numbers[0],)),
                low.to_bytes(2),
                bytes((numbers[1],)),
                self._reserved(self._soc),
            )
        )
        self._tail_91 = payload[4:]
        return payload

    def _temperature_extremes(self, reading: Reading) -> bytes:
        sensors = reading.sensors_c
        high, low = max(sensors), min(sensors)
        values = [_celsius(high), sensors.index(high) + 1, _celsius(low), sensors.index(low) + 1]
        if self.lies:
            values[0] = _celsius(high + 10) if "temperature_max" in self.lies else values[0]
            values[2] = _celsius(low - 10) if "temperature_min" in self.lies else values[2]
            values[1] = len(sensors) + 1 if "sensor_number" in self.lies else values[1]
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
        if value in {0, 1} and not self._zero_left and self.board.habits.writes == "accept":
            if data_id == 0xD9:
                self.battery.discharge_mos = bool(value)
            else:
                self.battery.charge_mos = bool(value)
            self.battery.refresh()
        state = self.battery.discharge_mos if data_id == 0xD9 else self.battery.charge_mos
        if value in {0, 1} and self.board.habits.writes == "pretend":
            state = bool(value)
        return bytes((state,)) + self._reserved(self._behind_switch)


def _celsius(degrees: int) -> int:
    return min(255, max(0, degrees + 40))
