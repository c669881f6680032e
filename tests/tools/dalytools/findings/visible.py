# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether a fault that no rule found could be seen on the wire at all: told by the bytes, without the decoder.

Each reason is one of docs/records.md, or an accident of the bytes; what has none is a miss.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, NamedTuple

from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    Note = Mapping[str, object]

WAITS_S = 1.03
"""A request's 13.5 ms, and the second that it waits (docs/records.md 6)."""
LONGEST_S = 0.3
"""Of a frame at 9600 baud: 261 bytes."""
ECHO_S = 0.05
"""Who gives a request back does it so soon; no board answers, and no host asks again (field notes b)."""
SOCKETCAN = 227
NO_BOARD = (0x80, 0x20)
FIRST_REQUEST = 0x20
D2 = 0xD2
BURSTS = frozenset((0x95, 0x96, 0x55, 0x56, 0x57, 0x62, 0x63, 0x6A))
BURST_QUIET_S = 0.5135
RECENT_S = 10.0
"""How old the other side of a contradiction, and a request with a late reply, may be (docs/records.md 7, 11)."""
TABLE_OF = {0x90: 0x95, 0x91: 0x95, 0x92: 0x96}
"""What a reply is held against (docs/records.md 11)."""
SLOTS = {0x95: 3, 0x96: 7}
SAID_BY = {
    "pack_voltage": {0x90, 0x94, 0x95},
    "cell_max": {0x91, 0x94, 0x95},
    "cell_min": {0x91, 0x94, 0x95},
    "cell_number": {0x91, 0x94},
    "temperature_max": {0x92, 0x94, 0x96},
    "temperature_min": {0x92, 0x94, 0x96},
    "sensor_number": {0x92, 0x94},
    "soc": {0x90},
}
"""Contradiction: the IDs that it is told from (docs/records.md 11; 94 tells which slots are cells)."""
STEP_RAW = 10
"""1 A."""
IN_SAME_GAP_S = 0.6
CAPACITY = 0x80
"""First of the settings of D2."""
LAST_MEASURED = 0x3A
"""Of the registers that hold voltage and SOC, in either dialect of Modbus."""


class Frame(NamedTuple):
    """A packet: when it begins, s; of a good A5 frame, on a serial line or CAN, address, data ID and payload."""

    seconds: float
    size: int
    address: int = -1
    data_id: int = -1
    payload: bytes = b""
    first: int = -1
    """The first byte of what is no good A5 frame."""

    @property
    def good(self) -> bool:
        return self.address >= 0


def frames(path: Path, start_ns: int) -> list[Frame]:
    """Return all packets of a capture that hold bytes."""
    out: list[Frame] = []
    for packet in read_capture(path):
        data, seconds = packet.data, (packet.time_ns - start_ns) / 1e9
        if packet.link_type == SOCKETCAN:
            asks = data[3] >= 0x20
            address = (data[3] if data[3] != 0x40 else data[2] + 0x3F) if asks else data[3]
            if data[0] == 0x98 and len(data) == 16:
                out.append(Frame(seconds, 16, address, data[1], data[8:]))
            else:
                out.append(Frame(seconds, len(data)))
        elif len(data) == 13 and data[0] == 0xA5 and sum(data[:12]) & 0xFF == data[12]:
            out.append(Frame(seconds, 13, data[1], data[2], data[4:12]))
        elif data:
            out.append(Frame(seconds, len(data), first=data[0]))
    return out


def hidden(note: Note, heard: list[Frame], notes: list[Note]) -> str:
    """Say why this can't be seen; empty: it can."""
    for what, told, why in (
        ("unanswered", _is_error_frame, "its request is an error frame on CAN"),
        ("unanswered", _answered_otherwise, "another reply of this ID answers it (records.md 7)"),
        ("unanswered", _exception_fits, "an exception of D2 fits each request that waits (wires.md 1)"),
        ("late", _answers_another, "it answers a newer request for this ID (records.md 7)"),
        ("other_board", _answers_another, "it answers a request that names no board (records.md 7)"),
        ("damaged", _good_by_accident, "its bytes are a good frame by accident"),
        ("collision", _good_by_accident, "its bytes are a good frame by accident"),
        ("foreign", _in_damage, "damaged bytes in the same gap, which so is not whole theirs (records.md 4)"),
        ("repeated_frame", _in_damage, "one of the two frames was damaged"),
        ("cut_burst", _in_damage, "what came of it was damaged"),
        ("other_board", _in_damage, "what came of it was damaged"),
        ("zero_reply", _may_be_zero, "registers that may all be zero"),
        ("repeated_frame", _cancelled, "a frame left out and sent twice at once comes once"),
        ("skipped_frame", _cancelled, "a frame left out and sent twice at once comes once"),
        ("late", _taken_before, "another reply was taken for it: a request is given one late reply (records.md 7)"),
        ("contradiction", _no_table, "no whole table of its board to hold it against (records.md 11)"),
        ("contradiction", _load_stepped, "the load stepped next to it, which explains a voltage"),
    ):
        if note["what"] == what and told(note, heard, notes):
            return why
    return ""


