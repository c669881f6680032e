# SPDX-License-Identifier: GPL-2.0-or-later
"""What is promised of any stream, however damaged and however cut; held against a slow literal reading of the rules."""

from __future__ import annotations

import itertools

from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.tools.dalyref import real

from dalyref import a5, modbus
from dalyref.kinds import Kind, Record
from dalyref.records import Splitter, split

HEADS = bytes((0xA5, 0xD2, *range(0x51, 0x61), *range(0x81, 0x91)))
REAL = [bytes.fromhex(row["hex"]) for row in real.FRAMES if row["checksum_ok"]]
MODBUS = [bytes.fromhex(row["hex"]) for row in real.ROWS if row["transport"] == "modbus" and row["checksum_ok"]]
EXCEPTIONS = [head + modbus.crc(head).to_bytes(2, "little") for head in (b"\x51\x83\x02", b"\xd2\x90\x01")]


def overlapped(inner: bytes, at: int, filler: int) -> bytes:
    """Return a frame's first `at` bytes with which `inner` sums up right by accident."""
    for address in range(256):
        head = bytes((0xA5, address, 0x95, 8)) + bytes((filler,)) * (at - 4)
        if a5.is_good(head + inner[: 13 - at]):
            return head
    raise AssertionError


def flip(data: bytes, bit: int) -> bytes:
    changed = bytearray(data)
    changed[bit // 8] ^= 1 << bit % 8
    return bytes(changed)


made = st.builds(a5.build, st.integers(0, 255), st.integers(0, 255), st.binary(min_size=8, max_size=8))
frames = st.one_of(st.sampled_from(REAL), st.sampled_from(MODBUS), st.sampled_from(EXCEPTIONS), made)
sly = st.lists(st.sampled_from(b"\xa5\x01\x95\x08\x00\xd2\x51\x81\x03\x06\x10\x83\x02\x0a\xff"), max_size=20).map(bytes)


def accident(inner: bytes, at: int, filler: int) -> bytes:
    return overlapped(inner, at, filler) + inner


def chain(inner: bytes, first: int, second: int) -> bytes:
    middle = accident(inner, first, 1)
    return accident(middle, second, 2)


tricky = st.one_of(made, st.just(a5.build(1, 0x96, b"\x00" + EXCEPTIONS[0] + b"\x00\x00")))
accidents = st.builds(accident, tricky, st.integers(4, 12), st.integers(0, 255))
chains = st.builds(chain, made, st.integers(4, 12), st.integers(4, 12))
parts = st.one_of(
    frames,
    frames.flatmap(lambda frame: st.integers(1, len(frame) - 1).map(lambda cut: frame[:cut])),
    frames.flatmap(lambda frame: st.integers(0, len(frame) * 8 - 1).map(lambda bit: flip(frame, bit))),
    sly,
    accidents,
    chains,
    st.binary(max_size=8),
)


streams = st.lists(parts, max_size=12).map(b"".join)


def literal_windows(data: bytes) -> list[tuple[int, int]]:
    """All good windows as (end, start), by the table of docs/records.md, section 2."""
    found: list[tuple[int, int]] = []
    for start in range(len(data)):
        rest = data[start:]
        if a5.is_good(rest):
            found.append((start + 13, start))
        d2, ask, answer = rest[0] == 0xD2, 0x81 <= rest[0] <= 0x90, 0x51 <= rest[0] <= 0x60
        for length in range(5, min(len(rest), 257) + 1):
            if modbus.crc(rest[:length]) != 0:
                continue
            function = rest[1]
            count = int.from_bytes(rest[4:6]) if length >= 8 else 0
            if (
                (function == 3 and length == 8 and (d2 or ask))
                or (
                    function == 3
                    and length == 5 + rest[2]
                    and rest[2] % 2 == 0
                    and 2 <= rest[2] <= 252
                    and (d2 or answer)
                )
                or (function == 6 and length == 8 and (d2 or ask or answer))
                or (function == 0x10 and length == 8 + 2 * count and 1 <= count <= 123 and (d2 or ask))
                or (
                    function == 0x10
                    and length == 9 + 2 * count
                    and 1 <= count <= 123
                    and rest[6] == 2 * count
                    and (d2 or ask)
                )
                or (function == 0x10 and length == 8 and (d2 or answer))
                or (function in {0x83, 0x86, 0x90} and length == 5 and (d2 or answer))
            ):
                found.append((start + length, start))
    return sorted(found)


def literal_frames(data: bytes) -> list[tuple[int, int]]:
    """The frames as (start, end), by docs/records.md, section 3, word by word."""
    windows = literal_windows(data)
    starts = {start for _, start in windows}
    a5_starts = {start for _, start in windows if data[start] == 0xA5}
    chosen: list[tuple[int, int]] = []
    at = 0
    candidates = windows
    while candidates := [(end, start) for end, start in candidates if start >= at]:
        end, start = candidates[0]
        contains = any(start < inner < end for inner in a5_starts)
        if data[start] == 0xA5 and contains and not (end in starts or end == len(data)):
            candidates = candidates[1:]
            continue
        chosen.append((start, end))
        at = end
    return chosen


def good(records: list[Record]) -> list[tuple[int, int]]:
    return [(record.start, record.start + len(record.data)) for record in records if record.kind is Kind.FRAME]


def chunked(data: bytes, cuts: list[int]) -> tuple[list[Record], int]:
    """Feed `data` in pieces; return the records and the most that was held."""
    splitter = Splitter()
    out: list[Record] = []
    held = 0
    borders = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    for first, last in itertools.pairwise(borders):
        out += splitter.feed(data[first:last])
        held = max(held, splitter.pending)
    return out + splitter.flush(), held


@settings(max_examples=300, deadline=None)
@given(streams)
@example(overlapped(a5.build(1, 0x96, bytes(range(8))), 8, 1) + a5.build(1, 0x96, bytes(range(8))))
def test_frames_are_those_of_the_rules(data: bytes) -> None:
    assert good(split(data)) == literal_frames(data)


@settings(max_examples=400, deadline=None)
@given(streams, st.lists(st.integers(0, 1 << 16), max_size=12))
def test_any_chunking_gives_the_same_records_and_loses_nothing(data: bytes, cuts: list[int]) -> None:
    whole = split(data)
    assert b"".join(record.data for record in whole) == data
    assert [record.start for record in whole] == [
        0,
        *itertools.accumulate(len(record.data) for record in whole),
    ][: len(whole)]
    assert all(record.data for record in whole)
    assert chunked(data, cuts)[0] == whole
    assert chunked(data, list(range(len(data))))[0] == whole


@settings(max_examples=200, deadline=None)
@given(streams)
@example(chain(a5.build(0, 0, b"Q\x03\x1a\0\0\0\0\0"), 4, 5) + chain(a5.build(0, 0, bytes(8)), 4, 4))
def test_nothing_comes_too_early_or_too_late(data: bytes) -> None:
    """A record comes with the byte that makes it certain.

    Too early would differ from the whole. Too late: a clean frame (nothing in it that could begin a window) must be out
    with its last byte, where nothing before it is held: that may have to wait for bytes behind it.
    """
    splitter = Splitter()
    out: list[Record] = []
    clean = {
        end: start
        for start, end in literal_frames(data)
        if data[start] == 0xA5
        and not any(byte in b"\xa5\xd2" or 0x51 <= byte <= 0x90 for byte in data[start + 3 : end])
    }
    held: list[int] = []  # by position: how much was held when it came
    for at, byte in enumerate(data):
        held.append(splitter.pending)
        out += splitter.feed(bytes((byte,)))
        if at + 1 in clean and held[clean[at + 1]] == 0:
            assert splitter.pending == 0
    assert out + splitter.flush() == split(data)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(parts, st.booleans()), max_size=12), st.lists(st.integers(0, 1 << 16), max_size=6))
