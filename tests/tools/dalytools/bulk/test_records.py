# SPDX-License-Identifier: GPL-2.0-or-later
"""The quick way cuts a capture into the same records as the reference decoder, whatever is in it."""

from __future__ import annotations

import gzip
import itertools
import random
import struct
from typing import TYPE_CHECKING

import pytest
from bench.soak import likely_bus, trouble, write
from tests.tools.dalytools.bulk.both import pieces_of, plainly, quick_pieces
from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, SAMPLES, a5
from tests.tools.dalytools.made import write as write_packets

from dalyref.options import Options
from dalytools.bulk.read import read
from dalytools.bulk.unlike import UnlikeError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.traffic import Made

CAPTURES = sorted(path for path in SAMPLES.iterdir() if path.suffix in {".pcapng", ".pcap"})


def agree(path: Path, *, chunk: int = 1 << 20, options: Options | None = None) -> int:
    """Hold both ways against each other; return how many records there are."""
    decoded, said = plainly(path, options)
    expected = pieces_of(decoded)
    found, problem = quick_pieces(path, chunk=chunk, options=options)
    assert found == expected
    assert problem == said
    return len(found)


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_samples(path: Path) -> None:
    assert agree(path)
    assert agree(path, chunk=64)
    assert agree(path, options=Options(baud=1200, quiet=0.02))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("make", [trouble, likely_bus])
def test_trouble(make: Callable[[int], Iterator[Made]], seed: int, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    write(path, itertools.islice(make(seed), 3000))
    assert agree(path) > 2700
    assert agree(path, chunk=5000) > 2700


def test_chunks_end_anywhere(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    write(path, itertools.islice(trouble(7), 20))
    size = path.stat().st_size
    decoded, _ = plainly(path)
    expected = pieces_of(decoded)
    for chunk in (1, 2, 3, 5, 13, 47, 48, *range(100, size + 2)):  # the first chunk ends everywhere
        assert quick_pieces(path, chunk=chunk) == (expected, "")


def test_cut_off_anywhere(tmp_path: Path) -> None:
    whole = tmp_path / "whole.pcapng"
    write(whole, itertools.islice(likely_bus(5), 12))
    content = whole.read_bytes()
    path = tmp_path / "x.pcapng"
    for size in range(len(content)):
        path.write_bytes(content[:size])
        agree(path, chunk=300)


def test_damaged_anywhere(tmp_path: Path) -> None:
    """Lengths that lie, interfaces that are not there, options longer than their block."""
    whole = tmp_path / "whole.pcapng"
    write(whole, itertools.islice(trouble(11), 40))
    content = whole.read_bytes()
    path = tmp_path / "x.pcapng"
    r = random.Random(1)
    compared = 0
    for _ in range(200):
        damaged = bytearray(content)
        for _ in range(r.choice((1, 1, 2, 5))):
            at = r.randrange(len(damaged) // 4) * 4
            damaged[at : at + 4] = r.choice(
                (r.randbytes(4), struct.pack("<I", r.choice((0, 1, 6, 12, 31, 32, 48, 60, 1 << 31)))),
            )
        path.write_bytes(damaged)
        try:
            quick_pieces(path, chunk=1000)
        except UnlikeError:  # the link type was hit, or the time is in another century
            continue
        agree(path, chunk=r.choice((100, 1000, 1 << 20)))
        compared += 1
    assert compared > 170


def block(order: str, kind: int, body: bytes) -> bytes:
    return struct.pack(order + "II", kind, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)


def section(order: str, resolution: int = 9, offset: int = 0, link_type: int = 147, snap: int = 0) -> bytes:
    options = struct.pack(order + "HHB3x", 9, 1, resolution) + struct.pack(order + "HHq", 14, 8, offset)
    return block(order, 0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1)) + block(
        order, 1, struct.pack(order + "HHI", link_type, 0, snap) + options + bytes(4)
    )


def packet(order: str, ticks: int, data: bytes, options: bytes = b"", interface: int = 0) -> bytes:
    head = struct.pack(order + "IIIII", interface, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data))
    return block(order, 6, head + data + bytes(-len(data) % 4) + options)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("resolution", "offset", "ticks_a_second"),
    [(9, 0, 10**9), (6, 0, 10**6), (6, 5, 10**6), (3, 0, 1000), (0x8A, 0, 1024)],
)
def test_sections_orders_and_times(
    order: str, resolution: int, offset: int, ticks_a_second: int, tmp_path: Path
) -> None:
    second = EPOCH_NS // 10**9
    flags = struct.pack(order + "HHI", 2, 4, 1)
    dropped = struct.pack(order + "HHQ", 4, 8, 3)
    comment = struct.pack(order + "HH", 1, 4) + b"mark"
    content = section(order, resolution, offset)
    for row in range(60):
        end = bytes(4) if row % 2 else b""
        options = (b"", flags + end, b"", comment + end, flags + dropped + end, bytes(4))[row % 6]
        content += packet(order, (second + row) * ticks_a_second, ANSWER if row % 3 else ASK, options)
    content += block(order, 5, struct.pack(order + "III", 0, 0, 0))  # statistics
    content += block(order, 2, struct.pack(order + "HHIIII", 0, 0, 0, 77, 13, 13) + ANSWER + bytes(3))  # obsolete
    content += block(order, 3, struct.pack(order + "I", 13) + ANSWER + bytes(3))  # simple: no time
    content += block(order, 0xBAD, bytes(8))  # takes a number
    other = "<>"[order == "<"]
    content += section(other, 9) + packet(other, EPOCH_NS, ASK) + packet(other, EPOCH_NS + 1, ANSWER, b"", 0)
    path = tmp_path / "x.pcapng"
    path.write_bytes(content)
    assert agree(path) == 64
    assert agree(path, chunk=50) == 64


