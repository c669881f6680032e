# SPDX-License-Identifier: GPL-2.0-or-later
"""The sniffer on a pty: what was on the bus is in the file, byte for byte, whatever happens around it."""

from __future__ import annotations

import os
import random
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus, numbered, real_uart_frames

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import tap, tap_of
from dalycapture.opening import open_port
from dalycapture.output import PipeOutput
from dalycapture.pcapng import PcapngWriter
from dalycapture.reader import read_capture
from dalycapture.settings import Settings
from dalycapture.sniffer import End, Limits, Side, Sniffer, Tally
from dalycapture.waiting import Waiter
from dalyref.kinds import Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator
    from pathlib import Path

    from dalycapture.framing import TimedRecord
    from dalycapture.port import Port
    from dalycapture.writer import CaptureWriter
    from dalyref.packet import Packet

FRAME = bytes.fromhex("a501900800f80000753001815d")  # cpy-90 of the real frames


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


@pytest.fixture
def port(bus: Bus) -> Iterator[Port]:
    one = open_port(bus.port)
    yield one
    one.close()


def until(condition: Callable[[], object]) -> None:
    """Wait for something that must come; 20 s is for a machine that is busy with other things."""
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.005)


def so_far(path: Path) -> list[Packet]:
    """What a file holds while it is being written; it is empty until the sniffer has begun."""
    return list(read_capture(path)) if path.stat().st_size else []


class Running:
    """A sniffer in a thread."""

    def __init__(self, sniffer: Sniffer) -> None:
        self.sniffer = sniffer
        self.error: CaptureError | None = None
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        try:
            self.sniffer.run()
        except CaptureError as error:
            self.error = error

    def join(self) -> Tally:
        self.thread.join(20)
        assert not self.thread.is_alive()
        return self.sniffer.tally


@contextmanager
def sniffing(
    port: Port,
    *sinks: CaptureWriter,
    limits: Limits | None = None,
    listener: Callable[[TimedRecord], None] | None = None,
) -> Generator[Running]:
    running = Running(Sniffer([Side(port, tap_of(port, Settings()))], sinks, limits=limits, listener=listener))
    try:
        yield running
    finally:
        running.sniffer.stop()
        running.join()


def test_what_was_sent_is_in_the_file(bus: Bus, port: Port, tmp_path: Path) -> None:
    """Frames of real devices, a broken one, junk and a beginning, fed in uneven pieces."""
    path = tmp_path / "x.pcapng"
    bad = FRAME[:-1] + b"\x00"
    parts = [*real_uart_frames()[:40], bad, FRAME, b"\xff\xff", FRAME, *[numbered(n) for n in range(60)], FRAME[:7]]
    stream = b"".join(parts)
    chance = random.Random(485)
    heard: list[TimedRecord] = []
    with sniffing(port, open_writer(path), listener=heard.append) as running:
        at = 0
        while at < len(stream):
            size = chance.randint(1, 40)
            bus.send(stream[at : at + size])
            at += size
            time.sleep(chance.choice([0, 0, 0.001, 0.004]))
        until(lambda: sum(len(one.record.data) for one in heard) == len(stream))  # silence closes the last
    packets = list(read_capture(path))
    assert b"".join(p.data for p in packets) == stream
    assert [p.data for p in packets] == parts
    assert [p.time_ns for p in packets] == sorted(p.time_ns for p in packets)
    assert [(p.time_ns, p.data) for p in packets] == [(one.time_ns, one.record.data) for one in heard]
    tally = running.sniffer.tally
    assert (tally.records, tally.bytes, tally.end) == (len(parts), len(stream), End.STOPPED)
    assert (tally.good, tally.bad, tally.kinds[Kind.JUNK]) == (len(parts) - 3, 2, 1)
    assert packets[0].description.startswith(f"dalyshark bus=main 9600 8N1 {bus.port}; ")
    assert bus.heard() == b""


