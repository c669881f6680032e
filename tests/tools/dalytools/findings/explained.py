# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether the bytes can't but say what a rule found, though nothing of the kind was put in.

Damage can be a good frame by accident, two may ask the same, and zeros may be true: each reason is told by the bytes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.findings.heard import A5_SIZE, BURSTS, DALYS_MODBUS, SLOTS, Frame, between, tables
from tests.tools.dalytools.findings.moments import at, during
from tests.tools.dalytools.findings.own_answers import answers
from tests.tools.dalytools.findings.visible import (
    ANSWERS_81,
    D2,
    ECHO,
    ECHOES_S,
    LONGEST_S,
    RECENT_S,
    WAITS_S,
    comes_late,
    exception_fits,
    hidden,
    same_request,
    there_at,
)

if TYPE_CHECKING:
    from tests.tools.dalytools.findings.moments import Moment, Note

MOS = 0x93
SETTLED_S = 2.1
"""From the end of the reply that takes a switch: so long its state is not looked at."""
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


def explained(moment: Moment, heard: list[Frame], notes: list[Note], ago: float) -> bool:
    """Tell whether the bytes say it. ago: how long before it what counts then may have come, s."""
    seconds = moment.seconds
    if _fell_apart(moment, heard):
        return True
    if moment.rule == "echo":
        return _repeats_a_collision(moment, heard, notes) or any(
            note["what"] == "unanswered"
            and (note.get("why") in {"busy", "damaged"} or hidden(note, heard, notes).endswith(ECHO))
            and same_request(note, seconds, heard)
            for note in during(notes, seconds - ECHOES_S, seconds + 1e-3)
        )
    if moment.rule == "modbus-ambiguous":
        return any(
            note["what"] == "unanswered" and "register" in note and exception_fits(note, heard, notes)
            for note in during(notes, seconds - WAITS_S, seconds)
        )
    if moment.rule in {"unanswered", "silent", "asleep"} and (
        any(
            note["what"] == "echo" and comes_late(note, heard, notes)
            for note in during(notes, seconds - 1e-3, seconds + 1e-3)
        )
        or _harmed(moment, heard, notes)
        or _other_fits(moment, heard, notes)
        or _newer_is_answered(moment, heard, notes)
        or _second_answer(moment, heard, notes)
    ):
        return True
    if moment.rule == "write-no-effect" and moment.place.data_id is not None and _told_late(moment, heard, notes):
        return True
    if moment.rule == "zero-reply" and _behind_zeros(moment, heard, notes):
        return True
    if moment.rule == "contradiction" and _counts_from_one(moment, heard, notes):
        return True
    return any(
        _tells(accident, moment, heard)
        for note in during(notes, seconds - ago, seconds + A5_SIZE / 960)
        if note["what"] in {"damaged", "collision"} and note.get("harmed") is not False
        for accident in there_at(note, heard)
        # The one right before it is whole.
        if accident.good and max(accident.seconds, accident.ends - 2e-4) > at(note) - 1e-4
    )


def _fell_apart(moment: Moment, heard: list[Frame]) -> bool:
    """Tell whether a reply of Modbus with a good A5 frame inside is behind it: as its pieces, or as no reply at all."""
    if moment.rule in {"damaged", "unasked", "unknown-id"}:
        near = between(heard, moment.seconds - LONGEST_S, moment.seconds + 1e-6)
        return any(frame.falls_apart and moment.seconds < frame.ends for frame in near)
    if moment.rule in {"unanswered", "silent", "asleep"} and moment.place.data_id is None:
        answers_from = D2 if moment.place.board is None else ANSWERS_81 + moment.place.board
        soon = between(heard, moment.seconds, moment.seconds + WAITS_S)
        return any(frame.falls_apart and frame.first == answers_from for frame in soon)
    return False