def test_times_of_the_next_century_are_left_to_the_plain_decoder(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    path.write_bytes(section("<", 9) + packet("<", (1 << 63) - 1, ASK))
    with pytest.raises(UnlikeError):
        quick_pieces(path)
    assert [batch.records.time_ns.tolist() for batch in read(path)] == [[(1 << 63) - 1]]


def test_impossible_times_are_the_plain_reader_s(tmp_path: Path) -> None:
    """Before 1970, by the interface's offset, or beyond 64 bits: no time."""
    path = tmp_path / "x.pcapng"
    path.write_bytes(section("<", 6, -9) + packet("<", 8_000_000, ASK) + packet("<", 10_000_000, ANSWER))
    assert agree(path) == 2
    path.write_bytes(section("<", 6) + packet("<", 1 << 63, ASK) + packet("<", EPOCH_NS // 1000, ANSWER))
    assert agree(path) == 2


def test_other_formats(tmp_path: Path) -> None:
    """Compressed files and classic pcap come packet by packet, and give the same."""
    classic = SAMPLES / "made-classic.pcap"
    packed = tmp_path / "x.pcapng.gz"
    packed.write_bytes(gzip.compress((SAMPLES / "made-poll-cycle.pcapng").read_bytes()))
    for path in (classic, packed):
        assert agree(path)
    packed.write_bytes(packed.read_bytes()[:-300])
    agree(packed)


WAITS = a5(1, 0x90, bytes(7) + b"\x67")
"""Its sum is A5: another frame could begin there (docs/records.md, 3)."""


def test_a_frame_that_waits_for_its_neighbour(tmp_path: Path) -> None:
    assert WAITS[-1] == 0xA5
    path = tmp_path / "x.pcapng"
    # In front of a frame, of junk that makes another frame of its last byte, of silence, and of the end.
    inner = a5(1, 0x93, bytes(8))[1:]
    rows = [
        (0.0, WAITS),
        (0.05, ANSWER),
        (0.1, WAITS),
        (0.12, inner),
        (0.2, ASK),
        (0.25, WAITS),
        (0.9, b"\x55"),
        (1.5, WAITS),
    ]
    write_packets(path, rows)
    assert agree(path) == 8
    assert agree(path, chunk=1) == 8


def test_what_is_left_of_a_gap_is_remembered(tmp_path: Path) -> None:
    """After a damaged frame nothing is held, but other people's frame behind it is no piece of its own."""
    others = bytes.fromhex("010300000002c40b")  # Modbus RTU: read two registers of station 1
    bad = ASK[:-1] + b"\x00"  # no piece of a Modbus frame either: it is told at once
    rows = [
        (0.0, bad),
        (0.02, others),
        (0.04, ASK),
        (0.06, others),
        (0.08, ANSWER),
        (0.1, bad),
        (0.12, ASK),
        (0.14, others),
    ]
    path = write_packets(tmp_path / "x.pcapng", rows)
    kinds = ["bad_checksum", "junk", "frame", "foreign", "frame", "bad_checksum", "frame", "foreign"]
    assert [piece[2] for piece in quick_pieces(path)[0]] == kinds
    assert agree(path) == 8
    assert agree(path, chunk=1) == 8


def test_two_taps_one_of_them_stuck(tmp_path: Path) -> None:
    """Bytes held on one tap hold up the other, until they are given up for their silence."""
    rows: list[tuple[float, bytes]] = [(0.0, ASK), (0.01, ANSWER[:7])]
    for step in range(1, 300):
        rows += [(0.05 * step, ASK if step % 2 else ANSWER), (0.05 * step + 1e-6, b"" if step != 290 else ASK)]
    path = write_packets(tmp_path / "x.pcapng", rows, interfaces=("dalyshark bus=a", "dalyshark bus=a too"))
    assert agree(path) > 500
    assert agree(path, chunk=1000) > 500
