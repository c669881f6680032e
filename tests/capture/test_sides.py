# SPDX-License-Identifier: GPL-2.0-or-later
"""Two taps, line errors, user's marks, a clock that is set: what is in the file, and in which order."""

from __future__ import annotations

import os
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus, a5, numbered

from dalycapture.adapters import Adapter
from dalycapture.clock import WallClock
from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalycapture.line import Counts
from dalycapture.opening import open_port
from dalycapture.port import Facts
from dalycapture.reader import read_capture
from dalycapture.side import Side
from dalycapture.sniffer import Sniffer
from dalycapture.waiting import Waiter
from dalyref.decoder import decode

if TYPE_CHECKING:
    from collections.abc import Callable, Generator
    from pathlib import Path


REQUEST = a5(0x40, 0x90)
FRAME = bytes.fromhex("a501900800f80000753001815d")  # cpy-90 of the real frames
CRC, SYMBOL = 1 << 24, 1 << 31  # epb_flags, pcapng 4.3.1


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.005)


class Flags:
    """What pcapng says beyond what our reader keeps: epb_flags and epb_dropcount of each packet, by python-pcapng."""

    def __init__(self, path: Path) -> None:
        from pcapng import FileScanner
        from pcapng.blocks import EnhancedPacket, InterfaceStatistics

        with path.open("rb") as file:
            blocks = list(FileScanner(file))
        packets = [block for block in blocks if isinstance(block, EnhancedPacket)]
        self.flags = [_number(block, "epb_flags") for block in packets]
        self.dropped = [_number(block, "epb_dropcount") for block in packets]
        statistics = [block for block in blocks if isinstance(block, InterfaceStatistics)]
        self.os_dropped = [_number(block, "isb_osdrop") for block in statistics]


def _number(block: Any, option: str) -> int:
    try:
        return int.from_bytes(block.options.get_raw(option), "little")
    except (KeyError, IndexError):
        return 0


@contextmanager
def running(sniffer: Sniffer) -> Generator[Sniffer]:
    thread = threading.Thread(target=sniffer.run)
    thread.start()
    try:
        yield sniffer
    finally:
        sniffer.stop()
        thread.join(20)
        assert not thread.is_alive()


def sides(*buses: Bus) -> list[Side]:
    return [
        Side(open_port(bus.port), tap(bus.port, side=name), name=name)
        for bus, name in zip(buses, ("host", "bms"), strict=True)
    ]


