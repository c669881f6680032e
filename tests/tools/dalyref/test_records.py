# SPDX-License-Identifier: GPL-2.0-or-later
"""Each rule of docs/records.md, sections 2 to 4, by a small example."""

from __future__ import annotations

import pytest
from tests.tools.dalyref import real

from dalyref import a5
from dalyref.kinds import Dialect, Kind
from dalyref.modbus import crc
from dalyref.records import Splitter, split

FRAME, BAD, SHORT, JUNK, FOREIGN = Kind.FRAME, Kind.BAD_CHECKSUM, Kind.SHORT, Kind.JUNK, Kind.FOREIGN
REQUEST = a5.build(0x40, 0x90)
REPLY = real.data("cpy-90")
BROKEN = REPLY[:-1] + bytes((REPLY[-1] ^ 1,))
READ = bytes.fromhex("d203000c000157aa")


def cut(data: bytes) -> list[tuple[Kind, str]]:
    return [(record.kind, record.data.hex()) for record in split(data)]


def kinds(data: bytes) -> list[tuple[Kind, int]]:
    return [(record.kind, len(record.data)) for record in split(data)]


def with_crc(head: str) -> bytes:
    data = bytes.fromhex(head)
    return data + crc(data).to_bytes(2, "little")


# -- choice ----------------------------------------------------------------------------------------------------------


def test_frames_end_to_end() -> None:
    records = split(REQUEST + REPLY + READ)
    assert [(record.start, record.kind, record.dialect) for record in records] == [
        (0, FRAME, Dialect.A5),
        (13, FRAME, Dialect.A5),
        (26, FRAME, Dialect.D2),
    ]


def test_real_sequence_and_stream() -> None:
    assert kinds(real.data("tano-95-seq")) == [(FRAME, 13)] * 5
    # lv165: bytes lost inside frame 5 (a5019508050d300d34 is left of it), at the end a malformed 13-byte chunk
    assert kinds(real.data("lv165-stream")) == [(FRAME, 13)] * 4 + [(SHORT, 9), (FRAME, 13), (BAD, 13)]
    assert kinds(real.data("lv165-mix")) == [(BAD, 13)]


def test_window_that_ends_first() -> None:
    # an exception of board 1, whole, inside the data of an A5 frame: it ends first
    exception = with_crc("518302")
    frame = a5.build(1, 0x57, b"\x01" + exception + b"\x00\x00")
    assert cut(frame) == [(SHORT, frame[:5].hex()), (FRAME, exception.hex()), (JUNK, frame[10:].hex())]


def test_of_two_that_end_together_the_first_begun() -> None:
    # bytes 5..12 of the A5 frame are a good write of one register: both end at byte 13
    for register in range(65536):
        write = with_crc(f"5106{register:04x}0001")
        if sum(b"\xa5\x01\x57\x08\x00" + write[:-1]) & 0xFF == write[-1]:
            break
    else:
        pytest.fail("no such register")
    frame = b"\xa5\x01\x57\x08\x00" + write
    assert a5.is_good(frame)
    assert cut(frame) == [(FRAME, frame.hex())]
    assert cut(b"\x00" + frame[1:]) == [(JUNK, (b"\x00" + frame[1:5]).hex()), (FRAME, write.hex())]


# -- the exception: A5 in A5 -----------------------------------------------------------------------------------------


def overlapping(inner: bytes, at: int) -> bytes:
    """Return the first `at` bytes of a frame W that is good because `inner`, which begins inside, completes it."""
    for address in range(256):
        head = bytes((0xA5, address, 0x95, 8)) + b"\x01" * (at - 4)
        if a5.is_good(head + inner[: 13 - at]):
            return head
    pytest.fail("no such address")


def test_inner_frame_wins() -> None:
    inner = a5.build(1, 0x96, bytes(range(8)))
    head = overlapping(inner, 8)
    assert a5.is_good(head + inner)
    assert cut(head + inner) == [(SHORT, head.hex()), (FRAME, inner.hex())]
    assert cut(head + inner + b"\x77") == [(SHORT, head.hex()), (FRAME, inner.hex()), (JUNK, "77")]
    assert cut(head + inner + REPLY) == [(SHORT, head.hex()), (FRAME, inner.hex()), (FRAME, REPLY.hex())]


