# SPDX-License-Identifier: GPL-2.0-or-later
"""The quick way reads the same values as the reference decoder, record by record."""

from __future__ import annotations

import itertools
import tracemalloc
from typing import TYPE_CHECKING

import pytest
from bench.soak import likely_bus, trouble, write
from tests.tools.dalytools.bulk.both import plain_fields, plainly, quick_fields
from tests.tools.dalytools.made import ANSWER, ASK, SAMPLES, a5
from tests.tools.dalytools.made import write as write_packets

from bench import poll_cycle
from dalycapture.errors import CaptureError
from dalyref.options import Options
from dalytools.bulk.lots import Batch, Decoder
from dalytools.bulk.packets import Interfaces
from dalytools.bulk.read import read
from dalytools.bulk.reading import read_columns
from dalytools.bulk.records import Cutter
from dalytools.bulk.unlike import UnlikeError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.traffic import Made

    from dalytools.bulk.records import Records

CAPTURES = sorted(path for path in SAMPLES.iterdir() if path.suffix in {".pcapng", ".pcap"})


def quick_only(path: Path) -> Iterator[Batch]:
    """The quick way without the plain one behind it."""
    interfaces = Interfaces()
    cutter, decoder = Cutter(Options(), interfaces), Decoder(Options(), interfaces)
    for packets in read_columns(path, interfaces):
        yield decoder.take(cutter.take(packets))


def agree(path: Path, *chunks: int, options: Options | None = None) -> int:
    """Hold both ways against each other; return how many records there are."""
    expected = plain_fields(plainly(path, options)[0])
    for chunk in chunks:
        found = quick_fields(path, chunk=chunk, options=options)
        for one, other in zip(found, expected, strict=True):
            assert one == other
    return len(expected)


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_samples(path: Path) -> None:
    assert agree(path, 1 << 20, 64, 200)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", [trouble, likely_bus])
