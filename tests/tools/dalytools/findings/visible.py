# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether a fault that no rule found could be seen on the wire at all: told by the bytes, without the decoder.

Each reason is one of docs/records.md, or an accident of the bytes; what has none is a miss.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.findings.heard import A5_SIZE, BURST_QUIET_S, BURSTS, Frame, between, tables
from tests.tools.dalytools.findings.moments import at, during
from tests.tools.dalytools.findings.own_answers import answers

if TYPE_CHECKING:
    from tests.tools.dalytools.findings.moments import Note

WAITS_S = 1.03
"""A request's 13.5 ms, and the second that it waits (docs/records.md 6)."""
LONGEST_S = 0.3
"""Of a frame at 9600 baud: 261 bytes."""
ECHOES_S = 0.114
"""A request's 13.5 ms, and the 100 ms within which a repeat is an echo (docs/records.md 6)."""
LATE_S = 0.5
"""From when on ``check`` calls a reply late."""
MOST_REPLY_S = 0.15
"""A simulated board begins to answer within that."""
ERROR_SIZE = 16
"""Bytes of an error frame, as of any frame of CAN."""
ECHO = "an echo (records.md 6)"
SAID_S = 0.03
"""A single frame takes 13.5 ms, with noise a little more; what it says is noted at its end."""
FAULTS = 0x98
SILENCE_S = 0.25
NO_BOARD = frozenset((0x80, 0x20))
D2, ASKS_81, ANSWERS_81 = 0xD2, 0x80, 0x50
RECENT_S = 10.0
"""How old the other side of a contradiction, and a request with a late reply, may be (docs/records.md 7, 11)."""
TABLE_OF = {0x90: 0x95, 0x91: 0x95, 0x92: 0x96}
"""What a reply is held against (docs/records.md 11)."""
STEP_RAW = 10
"""1 A."""
CAPACITY = 0x80
"""First of the settings of D2."""
LAST_MEASURED = 0x3A
"""Of the registers that hold voltage and SOC, in either dialect of Modbus."""


def hidden(note: Note, heard: list[Frame], notes: list[Note]) -> str:
    """Say why this can't be seen; empty: it can."""
    for what, told, why in (
        ("unanswered", _is_error_frame, "its request is an error frame on CAN"),
        ("unanswered", _answered_otherwise, "another reply of this ID answers it (records.md 7)"),
        ("unanswered", _is_an_echo, f"within 100 ms of the same request of another host: {ECHO}"),
        ("unanswered", _swallowed, "damage that is a good frame by accident took its first bytes"),
        ("unanswered", _left_whole, "two spoke at once, and its reply was left whole"),
        ("unanswered", exception_fits, "an exception of D2 fits each request that waits (wires.md 1)"),
        ("unanswered", _late_one_answers, "a late reply to the request before answers it (wires.md 1)"),
        ("late", _answers_newer_of_modbus, "it answers a newer request of Modbus (wires.md 1)"),
        ("late", _answers_another, "it answers a newer request for this ID (records.md 7)"),
        ("other_board", _answers_another, "it answers a request that names no board (records.md 7)"),
        ("damaged", _begins_the_capture, "a capture that begins so may have joined in the middle of a frame"),
        ("damaged", _goes_on, "it is of the damaged record before it: no silence between (records.md 1)"),
        ("damaged", _good_by_accident, "its bytes are a good frame by accident"),
        ("collision", _good_by_accident, "its bytes are a good frame by accident"),
        ("foreign", _swallowed, "damage that is a good frame by accident took its first bytes"),
        ("foreign", _gap_is_mixed, "damaged bytes in the same gap, which so is not whole theirs (records.md 4)"),
        ("repeated_frame", _comes_once, "one of the two frames was damaged"),
        ("cut_burst", _nothing_came, "what came of it was damaged"),
        ("skipped_frame", _nothing_came, "what came of it was damaged"),
        ("late", _nothing_came, "what came of it was damaged"),
        ("other_board", _nothing_came, "what came of it was damaged"),
        ("zero_reply", _nothing_came, "what came of it was damaged"),
        ("echo", comes_late, "later than 100 ms: a request again (records.md 6)"),
        ("zero_reply", _may_be_zero, "registers that may all be zero"),
        ("late", _taken_before, "another reply was taken for it: a request is given one late reply (records.md 7)"),
        *(
            (what, _reply_is_error_frame, "its reply is an error frame on CAN")
            for what in ("contradiction", "fault_present", "fault_raised")
        ),
        ("contradiction", _no_table, "no whole table of its board to hold it against (records.md 11)"),
        ("contradiction", _no_count, "no 0x94 of its board before it (records.md 11)"),
        ("contradiction", _load_stepped, "the load stepped next to it, which explains a voltage"),
    ):
        if note["what"] == what and told(note, heard, notes):
            return why
    return ""