def _told_late(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it is the board's first state since it took a switch long ago: it slept, or was not asked."""
    written = [
        note
        for note in during(notes, 0, moment.seconds)
        if (note["what"], note.get("data_id"), note.get("result")) == ("write", moment.place.data_id, "confirmed")
    ]
    states = [
        frame
        for frame in heard
        if (frame.address, frame.data_id) == (moment.place.board, MOS) and frame.seconds < moment.seconds - 1e-6
    ]
    return bool(written) and not any(
        frame.seconds > at(written[-1]) + SETTLED_S for frame in states if any(frame.payload)
    )


def _repeats_a_collision(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it repeats within 100 ms what another host said at once with somebody, and which is whole."""
    near = between(heard, moment.seconds - ECHOES_S, moment.seconds + 1e-6)
    same = [frame for frame in near if (frame.address, frame.data_id) == (near[-1].address, near[-1].data_id)]
    return len(same) > 1 and any(
        note["what"] == "collision" for note in during(notes, same[0].seconds - 1e-3, same[0].seconds + 1e-3)
    )


def _tells(accident: Frame, moment: Moment, heard: list[Frame]) -> bool:
    """Tell whether what came by accident can be behind it: of its ID; values of its board, that still count."""
    if moment.rule != "contradiction":
        return moment.place.data_id in {None, accident.data_id} or _ended_by(accident, moment, heard)
    told_from = accident.address == moment.place.board and accident.data_id in SAID_BY[moment.place.detail]
    return told_from and _held(accident, moment.seconds, heard)


def _ended_by(accident: Frame, moment: Moment, heard: list[Frame]) -> bool:
    """Tell whether it is the next reply behind it, of a burst that any other reply ends (records.md 8)."""
    before = [frame for frame in between(heard, accident.seconds, moment.seconds - 1e-6) if frame.replies]
    return moment.place.data_id in BURSTS and before == [accident]


def _held(accident: Frame, seconds: float, heard: list[Frame]) -> bool:
    """Tell whether what came by accident counts at that time: no newer reply of its ID, or table, is there by then."""
    mine = [frame for frame in heard if frame.address == accident.address and frame.seconds < seconds + 1e-6]
    if accident.data_id not in SLOTS:
        return not any(frame.data_id == accident.data_id and frame.seconds > accident.seconds + 1e-6 for frame in mine)
    whole = [table for table in tables(mine, accident.data_id) if table.whole > accident.seconds - 1e-6]
    return len(whole) == 1 and whole[0].begins < accident.seconds + 1e-6


def _counts_from_one(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it is told from an answer that lacks its number 0: without damage before it, it counts from 1.

    So says records.md 8; each value then stands one frame too far in front. On CAN no damage is seen.
    """
    board = moment.place.board
    for note in during(notes, moment.seconds - RECENT_S - 1.0, moment.seconds):
        data_id = _lacks_number_0(note, board)
        if data_id is None:
            continue
        mine = [frame for frame in heard if (frame.address, frame.data_id) == (board, data_id)]
        first = next((frame for frame in mine if frame.seconds > at(note)), None)
        if (
            first is not None
            and first.payload[0] == 1
            and any(frame.payload[0] == 0 for frame in mine if frame.seconds < first.seconds)
            and first.data_id in SAID_BY[moment.place.detail]
            and _held(first, moment.seconds, heard)
        ):
            return True
    return False


def _lacks_number_0(note: Note, board: int | None) -> int | None:
    """Return the data ID of an answer of this board that a note takes number 0 from."""
    if note["what"] == "skipped_frame" and note["board"] == board:
        return int(str(note["data_id"]))
    sent = bytes.fromhex(str(note.get("sent", ""))) if note["what"] == "damaged" else b""
    return sent[2] if len(sent) == A5_SIZE and sent[1] == board and sent[4] == 0 else None


def _harmed(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether bytes of that exchange were harmed, though a good frame of it is among what was heard.

    The boards heard no good request, or on CAN the whole of it is an error frame.
    """
    asked = [frame for frame in between(heard, moment.seconds - 1e-6, moment.seconds + 1e-6) if frame.asks]
    data_id = asked[0].data_id if asked else moment.place.data_id
    return any(
        note["what"] in {"damaged", "collision"}
        and note.get("harmed") is not False
        and _begins(bytes.fromhex(str(note.get("sent", note["heard"]))), data_id, moment.place.register)
        for note in during(notes, moment.seconds - 1e-3, moment.seconds + WAITS_S)
    )


def _begins(data: bytes, data_id: int | None, register: int | None) -> bool:
    """Tell whether an A5 frame of that ID begins in these bytes, or a frame of Modbus for that register."""
    return any(
        (data[place] == 0xA5 and data[place + 2] == data_id)
        or (data[place] in DALYS_MODBUS and int.from_bytes(data[place + 2 : place + 4]) == register)
        for place in range(len(data) - 3)
    )


def _other_fits(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it was answered with an exception that fits another request of D2 as well (wires.md 1)."""
    answered = [note for note in during(notes, moment.seconds - 1e-3, moment.seconds + 1e-3) if _is_exception(note)]
    return bool(answered) and any(
        note["what"] == "unanswered" and "register" in note and exception_fits(note, heard, answered)
        for note in during(notes, moment.seconds - WAITS_S, moment.seconds)
    )


def _is_exception(note: Note) -> bool:
    return note["what"] == "modbus_exception"


def _second_answer(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it is an answer to a write to D2 that looks like a request, or a write that so has no answer.

    D2 is both sides' address: one with another value, or a second board's, is told by nothing (wires.md 1).
    """
    return any(
        (note["what"], note.get("dialect"), note.get("register")) == ("write", "d2", moment.place.register)
        and (note["result"] == "denied" or _modbus_frames(heard, at(note), moment.seconds) > 1)
        for note in during(notes, moment.seconds - LONGEST_S, moment.seconds + 1e-3)
    )


def _modbus_frames(heard: list[Frame], asked: float, last: float) -> int:
    """Count good frames of Modbus behind a request, up to one."""
    return sum(frame.modbus for frame in between(heard, asked + 1e-3, last + 1e-6))


def _newer_is_answered(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether its reply is given to a newer request for its ID, which a busy board did not hear (records.md 7)."""
    data_id, seconds = moment.place.data_id, moment.seconds
    if data_id is None:
        return False
    given = answers(heard, data_id, seconds, seconds + WAITS_S)
    unheard = {at(note) for note in during(notes, seconds, seconds + WAITS_S) if _not_heard(note, data_id)}
    return not any(abs(request.seconds - seconds) < 1e-6 for request in given) and any(
        abs(request.seconds - time) < 1e-6 for request in given for time in unheard
    )


def _not_heard(note: Note, data_id: int) -> bool:
    return note["what"] == "unanswered" and note.get("why") == "busy" and note.get("data_id") == data_id


def _behind_zeros(moment: Moment, heard: list[Frame], notes: list[Note]) -> bool:
    """Tell whether it is the board's next reply behind zeros of waking up, or the one behind that, and so on."""
    mine = [frame for frame in heard if frame.address == moment.place.board and frame.seconds < moment.seconds + 1e-6]
    if not mine or not _zeros(mine[-1]):
        return False
    for frame in reversed(mine[:-1]):
        if not _zeros(frame):
            return False
        if any(_woke(note, frame) for note in during(notes, frame.seconds - 1e-3, frame.seconds + 1e-3)):
            return True
    return False


def _woke(note: Note, frame: Frame) -> bool:
    return note["what"] == "zero_reply" and (note["board"], note["data_id"]) == (frame.address, frame.data_id)


def _zeros(frame: Frame) -> bool:
    """Tell whether a reply says nothing but zeros, but for the number of a frame of cells or sensors."""
    return not any(frame.payload[1:] if frame.data_id in SLOTS else frame.payload)