def test_outer_frame_wins_when_a_frame_follows_it() -> None:
    exception = with_crc("518302")
    # V = A5 01 96 08 d0 | d1..d5 d6 d7 sum, W ends behind d0: the exception is d1..d5
    inner = a5.build(1, 0x96, b"\x00" + exception + b"\x00\x00")
    head = overlapping(inner, 8)
    assert cut(head + inner) == [
        (FRAME, (head + inner[:5]).hex()),
        (FRAME, exception.hex()),
        (JUNK, inner[10:].hex()),
    ]


def test_outer_frame_wins_at_the_end_of_the_segment_only_without_a_whole_inner_one() -> None:
    inner = a5.build(1, 0x96, bytes(range(8)))
    head = overlapping(inner, 8)
    outer = head + inner[:5]
    assert cut(outer) == [(FRAME, outer.hex())]  # the inner one is not there: W is clean
    assert cut(outer + b"\x00" * 8) == [(FRAME, outer.hex()), (JUNK, "00" * 8)]  # nor is it good


def test_exception_in_a_chain() -> None:
    # U begins in V, V begins in W: both outer ones fall
    inmost = a5.build(1, 0x98, b"\x07" * 8)
    middle = overlapping(inmost, 6)
    outer = overlapping(middle + inmost, 6)
    data = outer + middle + inmost
    assert a5.is_good(data)
    assert a5.is_good(data, 6)
    assert a5.is_good(data, 12)
    # bytes 0..11 are left: A5 . . 08 cut off
    assert cut(data) == [(SHORT, data[:12].hex()), (FRAME, inmost.hex())]


# -- how long it waits ------------------------------------------------------------------------------------------------


def test_clean_frame_comes_at_its_last_byte() -> None:
    splitter = Splitter()
    assert splitter.feed(REPLY[:12]) == []
    assert splitter.pending == 12
    assert [record.data for record in splitter.feed(REPLY[12:])] == [REPLY]
    assert splitter.pending == 0


def test_clean_frame_behind_junk_comes_at_its_last_byte() -> None:
    splitter = Splitter()
    assert splitter.feed(b"\x00\x01" + REPLY[:12]) == []
    assert [record.kind for record in splitter.feed(REPLY[12:])] == [JUNK, FRAME]


def test_frame_that_ends_in_a5_waits_for_what_follows() -> None:
    # A5 + 01 + 90 + 08 = 13E; with a data byte of 67: 1A5
    frame = bytes.fromhex("a50190086700000000000000a5")
    splitter = Splitter()
    assert splitter.feed(frame) == []  # the beginning of another, whose sum could be right
    assert splitter.feed(b"\x01\x02") == []
    assert [record.data for record in splitter.feed(b"\x03")] == [frame]  # no 08: it is not
    splitter = Splitter()
    splitter.feed(frame)
    assert [record.data for record in splitter.flush()] == [frame]


def test_damaged_frame_comes_at_once() -> None:
    # A5 40 .. and A5 01 90 .. can not be other people's Modbus (functions 40; 01 with a byte count of 90)
    splitter = Splitter()
    bad_request = REQUEST[:-1] + b"\x00"
    assert [record.kind for record in splitter.feed(bad_request)] == [BAD]


def test_outer_frame_waits_for_the_inner_one() -> None:
    inner = a5.build(1, 0x96, bytes(range(8)))
    head = overlapping(inner, 8)
    splitter = Splitter()
    for byte in head + inner[:-1]:
        assert splitter.feed(bytes((byte,))) == []
    # the inner one is good; what stands where W ends (01 02 ..) is no window: the inner one it is
    assert [record.data for record in splitter.feed(inner[-1:])] == [head, inner]