def test_a_silent_bus_holds_nothing_back(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with sniffing(port, open_writer(path)):
        bus.send(FRAME[:9])
        until(lambda: len(so_far(path)) == 1)  # no further byte comes
        (one,) = read_capture(path)
        assert one.data == FRAME[:9]


def test_times_are_those_of_the_wall_clock(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    before = time.time_ns()
    with sniffing(port, open_writer(path)):
        bus.send(FRAME)
        until(lambda: so_far(path))
    (one,) = read_capture(path)
    assert before - 13_541_667 <= one.time_ns <= time.time_ns()


def test_stop_after_packets_is_exact(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    bus.send(FRAME * 10)
    with sniffing(port, open_writer(path), limits=Limits(packets=7)) as running:
        assert running.join().end is End.PACKETS
    assert len(list(read_capture(path))) == 7


def test_stop_after_filesize(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    bus.send(FRAME * 100)
    with sniffing(port, open_writer(path), limits=Limits(filesize=2000)) as running:
        assert running.join().end is End.FILESIZE
    # The packet that reached it is the last; 48 bytes each. Behind it only the statistics: 24 + 12 + 12 + 12 + 12 + 4.
    assert 2000 <= path.stat().st_size - 76 < 2048


def test_stop_after_duration_on_a_silent_bus(port: Port, tmp_path: Path) -> None:
    with sniffing(port, open_writer(tmp_path / "x.pcapng"), limits=Limits(duration=0.1)) as running:
        assert running.join().end is End.DURATION


def test_stop_before_and_after(port: Port, tmp_path: Path) -> None:
    sniffer = Sniffer([Side(port, tap("x"))], [open_writer(tmp_path / "x.pcapng")])
    sniffer.stop()
    assert sniffer.run().end is End.STOPPED
    sniffer.stop()


def test_an_unplugged_adapter_is_in_the_file(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with sniffing(port, open_writer(path)) as running:
        bus.send(FRAME + FRAME[:5])
        until(lambda: running.sniffer.tally.bytes == 18)
        bus.unplug()
        tally = running.join()
    assert tally.end is End.PORT_LOST
    assert f"{bus.port} went away" in tally.problem
    whole, short, event = read_capture(path)
    assert (whole.data, short.data, event.data) == (FRAME, FRAME[:5], b"")
    assert event.comment.startswith("port lost: ")
    assert event.time_ns >= short.time_ns


def test_bytes_before_the_unplugging_are_kept(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    bus.send(FRAME * 3)
    bus.unplug()
    with sniffing(port, open_writer(path)) as running:
        assert running.join().end is End.PORT_LOST
    got = [p.data for p in read_capture(path)]
    assert got[-1] == b""
    assert set(got[:-1]) <= {FRAME}


def pipe_sink() -> tuple[int, CaptureWriter]:
    reading, writing = os.pipe()
    return reading, PcapngWriter(PipeOutput(writing, "pipe"))


@pytest.mark.parametrize("silent", [False, True])
def test_a_reader_that_goes_away_does_not_end_the_evidence(
    silent: bool,
    bus: Bus,
    port: Port,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    woken: list[None] = []
    wait = Waiter.wait

    def counted_wait(self: Waiter, timeout: float | None) -> list[int]:
        woken.append(None)
        return wait(self, timeout)

    monkeypatch.setattr(Waiter, "wait", counted_wait)
    path = tmp_path / "x.pcapng"
    reading, view = pipe_sink()
    with sniffing(port, view, open_writer(path)) as running:
        bus.send(FRAME)
        until(lambda: running.sniffer.tally.records == 1)
        os.close(reading)
        if silent:
            until(lambda: running.sniffer.tally.notes)  # noticed though nothing is written
        bus.send(FRAME)
        until(lambda: running.sniffer.tally.records == 2)
        before = len(woken)
        time.sleep(0.1)
        assert len(woken) - before < 20  # and it does not spin on the dead pipe
    assert len(list(read_capture(path))) == 2
    assert running.sniffer.tally.end is End.STOPPED
    assert "its reader went away" in running.sniffer.tally.notes[0]


@pytest.mark.parametrize("heard", [0, 1])
def test_the_last_reader_that_goes_away_ends_it(heard: int, bus: Bus, port: Port) -> None:
    reading, view = pipe_sink()
    with sniffing(port, view) as running:
        assert os.read(reading, 4) == b"\x0a\x0d\x0d\x0a"
        bus.send(FRAME * heard)
        until(lambda: running.sniffer.tally.seconds > 0 or not heard)
        time.sleep(0.05)  # it sleeps on a silent bus now
        os.close(reading)
        assert running.join().end is End.READER_GONE


def test_a_reader_that_was_never_there_ends_it(port: Port) -> None:
    reading, view = pipe_sink()
    os.close(reading)
    with sniffing(port, view) as running:
        assert running.join().end is End.READER_GONE


def test_a_stalled_reader_does_not_stall_the_evidence(bus: Bus, port: Port, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    reading, view = pipe_sink()
    frames = [numbered(n) for n in range(3000)]  # 144 kB of blocks; a pipe holds 64
    with sniffing(port, view, open_writer(path)) as running:
        for frame in frames:
            bus.send(frame)
        until(lambda: running.sniffer.tally.records == 3000)
        assert [p.data for p in read_capture(path)] == frames
        got = b""
        running.sniffer.stop()
        while piece := os.read(reading, 1 << 16):
            got += piece
    os.close(reading)
    (tmp_path / "view").write_bytes(got)
    assert [p.data for p in read_capture(tmp_path / "view")] == frames


class Small:
    """An output with place for so many bytes."""

    name = "small.pcapng"

    def __init__(self, room: int) -> None:
        self.room = room
        self.size = 0

    def write(self, block: bytes) -> bool:
        if self.size + len(block) > self.room:
            raise OSError(28, "No space left on device")
        self.size += len(block)
        return True

    def pump(self) -> None: ...

    def close(self) -> None: ...


def test_a_full_disk_ends_it_and_all_is_counted(bus: Bus, port: Port) -> None:
    small = Small(10_000)
    writer = PcapngWriter(small)
    writer.add_interface(tap("x"))
    small.room = small.size + 200 + 3 * 48  # the description that run() writes, and three packets
    bus.send(FRAME * 8 + FRAME[:4])
    sniffer = Sniffer([Side(port, tap("x"))], [writer])
    with pytest.raises(CaptureError) as caught:
        sniffer.run()
    assert 0 < writer.written < 8
    lost = 9 - writer.written
    assert f"no space left on device; {writer.written} record" in str(caught.value)
    assert f" {lost} lost" in str(caught.value)


def test_a_listener_error_leaves_a_whole_file(bus: Bus, port: Port, tmp_path: Path) -> None:
    def fail(_: TimedRecord) -> None:
        raise ZeroDivisionError

    path = tmp_path / "x.pcapng"
    bus.send(FRAME)
    with pytest.raises(ZeroDivisionError):
        Sniffer([Side(port, tap("x"))], [open_writer(path)], listener=fail).run()
    assert [p.data for p in read_capture(path)] == [FRAME]