def _at(note: Note) -> float:
    return float(str(note["time"]))


def _is_error_frame(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    at = _at(note)
    damaged = any(other["what"] in {"damaged", "collision"} and other["time"] == note["time"] for other in notes)
    return damaged and not _between(heard, at - 1e-6, at + 1e-6)


def _answered_otherwise(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether a reply of the ID comes that no newer request takes: each newer one takes a burst, and no more."""
    asked = int(str(note["address"]))
    at = _at(note)
    newer: list[int] = []
    last_at = {asked: at}
    burst: Frame | None = None
    for frame in _between(heard, at + 1e-3, at + WAITS_S):
        if frame.data_id != note.get("data_id"):
            burst = None if 0 <= frame.address < FIRST_REQUEST else burst
        elif frame.address < FIRST_REQUEST:
            goes_on, burst = burst is not None and _goes_on(burst, frame), frame
            takers = [index for index, address in enumerate(newer) if _takes(address, frame.address)]
            if goes_on:
                continue
            if not takers and _takes(asked, frame.address):
                return True
            if takers:
                del newer[takers[-1]]
        elif frame.seconds > last_at.get(frame.address, -1.0) + ECHO_S:
            newer.append(frame.address)
            last_at[frame.address] = frame.seconds
    return False


def _exception_fits(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    at = _at(note)
    of_d2 = any(frame.first == D2 for frame in _between(heard, at - 1e-6, at + 1e-6))
    return of_d2 and any(other["what"] == "modbus_exception" and 0 < _at(other) - at < WAITS_S for other in notes)


def _takes(asked: int, replies: int) -> bool:
    """Tell whether a request to that address takes a reply of that one: 41..4F are for one board (records.md 7)."""
    return asked - 0x3F == replies or not 0x41 <= asked <= 0x4F


def _goes_on(before: Frame, frame: Frame) -> bool:
    """Tell whether two replies of an ID are of one burst (records.md 8); the same number twice may be two bursts."""
    return (
        frame.data_id in BURSTS
        and (frame.address, frame.data_id) == (before.address, before.data_id)
        and frame.seconds - before.seconds < BURST_QUIET_S
        and frame.payload[0] > before.payload[0]
    )


def _answers_another(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    asked = {*NO_BOARD, 0x3F + int(str(note["board"]))}
    before = _between(heard, _at(note) - WAITS_S, _at(note))
    return any(frame.data_id == note.get("data_id") and frame.address in asked for frame in before)


def _good_by_accident(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return all(frame.good for frame in _there(note, heard))


def _there(note: Note, heard: list[Frame]) -> list[Frame]:
    """Return the packets at the time of a note."""
    at = _at(note)
    return [frame for frame in _between(heard, at - LONGEST_S, at + 1e-3) if frame.seconds + frame.size / 960 > at]


def _in_damage(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return any(
        other is not note
        and other["what"] in {"damaged", "collision", "foreign"}
        and abs(_at(other) - _at(note)) < IN_SAME_GAP_S
        for other in notes
    )


def _may_be_zero(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return "register" in note and int(str(note["register"])) > LAST_MEASURED and note["register"] != CAPACITY


def _cancelled(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether the frame was both left out and doubled, and comes once."""
    other = {"repeated_frame": "skipped_frame", "skipped_frame": "repeated_frame"}[str(note["what"])]
    same = ("time", "board", "data_id", "frame")
    both = any(one["what"] == other and all(one[key] == note[key] for key in same) for one in notes)
    burst = [
        frame
        for frame in _between(heard, _at(note) - 1e-3, _at(note) + BURST_QUIET_S)
        if (frame.address, frame.data_id) == (note["board"], note["data_id"]) and frame.payload[0] == note["frame"]
    ]
    return both and len(burst) == 1


def _taken_before(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return any(
        other["what"] == "other_board"
        and (other["board"], other["data_id"]) == (note["board"], note.get("data_id"))
        and 0 < _at(note) - _at(other) < RECENT_S
        for other in notes
    )


def _no_table(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether neither the newest table before it nor the first one behind it is near, whole and not of zeros.

    One behind another reply of its ID is held against that.
    """
    data_id, at = int(str(note["data_id"])), _at(note)
    if data_id not in TABLE_OF or note["name"] in {"cell_number", "sensor_number"}:
        return False
    mine = [frame for frame in heard if frame.address == note["board"]]
    tables = _tables(mine, TABLE_OF[data_id])
    before = [table for table in tables if table.whole < at]
    behind = [table for table in tables if table.whole >= at]
    again = min((frame.seconds for frame in mine if frame.data_id == data_id and frame.seconds >= at), default=1e9)
    near_before = bool(before) and at - before[-1].whole < RECENT_S and before[-1].some
    near_behind = bool(behind) and behind[0].whole - at < RECENT_S and behind[0].whole < again and behind[0].some
    return not near_before and not near_behind


class Table(NamedTuple):
    """A table of one board: when it begins and when it is whole, s; whether anything but zeros is in it."""

    begins: float
    whole: float
    some: bool


def _tables(mine: list[Frame], data_id: int) -> list[Table]:
    """Return one board's tables that became whole."""
    out: list[Table] = []
    count = following = 0
    begins = 0.0
    some = False
    before: Frame | None = None
    for frame in mine:
        if frame.data_id == 0x94:
            count = frame.payload[0 if data_id == 0x95 else 1] or count
        if frame.data_id == data_id:
            number = frame.payload[0]
            if before is not None and _goes_on(before, frame):
                following += 1 if following and number == before.payload[0] + 1 else -following
                some = some or any(frame.payload[1:7])
            else:
                begins, following, some = frame.seconds, int(number <= 1), any(frame.payload[1:7])
            if count and following == -(-count // SLOTS[data_id]):
                out.append(Table(begins, frame.seconds, some))
        before = frame
    return out


def explained(
    rule: str, board: int | None, seconds: float, heard: list[Frame], notes: list[Note], ago: float, detail: str = ""
) -> bool:
    """Tell whether the bytes can't but say what was found, though nothing of the kind was put in.

    detail: which contradiction it is.
    """
    if rule == "echo":
        return any(
            note["what"] == "unanswered" and note.get("why") == "busy" and _same_request(note, seconds, heard)
            for note in notes[bisect_left(notes, seconds - 1e-3, key=_at) : bisect_left(notes, seconds + 1e-3, key=_at)]
        )
    if rule == "modbus-ambiguous":
        return any(
            note["what"] == "unanswered" and "register" in note and _exception_fits(note, heard, notes)
            for note in notes[bisect_left(notes, seconds - WAITS_S, key=_at) : bisect_left(notes, seconds, key=_at)]
        )
    accidents = (
        frame
        for note in notes[bisect_left(notes, seconds - ago, key=_at) : bisect_left(notes, seconds + 1e-3, key=_at)]
        if note["what"] in {"damaged", "collision"} and note.get("harmed") is not False
        for frame in _there(note, heard)
        if frame.good and frame.seconds + frame.size / 960 > _at(note) + 1e-4  # the one right before it is whole
    )
    return any(
        rule != "contradiction"
        or (accident.address == board and accident.data_id in SAID_BY[detail] and _held(accident, seconds, heard))
        for accident in accidents
    )


def _held(accident: Frame, seconds: float, heard: list[Frame]) -> bool:
    """Tell whether what came by accident counts at that time: no newer reply of its ID, or table, is there by then."""
    mine = [frame for frame in heard if frame.address == accident.address and frame.seconds < seconds + 1e-6]
    if accident.data_id not in SLOTS:
        return not any(frame.data_id == accident.data_id and frame.seconds > accident.seconds + 1e-6 for frame in mine)
    tables = [table for table in _tables(mine, accident.data_id) if table.whole > accident.seconds - 1e-6]
    return len(tables) == 1 and tables[0].begins < accident.seconds + 1e-6


def _same_request(note: Note, seconds: float, heard: list[Frame]) -> bool:
    """Tell whether a second host with the same address asked the same within 100 ms: an echo (records.md 6)."""
    near = _between(heard, seconds - 0.114, seconds + 1e-6)
    return sum((frame.address, frame.data_id) == (note["address"], note["data_id"]) for frame in near) > 1


def _load_stepped(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    if note["name"] not in {"pack_voltage", "cell_max", "cell_min"}:
        return False
    at = _at(note)
    told = [frame for frame in heard if frame.address == note["board"] and frame.data_id == 0x90 and any(frame.payload)]
    # A slow host's next current may come later than that; it is the first to tell of a step all the same.
    near = {frame for frame in told if abs(frame.seconds - at) < RECENT_S}
    near.update(
        [frame for frame in told if frame.seconds < at][-1:], [frame for frame in told if frame.seconds > at][:1]
    )
    currents = [int.from_bytes(frame.payload[4:6]) for frame in near]
    return max(currents, default=0) - min(currents, default=0) > STEP_RAW


def _between(heard: list[Frame], first: float, last: float) -> list[Frame]:
    return heard[bisect_left(heard, first, key=_seconds) : bisect_left(heard, last, key=_seconds)]


def _seconds(frame: Frame) -> float:
    return frame.seconds