# -- what is left -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"\xa5", [(JUNK, 1)]),
        (b"\xa5\x01\x90", [(JUNK, 3)]),
        (b"\xa5\x01\x90\x08", [(SHORT, 4)]),
        (REPLY[:12], [(SHORT, 12)]),
        (REPLY[:12] + REQUEST, [(SHORT, 12), (FRAME, 13)]),
        (REPLY[:3] + REQUEST, [(JUNK, 3), (FRAME, 13)]),
        (BROKEN, [(BAD, 13)]),
        (BROKEN + b"\x99", [(BAD, 13), (JUNK, 1)]),
        (b"\x99" + BROKEN + REPLY, [(JUNK, 1), (BAD, 13), (FRAME, 13)]),
        (BROKEN + REPLY[:5], [(BAD, 13), (SHORT, 5)]),
        (REPLY + b"\x0a" + REPLY, [(FRAME, 13), (JUNK, 1), (FRAME, 13)]),  # mpp-solar appends 0A
        (b"\xa5" * 20, [(JUNK, 20)]),
        (bytes(200), [(JUNK, 200)]),
        (b"\xd2", [(JUNK, 1)]),
        (b"\xd2\x03", [(SHORT, 2)]),
        (READ[:7], [(SHORT, 7)]),
        (READ[:7] + REPLY, [(SHORT, 7), (FRAME, 13)]),
        (READ[:7] + b"\xff", [(JUNK, 8)]),  # whole, CRC wrong
        (b"\xd2\x03\x03", [(SHORT, 3)]),  # no reply (odd), but a request cut off
        (b"\x51\x03\x03", [(JUNK, 3)]),
        (b"\x51\x03\xfe", [(JUNK, 3)]),  # 254 bytes: above 252
        (b"\x51\x03\x04\x01\x02\x03", [(SHORT, 6)]),  # 9 bytes expected
        (b"\x51\x03\x02" + b"\x01" * 4, [(JUNK, 7)]),
        (b"\x51\x83", [(SHORT, 2)]),
        (b"\x81\x83", [(JUNK, 2)]),
        (b"\x51\x83\x02\x00", [(SHORT, 4)]),
        (b"\x51\x83\x02\x00\x00", [(JUNK, 5)]),
        (b"\x81\x10\x00\x00\x00", [(SHORT, 5)]),
        (b"\x81\x10\x00\x00\x01", [(JUNK, 5)]),  # a count from 256 up
        (b"\x81\x10\x00\x00\x00\x00", [(JUNK, 6)]),  # a count of 0
        (b"\x81\x10\x00\x00\x00\x02" + b"\x01" * 5, [(SHORT, 11)]),  # 12 expected
        (b"\x81\x10\x00\x00\x00\x02" + b"\x01" * 6, [(JUNK, 12)]),  # no byte count 04: not 13
        (b"\x81\x10\x00\x00\x00\x02\x04" + b"\x01" * 5, [(SHORT, 12)]),  # with it, 13
        (b"\x51\x10\x00\x00\x00\x02\x01", [(SHORT, 7)]),
        (b"\x99\xd2\x03", [(JUNK, 1), (SHORT, 2)]),
        (b"\xd2\x03\xa5\x01\x90\x08", [(SHORT, 6)]),  # from the left: the Modbus beginning first
    ],
    ids=lambda value: value.hex()[:40] if isinstance(value, bytes) else None,
)
def test_gaps(data: bytes, expected: list[tuple[Kind, int]]) -> None:
    assert kinds(data) == expected


def test_bad_checksum_is_all_in_the_gap() -> None:
    # 13 bytes from A5 . . 08 on would reach into the good frame
    assert kinds(REPLY[:9] + REQUEST) == [(SHORT, 9), (FRAME, 13)]


def test_junk_ends_at_4096() -> None:
    assert kinds(bytes(4096)) == [(JUNK, 4096)]
    assert kinds(bytes(10000) + REPLY) == [(JUNK, 4096), (JUNK, 4096), (JUNK, 1808), (FRAME, 13)]


def test_long_gap_is_cut_not_hoarded() -> None:
    splitter = Splitter()
    out = splitter.feed(bytes(4096))
    out += splitter.feed(bytes(1))
    assert [len(record.data) for record in out] == [4096]
    assert splitter.pending == 1


# -- silence and events -----------------------------------------------------------------------------------------------


def test_no_record_crosses_silence() -> None:
    splitter = Splitter()
    out = splitter.feed(REPLY[:6]) + splitter.flush() + splitter.feed(REPLY[6:]) + splitter.flush()
    assert [(record.start, record.kind, len(record.data)) for record in out] == [(0, SHORT, 6), (6, JUNK, 7)]