def test_two_taps_are_one_bus_with_directions(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as host, Bus() as bms:
        sniffer = Sniffer(sides(host, bms), [open_writer(path)])
        with running(sniffer):
            for number in range(10):
                host.send(REQUEST)
                time.sleep(0.03)
                bms.send(numbered(number))
                time.sleep(0.03)
            until(lambda: sniffer.tally.records == 20)
    packets = list(read_capture(path))
    assert [packet.direction for packet in packets] == ["outbound", "inbound"] * 10
    assert [packet.interface for packet in packets] == [0, 1] * 10
    assert [packet.data for packet in packets] == [one for n in range(10) for one in (REQUEST, numbered(n))]
    assert packets[0].description.startswith(f"dalyshark bus=main side=host 9600 8N1 {host.port}")
    assert [(one.name, one.records, one.bytes) for one in sniffer.tally.sides] == [
        (host.port, 10, 130),
        (bms.port, 10, 130),
    ]
    records = list(decode(packets))
    assert [record.fields["daly.reply_in"] for record in records[::2]] == [record.number for record in records[1::2]]


def test_what_began_first_comes_first_though_it_is_complete_later(tmp_path: Path) -> None:
    """The host's long burst is under way while the BMS says one frame: bytes arrive host, bms, host."""
    path = tmp_path / "x.pcapng"
    with Bus() as host, Bus() as bms:
        sniffer = Sniffer(sides(host, bms), [open_writer(path)])
        with running(sniffer):
            host.send(REQUEST[:6])
            until(lambda: sniffer.tally.sides[0].bytes == 6)
            time.sleep(0.02)
            bms.send(FRAME)
            until(lambda: sniffer.tally.sides[1].bytes == 13)
            assert sniffer.tally.records == 0  # held: the host's began earlier, and may be anything yet
            host.send(REQUEST[6:])
            until(lambda: sniffer.tally.records == 2)
    packets = list(read_capture(path))
    assert [packet.data for packet in packets] == [REQUEST, FRAME]
    assert packets[0].time_ns < packets[1].time_ns


def test_silence_gives_up_what_holds_the_other_side(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as host, Bus() as bms:
        sniffer = Sniffer(sides(host, bms), [open_writer(path)])
        with running(sniffer):
            host.send(REQUEST[:6])
            until(lambda: sniffer.tally.sides[0].bytes == 6)
            time.sleep(0.02)
            bms.send(FRAME)
            until(lambda: sniffer.tally.records == 2)  # nothing more comes
    assert [packet.data for packet in read_capture(path)] == [REQUEST[:6], FRAME]


class MarkedPort:
    """A port whose driver marks errors and counts them; the bytes come by a pipe."""

    def __init__(self) -> None:
        self.name = "/dev/ttyUSB0"
        self.facts = Facts(Adapter(self.name), marked=True)
        self.now = Counts(rx=1000, frame=5)
        self._reading, self._writing = os.pipe()
        os.set_blocking(self._reading, False)

    def fileno(self) -> int:
        return self._reading

    def send(self, data: bytes) -> None:
        os.write(self._writing, data)

    def read(self) -> bytes | None:
        return os.read(self._reading, 4096)

    def counts(self) -> Counts:
        return self.now

    def close(self) -> None:
        if self._reading >= 0:
            os.close(self._reading)
            os.close(self._writing)
            self._reading = -1


def test_line_errors_are_flags_events_and_counts(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    port = MarkedPort()
    sniffer = Sniffer([Side(port, tap(port.name))], [open_writer(path)])
    with running(sniffer):
        until(lambda: path.exists() and path.stat().st_size)
        port.send(FRAME[:4] + b"\xff\x00\x41")  # the fifth byte came badly: 41 for 00; the mark is torn
        port.send(FRAME[5:])
        until(lambda: sniffer.tally.records == 1 or sniffer.tally.bytes == 13)
        port.send(FRAME + b"\xff\x00\x00" + FRAME)  # a break between two good ones
        until(lambda: sniffer.tally.records == 3)
        port.now = Counts(rx=1039, frame=6, overrun=2, breaks=1)
        until(lambda: sniffer.tally.lost == 2)
        port.send(FRAME)
        until(lambda: sniffer.tally.records == 4)
    packets = list(read_capture(path))
    bad = FRAME[:4] + b"\x41" + FRAME[5:]
    assert [packet.data for packet in packets if packet.data] == [bad, FRAME, FRAME, FRAME]
    flags = Flags(path)
    by_record = [
        (one, lost) for packet, one, lost in zip(packets, flags.flags, flags.dropped, strict=True) if packet.data
    ]
    assert by_record == [(CRC | SYMBOL, 0), (0, 0), (SYMBOL, 0), (0, 2)]
    events = [packet.comment for packet in packets if not packet.data]
    assert events[0] == "line errors: 1 bytes marked"
    assert "1 framing errors, 2 overruns, 1 breaks" in " ".join(events[1:])
    assert "1 breaks marked" in " ".join(events[1:])
    assert flags.os_dropped == [2]
    side = sniffer.tally.sides[0]
    assert (side.marked, side.breaks, side.counts) == (1, 1, Counts(rx=39, frame=1, overrun=2, breaks=1))


def test_a_noisy_line_is_one_event_a_second() -> None:
    port = MarkedPort()
    side = Side(port, tap("x"))
    told = 0
    for number in range(300):  # three seconds, an error each 10 ms
        now = 5_000_000_000 + number * 10_000_000
        port.send(b"\xff\x00\x41")
        side.read(lambda now=now: now, now, 0)
        told += side.trouble(now) is not None
    assert told == 3
    side.close()


def test_a_user_s_mark_lies_where_it_was_made(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as bus:
        sniffer = Sniffer([Side(open_port(bus.port), tap("x"))], [open_writer(path)])
        with running(sniffer):
            bus.send(FRAME)
            until(lambda: sniffer.tally.records == 1)
            time.sleep(0.02)
            sniffer.mark("breaker opened")
            sniffer.mark()
            until(lambda: sniffer.tally.events == 2)
            bus.send(FRAME[:5])
            until(lambda: sniffer.tally.bytes == 18)
            time.sleep(0.02)
            sniffer.mark("in the middle")  # of a frame: it began before, and is whole
            time.sleep(0.02)
            bus.send(FRAME[5:])
            until(lambda: sniffer.tally.events == 3)
    packets = list(read_capture(path))
    assert [(packet.data, packet.comment) for packet in packets] == [
        (FRAME, ""),
        (b"", "user mark 1: breaker opened"),
        (b"", "user mark 2"),
        (FRAME, ""),
        (b"", "user mark 3: in the middle"),
    ]
    times = [packet.time_ns for packet in packets]
    assert times == sorted(times)


def test_a_flood_of_marks_is_bounded(tmp_path: Path) -> None:
    with Bus() as bus:
        sniffer = Sniffer([Side(open_port(bus.port), tap("x"))], [open_writer(tmp_path / "x.pcapng")])
        for _ in range(1000):
            sniffer.mark()
        with running(sniffer):
            until(lambda: sniffer.tally.events)
    assert sniffer.tally.marks == 100


def test_a_clock_that_is_set_is_an_event(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    offset = [0]
    clock = WallClock(wall=lambda: time.time_ns() + offset[0])
    with Bus() as bus:
        sniffer = Sniffer([Side(open_port(bus.port), tap("x"))], [open_writer(path)], clock=clock)
        with running(sniffer):
            bus.send(FRAME)
            until(lambda: sniffer.tally.records == 1)
            offset[0] = -3600_000_000_000
            until(lambda: sniffer.tally.events)
            bus.send(FRAME)
            until(lambda: sniffer.tally.records == 2)
    first, event, second = read_capture(path)
    assert event.comment.startswith("clock step: the wall clock was set back by 3600.0")
    assert event.time_ns >= first.time_ns
    assert 3590 < (event.time_ns - second.time_ns) / 1e9 < 3600.02  # thirteen bytes at once: it began before
    assert sniffer.tally.clock_steps == 1


def test_verbose_says_how_sure_a_time_is(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as bus:
        sniffer = Sniffer([Side(open_port(bus.port), tap("x"))], [open_writer(path)], verbose=True)
        with running(sniffer):
            bus.send(FRAME)
            until(lambda: sniffer.tally.records == 1)
    (packet,) = read_capture(path)
    assert packet.comment.startswith("began within ")
    assert packet.comment.endswith(" ms of this time")


@pytest.mark.parametrize("pieces", [1, 13])
def test_a_silent_port_does_not_spin(pieces: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    woken: list[float | None] = []
    wait = Waiter.wait

    def counted_wait(self: Waiter, timeout: float | None) -> list[int]:
        woken.append(timeout)
        return wait(self, timeout)

    monkeypatch.setattr(Waiter, "wait", counted_wait)
    with Bus() as bus:
        sniffer = Sniffer([Side(open_port(bus.port), tap("x"))], [open_writer(tmp_path / "x.pcapng")])
        with running(sniffer):
            for at in range(0, 13, pieces):
                bus.send(FRAME[at : at + pieces])
                time.sleep(0.001)
            bus.send(FRAME[:1])  # a beginning, then nothing: it rests, looks, and gives up after silence
            until(lambda: sniffer.tally.records == 2)
            before = len(woken)
            time.sleep(0.3)
            assert len(woken) - before < 10
    assert len(woken) < 60
