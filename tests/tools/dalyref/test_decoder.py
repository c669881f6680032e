# SPDX-License-Identifier: GPL-2.0-or-later
"""Packets, streams, silence, numbers, times and order: docs/records.md, sections 1 and 10; and bounded memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.tools.dalyref import real
from tests.tools.dalyref.traffic import EPOCH_NS, FRAME_MS, Capture, at, frame

from dalyref.decoder import Decoded, Decoder, Options, decode
from dalyref.packet import Packet

if TYPE_CHECKING:
    from dalyref.packet import Direction

ASK = frame(0x40, 0x90)
ANSWER = real.data("cpy-90")
CYCLE = [bytes.fromhex(row["hex"]) for row in real.FRAMES if row.get("group") == "tano"]


def shape(records: list[Decoded]) -> list[tuple[int, str, int]]:
    return [(record.number, record.kind.value, len(record.data)) for record in records]


def test_number_is_the_packet_in_which_it_ends() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(20, ANSWER[:7])
    capture.put(28, ANSWER[7:] + ASK + b"\x01")
    assert shape(capture.read()) == [(1, "frame", 13), (3, "frame", 13), (3, "frame", 13), (3, "junk", 1)]


def test_waiting_for_the_neighbour_does_not_change_the_number() -> None:
    # sum A5: the next bytes could make another frame that begins there. It belongs to packet 1 all the same.
    ends_in_a5 = bytes.fromhex("a50190086700000000000000a5")
    capture = Capture()
    capture.put(0, ends_in_a5)
    capture.put(20, ANSWER)
    assert shape(capture.read()) == [(1, "frame", 13), (2, "frame", 13)]


def test_time_of_the_first_byte() -> None:
    capture = Capture()
    capture.put(0, ASK + ANSWER[:3])
    capture.put(100, ANSWER[3:] + ASK)
    times = [record.time_ns - EPOCH_NS for record in capture.read()]
    # characters of 10 bits at 9600 baud: the second begins 13 later; the third 10 after the second packet's begin
    assert times == [0, 13_541_667, 100_000_000 + 10_416_667]
    slow = [record.time_ns - EPOCH_NS for record in capture.read(Options(baud=1200))]
    assert slow == [0, 108_333_333, 100_000_000 + 83_333_333]


def test_silence_gives_up_what_is_incomplete() -> None:
    for pause, kinds in ((250, ["frame"]), (250.0005, ["frame"]), (251, ["short", "junk"])):
        capture = Capture()
        capture.put(0, ANSWER[:7])
        capture.put(7 * 10 / 9.6 + pause, ANSWER[7:])
        assert capture.field("daly.kind") == kinds, pause


def test_silence_is_set_by_the_option() -> None:
    capture = Capture()
    capture.put(0, ANSWER[:7])
    capture.put(200, ANSWER[7:])
    assert [record.kind for record in capture.read(Options(quiet=0.1))] == ["short", "junk"]


def test_events_do_not_count_for_silence() -> None:
    capture = Capture()
    capture.put(0, ANSWER[:7])
    capture.put(400, b"")
    capture.put(100, ANSWER[7:])  # the stream itself was never silent
    assert shape(capture.read()) == [(2, "event", 0), (3, "frame", 13)]


def test_event_lies_between_the_junk_around_it() -> None:
    capture = Capture()
    capture.put(0, b"\x00\x00")
    capture.put(5, b"")
    capture.put(10, b"\x00")
    assert shape(capture.read()) == [(1, "junk", 2), (2, "event", 0), (3, "junk", 1)]


def test_directions_and_interfaces_are_streams_of_their_own() -> None:
    capture = Capture()
    capture.put(0, ANSWER[:7], side="inbound")
    capture.put(5, ASK[:4], side="outbound")
    capture.put(9, ASK, 1)
    capture.put(10, ANSWER[7:], side="inbound")
    capture.put(20, ASK[4:], side="outbound")
    records = capture.read()
    assert shape(records) == [(3, "frame", 13), (4, "frame", 13), (5, "frame", 13)]
    assert [(record.interface, record.direction) for record in records] == [(1, ""), (0, "inbound"), (0, "outbound")]


def test_order_is_that_of_the_packets_in_which_they_end() -> None:
    capture = Capture()
    capture.put(0, b"\x00", 0)  # is known to be junk only at the end
    capture.put(1, ASK, 1)
    capture.put(2, b"", 1)
    capture.put(20, ANSWER, 1)
    assert shape(capture.read()) == [(1, "junk", 1), (2, "frame", 13), (3, "event", 0), (4, "frame", 13)]


def test_other_link_types_are_passed_over() -> None:
    packets = [Packet(1, 0, ASK, link_type=1), Packet(2, 0, ASK, link_type=147), Packet(3, 0, ASK, link_type=162)]
    assert [record.number for record in decode(packets)] == [2, 3]


def test_comment_of_an_event() -> None:
    (event,) = decode([Packet(1, 5, b"", comment="port lost")])
    assert event.comment == "port lost"
    assert "port lost" not in event.fields.values()


# -- live: what comes when --------------------------------------------------------------------------------------------


def test_records_come_when_nothing_can_be_added() -> None:
    decoder = Decoder()
    assert decoder.feed(Packet(1, at(0), ASK)) == []  # its reply may come
    out = decoder.feed(Packet(2, at(50), ANSWER))
    assert [record.number for record in out] == [1, 2]
    assert out[0].fields["daly.reply_in"] == 2


def test_unanswered_request_comes_when_its_second_is_over() -> None:
    decoder = Decoder()
    assert decoder.feed(Packet(1, at(0), ASK)) == []
    assert decoder.feed(Packet(2, at(900), b"")) == []
    out = decoder.feed(Packet(3, at(3000), b""))
    assert [record.number for record in out] == [1, 2, 3]


def test_what_a_long_packet_holds_is_unanswered_once_the_next_packet_has_begun() -> None:
    """A request, and four seconds of other replies in the same packet: it is packets that tell (docs/records.md, 7)."""
    packet = Packet(1, at(0), frame(0x40, 0x91) + ANSWER * 300)
    first, *_ = decode([packet, Packet(2, at(4100), ANSWER)])
    assert first.fields["daly.unanswered"] is True
    alone, *_ = decode([packet])
    assert "daly.unanswered" not in alone.fields


def test_early_records_are_the_same_in_the_same_order() -> None:
    """A screen has each at once; what is added to it later shows there too."""
    early: list[Decoded] = []
    decoder = Decoder(early=early.append)
    assert decoder.feed(Packet(1, at(0), ASK)) == []
    assert [record.number for record in early] == [1]
    assert "daly.reply_in" not in early[0].fields
    out = decoder.feed(Packet(2, at(50), ANSWER)) + decoder.feed(Packet(3, at(900), ASK + b"\x00" + ANSWER))
    out += decoder.finish()
    assert len(out) == 5
    assert [id(record) for record in early] == [id(record) for record in out]
    assert early[0].fields["daly.reply_in"] == 2


def test_silent_neighbour_does_not_hold_up_for_ever() -> None:
    decoder = Decoder()
    decoder.feed(Packet(1, at(0), b"\x00"))
    out: list[Decoded] = []
    for number in range(2, 40):
        out += decoder.feed(Packet(number, at(number * 1000), ANSWER, interface=1))
    assert [record.number for record in out][:3] == [1, 2, 3]
    assert len(out) == 39


def test_hostile_captures_do_not_fill_the_memory() -> None:
    decoder = Decoder()
    out = len(decoder.feed(Packet(1, 0, b"\x00")))
    most = 0
    for number in range(2, 100_000):  # time stands still, one byte is pending
        done = len(decoder.feed(Packet(number, 0, b"" if number % 2 else ANSWER, interface=number % 2)))
        out += done
        most = max(most, number - out)
    assert most < 70_000
    assert out + len(decoder.finish()) == 99_999
    decoder = Decoder()
    held = 0
    for number in range(1, 30_000):  # every packet an interface of its own, every byte undecided
        held += 1 - len(decoder.feed(Packet(number, 0, b"\x00", interface=number)))
    assert held < 100
    decoder = Decoder()
    held = 0
    for number in range(1, 80_000):  # requests without end, all different
        held += 1 - len(decoder.feed(Packet(number, 0, frame(0x40, 0x90, *number.to_bytes(4)))))
    assert held < 66_000


# -- any cutting into packets ------------------------------------------------------------------------------------------

kinds = st.sampled_from([*CYCLE, ANSWER[:6], b"\x00\x0a", ANSWER[:-1] + b"\x00", bytes.fromhex("d203000c000157aa")])


@settings(max_examples=150, deadline=None)
@given(st.lists(kinds, max_size=25), st.lists(st.integers(1, 30), min_size=1, max_size=10))
def test_fields_do_not_depend_on_the_packets(parts: list[bytes], sizes: list[int]) -> None:
    """The same bytes at the same times on the wire, cut otherwise: the same records but for the packets' numbers."""
    stream = b"".join(parts)
    character = Options().characters_ns

    def run(cuts: list[int]) -> list[tuple[object, ...]]:
        packets: list[Packet] = []
        start = turn = 0
        while start < len(stream):
            size = cuts[turn % len(cuts)]
            packets.append(Packet(len(packets) + 1, EPOCH_NS + character(start), stream[start : start + size]))
            start += size
            turn += 1
        out: list[tuple[object, ...]] = []
        for record in decode(packets):
            fields = dict(record.fields)
            for name in (
                "daly.request_in",
                "daly.reply_in",
                "daly.reassembled_in",
                "daly.late_to",
                "daly.changed_from",
            ):
                if name in fields:
                    fields[name] = True
            after = fields.pop("daly.response_time", None)
            times.append(record.time_ns)
            times.append(-1 if after is None else float(str(after)) * 1e9)
            out.append((record.kind, record.data, fields))
        return out

    times: list[float] = []
    once = run([max(len(stream), 1)])
    expected, times = times, []
    assert b"".join(bytes(record[1]) for record in once if isinstance(record[1], bytes)) == stream
    for cuts in (sizes, [1]):
        assert run(cuts) == once
        assert times == pytest.approx(expected, abs=2)  # ns: a character's time is rounded
        times = []


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            kinds | st.just(b"") | st.binary(max_size=30),
            st.integers(0, 2),
            st.sampled_from(["", "inbound", "outbound"]),
            st.integers(-50, 700),
        ),
        max_size=40,
    )
)
def test_no_byte_is_lost_and_streams_do_not_mix(rows: list[tuple[bytes, int, Direction, int]]) -> None:
    packets: list[Packet] = []
    ms = 0
    for data, interface, side, pause in rows:
        ms += pause
        packets.append(Packet(len(packets) + 1, at(ms), data, interface, "bus=x", side))
    records = list(decode(packets))
    assert [record.number for record in records] == sorted(record.number for record in records)
    for key in {(packet.interface, packet.direction) for packet in packets}:
        sent = b"".join(packet.data for packet in packets if (packet.interface, packet.direction) == key)
        got = b"".join(record.data for record in records if (record.interface, record.direction) == key)
        assert got == sent
    assert sum(record.kind == "event" for record in records) == sum(not packet.data for packet in packets)
    decoder = Decoder()
    live = [record for packet in packets for record in decoder.feed(packet)] + decoder.finish()
    assert [record.fields for record in live] == [record.fields for record in records]


def test_a_whole_real_cycle() -> None:
    capture = Capture()
    ms = 0.0
    for data in CYCLE:
        capture.put(ms, data)
        ms += FRAME_MS + (37 if data[1] >= 0x20 else 0)
    records = capture.read()
    requests = [record for record in records if record.fields["daly.direction"] == 1]
    replies = [record for record in records if record.fields["daly.direction"] == 2]
    assert len(requests) + len(replies) == len(CYCLE)
    assert all("daly.reply_in" in record.fields for record in requests)
    assert all("daly.request_in" in record.fields for record in replies)


def test_silence_closes_a_gap_that_holds_nothing_back() -> None:
    """A damaged frame is certain at once; what comes after silence is a gap of its own, here another maker's Modbus."""
    damaged = bytes.fromhex("a58098080000000000008000c5")
    foreign = bytes.fromhex("020300f4000285ca")
    decoder = Decoder()
    records = decoder.feed(Packet(1, 0, damaged)) + decoder.feed(Packet(2, 5_000_000_000, foreign)) + decoder.finish()
    assert [(record.number, record.kind) for record in records] == [(1, "bad_checksum"), (2, "foreign")]