def eventful(*parts: bytes) -> list[tuple[Kind, int]]:
    """Cut a stream with an event between each two parts."""
    splitter = Splitter()
    out = splitter.feed(parts[0])
    for part in parts[1:]:
        splitter.event()
        out += splitter.feed(part)
    out += splitter.flush()
    assert b"".join(record.data for record in out) == b"".join(parts)
    return [(record.kind, len(record.data)) for record in out]


def test_event_divides_junk() -> None:
    assert eventful(b"\x00\x00", b"\x00") == [(JUNK, 2), (JUNK, 1)]
    assert eventful(b"\x00\x00", b"", b"\x00" + REPLY) == [(JUNK, 2), (JUNK, 1), (FRAME, 13)]


def test_frame_bad_and_short_span_an_event() -> None:
    assert eventful(REPLY[:6], REPLY[6:]) == [(FRAME, 13)]
    assert eventful(BROKEN[:6], BROKEN[6:]) == [(BAD, 13)]
    assert eventful(REPLY[:6], REPLY[6:8]) == [(SHORT, 8)]
    assert eventful(b"\x00" + REPLY[:6], REPLY[6:8] + REQUEST) == [(JUNK, 1), (SHORT, 8), (FRAME, 13)]


def test_event_between_foreign_and_junk() -> None:
    sinowealth = real.data("sino-0-req") + real.data("sino-0-rsp")
    assert eventful(b"\x00\x00", sinowealth) == [(JUNK, 2), (FOREIGN, 6)]
    assert eventful(sinowealth, b"\x00\x00") == [(FOREIGN, 6), (JUNK, 2)]
    assert eventful(sinowealth[:3], sinowealth[3:]) == [(FOREIGN, 3), (JUNK, 3)]  # a request alone, then no request
    # a beginning in the piece before a foreign one ends with its piece
    assert eventful(REPLY[:6], sinowealth + REPLY) == [(SHORT, 6), (FOREIGN, 6), (FRAME, 13)]


def test_event_behind_what_is_decided_divides_the_gap_too() -> None:
    """A gap goes on behind a damaged frame; what stands behind the event is a piece of its own."""
    broken = bytes.fromhex("a51162086f398a1c0a76357c9b")  # 11 is no function of Modbus: it is decided at once
    sinowealth = bytes.fromhex("0a0a028795a8")
    assert eventful(broken, sinowealth) == [(BAD, 13), (FOREIGN, 6)]
    assert eventful(broken, sinowealth + REPLY) == [(BAD, 13), (FOREIGN, 6), (FRAME, 13)]
    assert eventful(broken + b"\x00", sinowealth + REPLY) == [(BAD, 13), (JUNK, 1), (FOREIGN, 6), (FRAME, 13)]
    assert eventful(REPLY, sinowealth) == [(FRAME, 13), (FOREIGN, 6)]
    assert eventful(broken, b"\x00" + sinowealth + REPLY) == [(BAD, 13), (JUNK, 7), (FRAME, 13)]


def test_piece_before_an_event_comes_as_soon_as_it_is_certain() -> None:
    splitter = Splitter()
    assert splitter.feed(real.data("sino-0-req") + real.data("sino-0-rsp")) == []
    splitter.event()
    assert [record.kind for record in splitter.feed(b"\xa5")] == [FOREIGN]


# -- foreign ----------------------------------------------------------------------------------------------------------


def foreign(data: bytes) -> list[tuple[Kind, int, str]]:
    return [(record.kind, len(record.data), record.foreign) for record in split(data)]


def test_real_sinowealth() -> None:
    exchanges = [real.data(name) for name in ("sino-0-req", "sino-0-rsp", "sino-1-req", "sino-1-rsp")]
    assert foreign(b"".join(exchanges)) == [(FOREIGN, 12, "Sinowealth")]
    assert foreign(exchanges[0]) == [(FOREIGN, 3, "Sinowealth")]
    assert foreign(exchanges[0] + exchanges[2]) == [(FOREIGN, 6, "Sinowealth")]
    assert foreign(exchanges[1]) == [(JUNK, 3, "")]
    wrong = exchanges[1][:-1] + b"\x00"
    assert foreign(exchanges[0] + wrong) == [(JUNK, 6, "")]
    assert foreign(exchanges[0] + exchanges[1][:2]) == [(JUNK, 5, "")]
    assert foreign(exchanges[0] + exchanges[1] + REPLY) == [(FOREIGN, 6, "Sinowealth"), (FRAME, 13, "")]
    assert foreign(bytes.fromhex("0a1702")) == [(JUNK, 3, "")]  # registers end at 16
    assert foreign(bytes.fromhex("0a0103")) == [(JUNK, 3, "")]