def _is_error_frame(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    damaged = any(other["what"] in {"damaged", "collision"} and other["time"] == note["time"] for other in notes)
    there = between(heard, at(note) - 1e-6, at(note) + 1e-6)
    return damaged and not any(frame.good or frame.size != ERROR_SIZE for frame in there)


def _reply_is_error_frame(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether the single frame that says it came with noise in front, which CAN does not let through."""
    mine = (note["board"], note.get("data_id", FAULTS))
    soon = between(heard, at(note) - SAID_S, at(note) + 1e-3)
    return not any((frame.address, frame.data_id) == mine for frame in soon) and any(
        other["what"] == "damaged" and not str(other["heard"]).startswith("a5")
        for other in during(notes, at(note) - SAID_S, at(note))
    )


def _answered_otherwise(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether the request is given a reply, whoever it was meant for."""
    if "data_id" not in note:
        return False
    given = answers(heard, int(str(note["data_id"])), at(note), at(note))
    return any(request.address == note["address"] and abs(request.seconds - at(note)) < 1e-6 for request in given)


def _is_an_echo(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return same_request(note, at(note), heard) and (note.get("why") == "busy" or _of_two_hosts(note, notes))


def _of_two_hosts(note: Note, notes: list[Note]) -> bool:
    """Tell whether another host's request that nobody answered is the same, within 100 ms before."""
    return any(
        other["what"] == "unanswered"
        and (other["address"], other.get("data_id")) == (note["address"], note.get("data_id"))
        and other["host"] != note["host"]
        for other in during(notes, at(note) - ECHOES_S, at(note))
    )


def same_request(note: Note, seconds: float, heard: list[Frame]) -> bool:
    """Tell whether a second host with the same address asked the same within 100 ms; on a serial line alone."""
    near = between(heard, seconds - ECHOES_S, seconds + 1e-6)
    same = [frame for frame in near if (frame.address, frame.data_id) == (note["address"], note.get("data_id"))]
    return len(same) > 1 and same[0].size == A5_SIZE


def comes_late(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether an echo begins more than 100 ms behind the end of its request, as when another board spoke first."""
    near = between(heard, at(note) - WAITS_S, at(note) + 1e-6)
    same = [frame for frame in near if (frame.address, frame.data_id) == (note["address"], note.get("data_id"))]
    return len(same) > 1 and same[-1].seconds - same[-2].seconds > ECHOES_S


def _swallowed(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether no packet begins where that does, and the one before it is a good frame by accident."""
    before = between(heard, at(note) - SILENCE_S, at(note) - 1e-6)
    if not before or not before[-1].good or between(heard, at(note) - 1e-6, at(note) + 1e-6):
        return False
    first = before[-1].seconds
    return any(other["what"] in {"damaged", "collision"} for other in during(notes, first - 1e-6, first + 1e-6))


def _left_whole(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether the reply to a request of Modbus is a good frame, though two spoke at once."""
    asked = [frame for frame in between(heard, at(note) - 1e-6, at(note) + 1e-6) if frame.modbus]
    collisions = [other for other in during(notes, at(note), at(note) + WAITS_S) if other["what"] == "collision"]
    if not asked or not collisions:
        return False
    answers_from = asked[0].first if asked[0].first == D2 else asked[0].first - ASKS_81 + ANSWERS_81
    length_s = len(str(collisions[0]["heard"])) / 2 / 960
    began, until = at(collisions[0]), at(collisions[0]) + length_s
    both = [*there_at(collisions[0], heard), *between(heard, began, until)]
    return any(frame.modbus and frame.first == answers_from for frame in both)


def exception_fits(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    of_d2 = any(frame.first == D2 for frame in between(heard, at(note) - 1e-6, at(note) + 1e-6))
    return of_d2 and any(other["what"] == "modbus_exception" and 0 < at(other) - at(note) < WAITS_S for other in notes)


def _answers_another(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether all replies that it may be are given to requests that could mean this board, and soon enough."""
    if "data_id" not in note:
        return False
    data_id, board = int(str(note["data_id"])), int(str(note["board"]))
    replies = [
        frame for frame in between(heard, at(note) - 1e-3, at(note) + 1e-3) if _is_of(frame, note) and frame.begins
    ]
    given = answers(heard, data_id, at(note) - WAITS_S, at(note) + 1e-3)
    quick = {
        reply
        for request, reply in given.items()
        if reply.seconds - request.ends <= LATE_S and request.address in NO_BOARD | {0x3F + board}
    }
    return bool(replies) and quick.issuperset(replies)


def _late_one_answers(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether a good late reply of its board for these registers comes while it waits; it is not its own."""
    return note.get("why") != "late" and any(
        _same_registers(note, other) and any(frame.modbus for frame in there_at(other, heard))
        for other in during(notes, at(note), at(note) + WAITS_S)
        if other["what"] == "late"
    )


def _answers_newer_of_modbus(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return any(
        other["what"] == "unanswered" and _same_registers(note, other) and _late_one_answers(other, heard, [note])
        for other in during(notes, at(note) - WAITS_S, at(note))
    )


def _same_registers(note: Note, other: Note) -> bool:
    """Tell whether both are of the same registers; of the same board, where both name one."""
    boards = {note.get("board"), other.get("board")} - {None}
    return "register" in note and note["register"] == other.get("register") and len(boards) < 2


def sent_by(note: Note, board: int) -> bool:
    """Tell whether damaged bytes were a board's, or the board's and another's."""
    senders = note.get("senders", note.get("sender"))
    return f"board {board}" in (senders if isinstance(senders, list) else [senders])


def _is_of(frame: Frame, note: Note) -> bool:
    """Tell whether it is a reply of a note's board and ID; of Modbus, a good frame that its board may have sent."""
    if "register" in note:
        return frame.modbus and frame.first in {D2, ANSWERS_81 + int(str(note["board"]))}
    return (frame.address, frame.data_id) == (note["board"], note["data_id"])


def _nothing_came(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether no frame of it was heard well, for damage. Behind a single one comes the next answer."""
    single = "data_id" in note and note["data_id"] not in BURSTS
    soon = between(heard, at(note) - 1e-3, at(note) + (1e-3 if single else LONGEST_S))
    return not any(_is_of(frame, note) for frame in soon) and _board_was_damaged(note, notes)


def _board_was_damaged(note: Note, notes: list[Note]) -> bool:
    """Tell whether bytes of a note's board were damaged in its answer."""
    return any(
        other["what"] in {"damaged", "collision"}
        and other.get("harmed") is not False
        and sent_by(other, int(str(note["board"])))
        for other in during(notes, at(note) - 1e-3, at(note) + BURST_QUIET_S)
    )


def _begins_the_capture(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return not str(note["heard"]).startswith("a5") and not between(heard, -1e9, at(note) - 1e-6)


def _goes_on(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it is in one packet with damaged bytes that ended less than 250 ms before."""
    before = between(heard, -1e9, at(note) + 1e-6)
    if not before or _whole(before[-1]) or abs(before[-1].seconds - at(note)) < 1e-3:
        return False
    first = before[-1]
    return any(
        first.size == _size(other) + _size(note) and at(note) - at(other) - _size(other) / 960 <= SILENCE_S
        for other in during(notes, first.seconds - 1e-3, first.seconds + 1e-3)
        if other["what"] == "damaged"
    )


def _size(note: Note) -> int:
    return len(str(note["heard"])) // 2


def _good_by_accident(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    there = there_at(note, heard)
    return bool(there) and all(frame.good or frame.modbus for frame in there)


def there_at(note: Note, heard: list[Frame]) -> list[Frame]:
    """Return the packets at the time of a note."""
    near = between(heard, at(note) - LONGEST_S, at(note) + 1e-3)
    return [frame for frame in near if frame.seconds + frame.size / 960 > at(note)]


def _gap_is_mixed(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether damaged bytes stand in one gap with it: no good frame between, and no silence (records.md 1, 4)."""
    start = len(between(heard, -1e9, at(note) + 1e-3)) - 1
    if start < 0 or _whole(heard[start]):
        return False
    first = last = start
    while first and not _whole(heard[first - 1]) and heard[first].seconds - heard[first - 1].ends <= SILENCE_S:
        first -= 1
    while last + 1 < len(heard) and not _whole(heard[last + 1]) and _follows(heard, last):
        last += 1
    until = heard[last + 1].seconds if last + 1 < len(heard) and _follows(heard, last) else heard[last].ends + SILENCE_S
    return any(
        other["what"] in {"damaged", "collision"}
        and other.get("harmed") is not False
        and at(other) + len(str(other.get("heard", ""))) / 2 / 960 > heard[first].seconds - 1e-3
        for other in during(notes, heard[first].seconds - LONGEST_S, until + 1e-3)
    )


def _whole(frame: Frame) -> bool:
    return frame.good or frame.modbus


def _follows(heard: list[Frame], index: int) -> bool:
    """Tell whether the next packet comes without silence."""
    return heard[index + 1].seconds - heard[index].ends <= SILENCE_S


def _may_be_zero(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return "register" in note and int(str(note["register"])) > LAST_MEASURED and note["register"] != CAPACITY


def _comes_once(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return len(_of_number(note, heard)) < 2 and _board_was_damaged(note, notes)


def _of_number(note: Note, heard: list[Frame]) -> list[Frame]:
    """Return the good frames of a note's place in its burst: boards count from 1, or from 0."""
    mine = [frame for frame in heard if _is_of(frame, note)]
    place = int(str(note["frame"])) - any(frame.payload[0] == 0 for frame in mine)
    soon = between(mine, at(note) - 1e-3, at(note) + BURST_QUIET_S)
    return [frame for frame in soon if frame.payload[0] == place]


def _taken_before(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    return _own_is_answered(note, heard) or any(
        other["what"] == "other_board"
        and (other["board"], other["data_id"]) == (note["board"], note.get("data_id"))
        and 0 < at(note) - at(other) < RECENT_S
        for other in notes
    )


def _own_is_answered(note: Note, heard: list[Frame]) -> bool:
    """Tell whether the request of a late reply was given another one before: 40, 80 and 20 take any board's."""
    if "data_id" not in note:
        return False
    meant = at(note) - float(str(note["delay_s"]))
    given = answers(heard, int(str(note["data_id"])), meant, meant)
    names = NO_BOARD | {0x3F + int(str(note["board"]))}
    return any(
        request.address in names and meant - request.seconds < MOST_REPLY_S and reply.seconds < at(note) - 1e-3
        for request, reply in given.items()
    )


def _no_table(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether neither the newest table before it nor the first one behind it is near, whole and not of zeros.

    One behind another reply of its ID is held against that.
    """
    data_id, time = int(str(note["data_id"])), at(note)
    if data_id not in TABLE_OF or note["name"] in {"cell_number", "sensor_number"}:
        return False
    mine = [frame for frame in heard if frame.address == note["board"]]
    whole = tables(mine, TABLE_OF[data_id])
    before = [table for table in whole if table.whole < time]
    behind = [table for table in whole if table.whole >= time]
    again = min((frame.seconds for frame in mine if frame.data_id == data_id and frame.seconds >= time), default=1e9)
    near_before = bool(before) and time - before[-1].whole < RECENT_S and before[-1].some
    near_behind = bool(behind) and behind[0].whole - time < RECENT_S and behind[0].whole < again and behind[0].some
    return not near_before and not near_behind


def _no_count(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    place = {"cell_number": 0, "sensor_number": 1}.get(str(note["name"]))
    return place is not None and not any(
        (frame.address, frame.data_id) == (note["board"], 0x94) and frame.payload[place]
        for frame in between(heard, -1e9, at(note))
    )


def _load_stepped(note: Note, heard: list[Frame], notes: list[Note]) -> bool:
    if note["name"] not in {"pack_voltage", "cell_max", "cell_min"}:
        return False
    time = at(note)
    told = [frame for frame in heard if frame.address == note["board"] and frame.data_id == 0x90 and any(frame.payload)]
    # A slow host's next current may come later than that; it is the first to tell of a step all the same.
    near = {frame for frame in told if abs(frame.seconds - time) < RECENT_S}
    near.update(
        [frame for frame in told if frame.seconds < time][-1:], [frame for frame in told if frame.seconds > time][:1]
    )
    currents = [int.from_bytes(frame.payload[4:6]) for frame in near]
    states = [frame for frame in heard if frame.address == note["board"] and frame.data_id == 0x93]
    around = [frame for frame in states if frame.seconds < time][-1:] + [
        frame for frame in states if frame.seconds > time
    ][:1]
    if len({frame.payload[0] for frame in around if any(frame.payload)}) > 1:
        return True
    return max(currents, default=0) - min(currents, default=0) > STEP_RAW