def test_events_divide_the_same_however_chunked(pieces: list[tuple[bytes, bool]], cuts: list[int]) -> None:
    def run(size: int) -> list[Record]:
        splitter = Splitter()
        out: list[Record] = []
        for data, event in pieces:
            for at in range(0, len(data), size):
                out += splitter.feed(data[at : at + size])
            if event:
                splitter.event()
        return out + splitter.flush()

    whole = run(1 << 16)
    stream = b"".join(data for data, _ in pieces)
    assert b"".join(record.data for record in whole) == stream
    assert run(1) == whole
    assert run(7) == whole
    assert good(whole) == good(split(stream))  # an event takes no bytes
    events: set[int] = set()
    at = 0
    for data, event in pieces:
        at += len(data)
        if event:
            events.add(at)
    for record in whole:
        if record.kind in {Kind.JUNK, Kind.FOREIGN}:
            assert not any(record.start < event < record.start + len(record.data) for event in events)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(REAL), st.sampled_from(["whole", "flipped", "cut", "noise"])), max_size=20))
def test_undamaged_frames_are_found(bus: list[tuple[bytes, str]]) -> None:
    """Every whole frame of a damaged bus is found, unless a good window that is there by accident lies over it."""
    stream = b""
    expected: list[tuple[int, int]] = []
    for at, (frame, fate) in enumerate(bus):
        if fate == "whole":
            expected.append((len(stream), len(stream) + 13))
            stream += frame
        elif fate == "flipped":
            stream += flip(frame, at * 7 % 104)
        elif fate == "cut":
            stream += frame[: at % 12 + 1]
        else:
            stream += frame[at % 13 :] + b"\x00\xff"
    windows = literal_windows(stream)
    found = set(good(split(stream)))
    for start, end in expected:
        overlapping = [window for window in windows if window[1] < end and start < window[0] and window != (end, start)]
        assert (start, end) in found or overlapping


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.one_of(parts, st.sampled_from([bytes(1500), b"\x0a\x01\x02" * 600, b"\xd2\x03\xfa" * 300])), max_size=25
    ),
    st.integers(1, 700),
    st.booleans(),
)
def test_memory_is_bounded(pieces: list[bytes], size: int, events: bool) -> None:
    data = b"".join(pieces)
    splitter = Splitter()
    out: list[Record] = []
    for at in range(0, len(data), size):
        out += splitter.feed(data[at : at + size])
        if events:
            splitter.event()
        assert splitter.pending < 9000
    out += splitter.flush()
    assert splitter.pending == 0
    assert b"".join(record.data for record in out) == data
    assert max((len(record.data) for record in out), default=0) <= 4096


def test_cut_off_frames() -> None:
    """A real frame cut off anywhere, with two whole ones behind: both are found, always.

    All pairs of real frames, every cut, another real one behind: 28 812 streams. Measured: no frame lost, and no false
    frame (a record of kind frame that no one sent): rate 0. In 114 of
    the streams (1 in 253) the cut-off frame and the next sum up right by accident: without the exception of section 3
    the next one is lost there.
    """
    false = accidents = 0
    for first, second in itertools.product(range(len(REAL)), repeat=2):
        for cut in range(1, 13):
            stream = REAL[first][:cut] + REAL[second] + REAL[(first + second + cut) % len(REAL)]
            records = good(split(stream))
            assert (cut, cut + 13) in records, (stream.hex(), cut)
            assert (cut + 13, cut + 26) in records, (stream.hex(), cut)
            false += len(records) - 2
            accidents += a5.is_good(stream)
    assert accidents == 114, "the exception is put to the test"
    assert false == 0