@pytest.mark.parametrize(
    "head",
    ["01030000000a", "0103 04 01020304", "0f01 01 ff", "0106 0001 0002", "0110 0000 0002", "0110 0000 0001 02 1234",
     "018302", "0190 01", "018f 01", "a504 0000 0001", "0001 0000 0001"],
)  # fmt: skip
def test_other_modbus(head: str) -> None:
    frame = with_crc(head.replace(" ", ""))
    assert foreign(frame) == [(FOREIGN, len(frame), "Modbus RTU")]
    assert foreign(REPLY + frame + frame + REQUEST) == [
        (FRAME, 13, ""),
        (FOREIGN, 2 * len(frame), "Modbus RTU"),
        (FRAME, 13, ""),
    ]
    assert foreign(frame + b"\x00") == [(JUNK, len(frame) + 1, "")]
    assert FOREIGN not in {record.kind for record in split(frame[:-1] + bytes((frame[-1] ^ 1,)))}


@pytest.mark.parametrize("head", ["0107 0000 0001", "0183", "0187 01", "0103 00"])
def test_not_even_other_modbus(head: str) -> None:
    assert {record.kind for record in split(with_crc(head.replace(" ", "")))} == {JUNK}


PYLONTECH = (b"~20024600800800000000FC22\r", b"~250F46900000FD90\r")  # pylon, pace of more-real-frames.jsonl
JBD = (bytes.fromhex("dda50300fffd77"), bytes.fromhex("dd0300024849ff6d77"))  # jbd-req; 02 + 48 + 49 = 93


@pytest.mark.parametrize(("frames", "name"), [(PYLONTECH, "Pylontech RS485"), (JBD, "JBD")])
def test_other_makers_batteries(frames: tuple[bytes, bytes], name: str) -> None:
    for frame in frames:
        assert foreign(frame) == [(FOREIGN, len(frame), name)]
        assert foreign(REPLY + frame + REQUEST) == [(FRAME, 13, ""), (FOREIGN, len(frame), name), (FRAME, 13, "")]
        for at in range(len(frame)):  # a wrong bit anywhere
            wrong = frame[:at] + bytes((frame[at] ^ 1,)) + frame[at + 1 :]
            if at != 1 or name != "JBD":  # which the sum of JBD does not hold
                assert FOREIGN not in {record.kind for record in split(wrong)}
            assert FOREIGN not in {record.kind for record in split(frame[:at])}
    both = b"".join(frames)
    assert foreign(both) == [(FOREIGN, len(both), name)]
    assert foreign(both + b"\x00") == [(JUNK, len(both) + 1, "")]
    assert foreign(both + frames[1][:-1]) == [(JUNK, len(both) + len(frames[1]) - 1, "")]


def test_two_makers_in_one_gap_are_not_foreign() -> None:
    assert foreign(JBD[0] + PYLONTECH[0]) == [(JUNK, 33, "")]


def test_a_frame_inside_another_makers_is_a_frame() -> None:
    """7D + 17D + 0D = 207: the sum of the JBD frame around it is right too."""
    request = bytes.fromhex("a540900800000000000000007d")
    around = bytes.fromhex("dd03000d") + request + bytes.fromhex("fdf977")
    assert foreign(around) == [(JUNK, 4, ""), (FRAME, 13, ""), (JUNK, 3, "")]


def test_small_letters_are_not_pylontechs() -> None:
    assert {record.kind for record in split(PYLONTECH[0].lower())} == {JUNK}


def test_long_run_is_not_foreign() -> None:
    frame = with_crc("01030000000a")
    assert foreign(frame * 512) == [(FOREIGN, 4096, "Modbus RTU")]
    assert {record.kind for record in split(frame * 513)} == {JUNK}