def test_trouble(make: Callable[[int], Iterator[Made]], seed: int, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    write(path, itertools.islice(make(seed), 2000))
    assert agree(path, 1 << 20, 3000) > 1800


@pytest.mark.parametrize("make", [trouble, likely_bus])
def test_the_plain_decoder_takes_over_anywhere(
    make: Callable[[int], Iterator[Made]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "x.pcapng"
    write(path, itertools.islice(make(9), 500))
    expected = plain_fields(plainly(path)[0])
    left = 0
    quick = Decoder.take

    def take(decoder: Decoder, records: Records) -> Batch:
        nonlocal left
        left -= 1
        if left < 0:
            raise UnlikeError("made")
        return quick(decoder, records)

    monkeypatch.setattr(Decoder, "take", take)
    for lots in range(0, 60, 3):
        left = lots
        assert quick_fields(path, chunk=600) == expected


def test_what_stands_behind_a_text_is_no_part_of_it(tmp_path: Path) -> None:
    """The manufacturer has 16 letters (field notes a.2): two in the third frame, and stale bytes behind them."""
    frames = [a5(1, 0x55, bytes((n,)) + part) for n, part in enumerate((b"DALY BM", b"S Co Lt", b"d.stale"), 1)]
    path = write_packets(tmp_path / "x.pcapng", [*((0.02 * n, each) for n, each in enumerate(frames)), (2.0, ASK)])
    assert agree(path, 1 << 20) == 4
    texts = [text for batch in read(path) for text in batch.texts]
    assert [text[-1] for text in texts] == ["DALY BMS Co Ltd."]


# What only the plain decoder decides: it takes over, and says what it says.


def part(number: int, millivolts: int = 3300, address: int = 1) -> bytes:
    return a5(address, 0x95, bytes((number,)) + millivolts.to_bytes(2, "big") * 3)


def test_a_clock_that_goes_back_within_a_burst(tmp_path: Path) -> None:
    rows = [(0.0, part(1)), (0.02, part(2)), (20.0, b""), (0.1, part(3)), (0.2, part(4)), (1.0, ASK), (21.0, ANSWER)]
    path = write_packets(tmp_path / "x.pcapng", rows)
    with pytest.raises(UnlikeError):
        list(quick_only(path))
    assert agree(path, 1 << 20, 100) == 7


def test_thousands_of_records_in_a_moment(tmp_path: Path) -> None:
    path = write_packets(tmp_path / "x.pcapng", [(1e-6 * at, part(1 + at % 3)) for at in range(60_000)])
    with pytest.raises(UnlikeError):
        list(quick_only(path))


def test_a_burst_over_thousands_of_records(tmp_path: Path) -> None:
    """One number again and again is one burst; the plain decoder ends it when it holds 65536 records."""
    path = write_packets(tmp_path / "x.pcapng", [(0.3 * at, part(1)) for at in range(9000)])
    with pytest.raises(UnlikeError):
        list(quick_only(path))
    assert sum(len(batch.records) for batch in read(path)) == 9000


def test_other_media_are_said(tmp_path: Path) -> None:
    path = write_packets(tmp_path / "x.pcapng", [(0.0, ASK)], link_type=227)
    with pytest.raises(CaptureError, match=r"x\.pcapng: holds packets that are not of a serial line; read it with"):
        list(read(path))


def test_counts_for_a_burst_are_those_at_its_beginning_whatever_the_chunk(tmp_path: Path) -> None:
    status = a5(1, 0x94, bytes((4, 1, 0, 0, 0, 0, 9, 0)))
    rows = [(0.0, part(1)), (0.02, part(2)), (0.1, status), (0.2, part(1)), (0.22, part(2)), (0.3, part(1, 3210))]
    rows += [(0.32, part(2, 3210)), (0.34, part(2, 3200)), (0.36, part(3))]
    path = write_packets(tmp_path / "x.pcapng", rows)
    tables = [batch.cells for chunk in (1, 50, 1 << 20) for batch in read(path, chunk=chunk) if batch.cells]
    found = [table.columns["daly.cells.voltage"].value(row) for table in tables for row in range(len(table))]
    # Without a count all six slots; with it four; a repeat of the last frame shows the table again.
    once = [[3300] * 6, [3300] * 4, [3210] * 4, [3210, 3210, 3210, 3200]]
    assert found == once * 3
    assert agree(path, 1, 50, 1 << 20) == 9


def test_echoes_that_neighbours_do_not_tell(tmp_path: Path) -> None:
    """A request that comes again within 100 ms is an echo unless it was answered (docs/records.md, 6)."""
    ask, other = a5(0x40, 0x90), a5(0x40, 0x93)
    answer, late = a5(1, 0x90, b"\1"), a5(1, 0x93, b"\1")
    rows = [
        *((0.00, ask), (0.02, other), (0.04, answer), (0.07, ask)),  # answered behind another request: the next poll
        *((2.00, ask), (2.02, other), (2.04, late), (2.07, ask), (2.09, ask)),  # not answered: an echo, then a retry
        *((4.00, ask), (4.02, ask), (4.04, answer), (4.06, ask), (4.08, ask)),  # echo; answered; echo again
        *((6.00, part(1)), (6.02, a5(0x40, 0x95)), (6.04, part(2)), (6.06, a5(0x40, 0x95))),  # 2 goes on: no answer
        *((8.00, part(2)), (8.02, a5(0x40, 0x95)), (8.04, part(2)), (8.06, a5(0x40, 0x95))),  # asked again: an answer
    ]
    path = write_packets(tmp_path / "x.pcapng", rows)
    expected = [1, 1, 2, 1, 1, 1, 2, 3, 1, 1, 3, 2, 1, 3, 2, 1, 2, 3, 2, 1, 2, 1]
    for chunk in (1, 100, 1 << 20):
        assert [one for batch in read(path, chunk=chunk) for one in batch.direction.tolist()] == expected
    assert agree(path, 1, 100, 1 << 20) == len(rows)


def test_a_burst_behind_damage_counts_from_0_where_its_board_did(tmp_path: Path) -> None:
    """Docs/records.md, 8, the base, on two interfaces of one bus. Of five cells, number 1 has three, or two from 0."""
    status = a5(1, 0x94, bytes((5, 1, 0, 0, 0, 0, 9, 0)))
    bad, junk, event = part(0)[:-1] + b"\0", b"\x11\x22", b""
    both = [
        (status, event),
        (bad, part(1)),  # 3 cells
        (part(1), event),  # 3: behind damage, but no number 0 was seen
        (part(0), part(1)),  # 3, 3
        (junk, bad),
        (ASK, part(1)),  # 2
        (part(1), junk),  # 3: behind the request
        (junk, event),
        (event, part(1)),  # 2
        (part(16), part(2)),  # none, for 16 is no number from 0; and 2
        (part(1), event),  # 3: behind a good frame
    ]
    rows = [(0.6 * at, data) for at, data in enumerate(data for pair in both for data in pair)]
    path = write_packets(tmp_path / "x.pcapng", rows, interfaces=("bus=one", "bus=one second tap"))

    def cells(batches: Iterator[Batch]) -> list[object]:
        tables = [batch.replies[0x95] for batch in batches if 0x95 in batch.replies]
        return [table.columns["daly.cell.voltage"].value(row) for table in tables for row in range(len(table))]

    expected = [3, 3, 3, 3, 2, 3, 2, 0, 2, 3]
    assert cells(quick_only(path)) == [[3300] * count or None for count in expected]
    assert agree(path, 1, 100, 1 << 20) == len(rows)


def test_memory_is_bounded(tmp_path: Path) -> None:
    """Eight times the capture takes no more memory (numpy tells tracemalloc of its arrays)."""

    def peak(frames: int) -> int:
        path = tmp_path / f"{frames}.pcapng"
        poll_cycle.write(path, frames)
        for _ in read(path, chunk=1 << 17):
            pass
        tracemalloc.start()
        try:
            assert sum(len(batch.records) for batch in read(path, chunk=1 << 17)) == frames
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    small, large = peak(8_000), peak(64_000)
    assert large < 1.5 * small
    assert large < 8 << 20
