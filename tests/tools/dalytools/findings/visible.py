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
            out.append(Frame(seconds, len(data)))
    return out


def hidden(note: Note, heard: list[Frame], notes: list[Note]) -> str:
    """Say why this can't be seen; empty: it can."""
    for what, told, why in (
        ("unanswered", _is_error_frame, "its request is an error frame on CAN"),
        ("unanswered", _answered_otherwise, "another reply of this ID answers it (records.md 7)"),
        ("late", _answers_another, "it answers a newer request for this ID (records.md 7)"),
        ("other_board", _answers_another, "it answers a request that names no board (records.md 7)"),
        ("damaged", _good_by_accident, "its bytes are a good frame by accident"),
        ("collision", _good_by_accident, "its bytes are a good frame by accident"),
        ("foreign", _in_damage, "damaged bytes in the same gap, which so is not whole theirs (records.md 4)"),
        ("repeated_frame", _in_damage, "one of the two frames was damaged"),
        ("cut_burst", _in_damage, "what came of it was damaged"),
        ("other_board", _in_damage, "what came of it was damaged"),
        ("zero_reply", _may_be_zero, "registers that may all be zero"),
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
    """Tell whether a reply of the ID comes that no newer request takes."""
    address = int(str(note["address"]))
    board = None if address in NO_BOARD else address - 0x3F
    at = _at(note)
    for frame in _between(heard, at + 1e-3, at + WAITS_S):
        echo = frame.address == address and frame.seconds < at + ECHO_S
        if frame.data_id == note.get("data_id") and not echo:
            if frame.address in {address, *NO_BOARD}:
                return False
            if frame.address < 0x20 and board in {None, frame.address}:
                return True
    return False


def _answers_another(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    asked = {*NO_BOARD, 0x3F + int(str(note["board"]))}
    before = _between(heard, _at(note) - WAITS_S, _at(note))
    return any(frame.data_id == note.get("data_id") and frame.address in asked for frame in before)


def _good_by_accident(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    at = _at(note)
    near = [frame for frame in _between(heard, at - LONGEST_S, at + 1e-3) if frame.seconds + frame.size / 960 > at]
    return all(frame.good for frame in near)


def _in_damage(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return any(
        other is not note
        and other["what"] in {"damaged", "collision", "foreign"}
        and abs(_at(other) - _at(note)) < IN_SAME_GAP_S
        for other in notes
    )


def _may_be_zero(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return "register" in note and int(str(note["register"])) > LAST_MEASURED and note["register"] != CAPACITY


def _load_stepped(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    if note["name"] not in {"pack_voltage", "cell_max", "cell_min"}:
        return False
    near = _between(heard, _at(note) - 10, _at(note) + 10)
    currents = [
        int.from_bytes(frame.payload[4:6])
        for frame in near
        if frame.address == note["board"] and frame.data_id == 0x90 and any(frame.payload)
    ]
    return max(currents, default=0) - min(currents, default=0) > 10


def _between(heard: list[Frame], first: float, last: float) -> list[Frame]:
    return heard[bisect_left(heard, first, key=_seconds) : bisect_left(heard, last, key=_seconds)]


def _seconds(frame: Frame) -> float:
    return frame.seconds
