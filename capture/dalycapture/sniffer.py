# SPDX-License-Identifier: GPL-2.0-or-later
"""The sniffer: listen to one port, cut what comes into records, write every record to every sink.

    port --read, time--> framer --records--> sinks (files and pipes), listener

It waits in one ``poll`` for the port, for whoever calls ``stop`` (from a thread or a signal), for pipes whose reader
catches up or goes away, and, while an incomplete record is held, for the end of 250 ms of quiet.

A file is evidence: when it can not be written, the capture ends with an error. A pipe is a view: when its reader goes
away, the capture goes on, unless nothing is left to write to.
"""

from __future__ import annotations

import contextlib
import functools
import math
import signal
import socket
import time
from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Final, NoReturn

from dalycapture.errors import CaptureError, PortError
from dalycapture.framing import SILENCE_NS, Framer, TimedRecord
from dalycapture.output import PipeOutput
from dalycapture.pcapng import CRC_ERROR, TOO_SHORT
from dalycapture.waiting import Waiter
from dalyref.kinds import Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence
    from types import FrameType

    from dalycapture.interface import Interface
    from dalycapture.port import Port
    from dalycapture.writer import CaptureWriter

ERROR_FLAGS: Final = {Kind.BAD_CHECKSUM: CRC_ERROR, Kind.SHORT: TOO_SHORT}

SILENCE_S: Final = SILENCE_NS / 1e9


class End(StrEnum):
    """Why a capture ended."""

    STOPPED = "stopped"
    DURATION = "duration reached"
    PACKETS = "number of packets reached"
    FILESIZE = "file size reached"
    FILES = "number of files reached"
    PORT_LOST = "port lost"
    READER_GONE = "reader of the pipe went away"


@dataclass(frozen=True, slots=True)
class Limits:
    """When to stop by oneself; None: never. duration in seconds, filesize in bytes, packets are records."""

    duration: float | None = None
    packets: int | None = None
    filesize: int | None = None


@dataclass(slots=True)
class Tally:
    """What a capture has heard so far."""

    records: int = 0
    bytes: int = 0
    kinds: Counter[Kind] = field(default_factory=Counter[Kind])
    seconds: float = 0.0
    end: End = End.STOPPED
    problem: str = ""  # one line, when the port was lost
    notes: list[str] = field(default_factory=list[str])  # pipes that broke or fell behind

    @property
    def good(self) -> int:
        """Frames with right checksum."""
        return self.kinds[Kind.FRAME]

    @property
    def bad(self) -> int:
        """Records that are damaged Daly frames, whole or cut off."""
        return self.kinds[Kind.BAD_CHECKSUM] + self.kinds[Kind.SHORT]


class Sniffer:
    """One capture of one port. ``run`` works until a limit, ``stop``, or the end of the port.

    port: open, closed by the caller. sinks: open writers, closed here, each with its statistics. listener: called for
    each record after it was written, in the thread of ``run``. ``tally`` may be read from other threads.
    """

    def __init__(
        self,
        port: Port,
        interface: Interface,
        sinks: Sequence[CaptureWriter],
        *,
        limits: Limits | None = None,
        listener: Callable[[TimedRecord], None] | None = None,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self.tally = Tally()
        self._port = port
        self._interface = interface
        self._sinks = list(sinks)
        self._limits = limits or Limits()
        self._listener = listener
        self._clock = clock
        self._framer = Framer(interface.speed or 9600)
        self._stop_asked = False
        self._end: End | None = None
        self._gone: list[CaptureWriter] = []  # pipes whose reader went away
        self._waker, self._wake = socket.socketpair()
        self._waker.setblocking(False)
        self._wake.setblocking(False)

    def stop(self) -> None:
        """End the capture soon, in order. Safe from any thread and from a signal handler; may be called again."""
        self._stop_asked = True
        with contextlib.suppress(OSError):  # full: it is awake already; closed: it has ended already
            self._wake.send(b"\x00")

    def run(self, *, stop_signals: Sequence[signal.Signals] = ()) -> Tally:
        """Capture until the end; what was heard, and why it ended.

        stop_signals: these end the capture as ``stop`` does (main thread only). Raises CaptureError when a file could
        not be written: it says how many records are safe and how many are lost.
        """
        with contextlib.ExitStack() as stack:
            stack.callback(self._close)
            stack.enter_context(self._stopped_by(stop_signals))
            started = time.monotonic()
            self._to_all(lambda sink: sink.add_interface(self._interface))
            self.tally.end = self._listen(started)
            self._write(self._framer.flush())
            self.tally.seconds = time.monotonic() - started
            self._to_all(lambda sink: sink.finish())
        return self.tally

    def _listen(self, started: float) -> End:
        port, waker = self._port.fileno(), self._waker.fileno()
        waiter = Waiter()
        waiter.watch(port, read=True)
        waiter.watch(waker, read=True)
        until = math.inf if self._limits.duration is None else started + self._limits.duration
        pipes = any(isinstance(sink.output, PipeOutput) for sink in self._sinks)
        now = heard = started
        while self._end is None:
            if pipes:
                self._watch_pipes(waiter)
                if self._end:  # the last reader went away: nothing would wake us
                    break
            due = min(sink.due for sink in self._sinks)
            wake_at = min(until, due, heard + SILENCE_S) if self._framer.pending else min(until, due)
            ready = waiter.wait(None if wake_at == math.inf else wake_at - now)
            now = time.monotonic()
            if port in ready:
                self._on_port()
                heard = now
            elif self._framer.pending and now - heard >= SILENCE_S:
                self._write(self._framer.flush())
            self.tally.seconds = now - started
            if now >= due:
                self._to_all(lambda sink: sink.tick())
                self._end = self._end or self._limit()
            if self._end is None and (self._stop_asked or now >= until):
                self._end = End.STOPPED if self._stop_asked else End.DURATION
        return self._end

    def _limit(self) -> End | None:
        """Tell which limit, if any, what was written has reached."""
        limits = self._limits
        if limits.packets is not None and self.tally.records >= limits.packets:
            return End.PACKETS
        if limits.filesize is not None and any(sink.output.size >= limits.filesize for sink in self._sinks):
            return End.FILESIZE
        if any(sink.complete for sink in self._sinks):
            return End.FILES
        return None

    def _on_port(self) -> None:
        try:
            data = self._port.read()
        except PortError as error:
            self._write(self._framer.flush())
            self.tally.problem = str(error)
            self._end = self._end or End.PORT_LOST
            now_ns = self._clock()
            comment = f"port lost: {error}"
            self._to_all(lambda sink: sink.write_packet(now_ns, b"", comment=comment))
            return
        if data:
            now_ns = self._clock()
            self.tally.bytes += len(data)
            if records := self._framer.feed(data, now_ns):
                self._write(records)

    def _write(self, records: list[TimedRecord]) -> None:
        """Write records to all sinks, up to a limit: what comes behind it is not part of the capture."""
        for index, timed in enumerate(records):
            if self._limit():
                break
            try:
                self._to_all(functools.partial(_put, timed))
            except CaptureError:
                self._give_up(len(records) - index - 1)
            self.tally.records += 1
            self.tally.kinds[timed.record.kind] += 1
            if self._listener:
                self._listener(timed)
        self._end = self._end or self._limit()

    def _give_up(self, unwritten: int) -> NoReturn:
        """Count all that was heard and is in no file, as a file broke, and say so."""
        unwritten += len(self._framer.flush())
        broken = next(sink for sink in self._sinks if sink.failure)
        broken.lost += unwritten
        raise broken.broken() from broken.failure

    def _to_all(self, write: Callable[[CaptureWriter], object]) -> None:
        for sink in tuple(self._sinks):
            self._to(sink, write)

    def _to(self, sink: CaptureWriter, write: Callable[[CaptureWriter], object]) -> None:
        """Write to one sink. A pipe whose reader went away is let go; any other failure is raised."""
        try:
            write(sink)
        except CaptureError as error:
            if not isinstance(sink.failure, BrokenPipeError):
                raise
            self._let_go(sink, str(error))

    def _let_go(self, sink: CaptureWriter, note: str) -> None:
        self._sinks.remove(sink)
        self._gone.append(sink)
        self.tally.notes.append(note)
        if not self._sinks:
            self._end = self._end or End.READER_GONE

    def _watch_pipes(self, waiter: Waiter) -> None:
        """Hand on what waits for slow readers, and be woken when they take more or go away."""
        for sink in tuple(self._sinks):
            if isinstance(sink.output, PipeOutput):
                self._to(sink, lambda sink: sink.hand_on())
                waiter.watch(sink.output.fileno(), write=sink.output.waiting > 0)
        for sink in self._gone:
            if isinstance(sink.output, PipeOutput):
                waiter.forget(sink.output.fileno())

    @contextlib.contextmanager
    def _stopped_by(self, signals: Sequence[signal.Signals]) -> Generator[None]:
        if not signals:
            yield
            return

        def handler(_number: int, _frame: FrameType | None) -> None:
            self.stop()

        before = {number: signal.signal(number, handler) for number in signals}
        # A signal that comes just before poll sleeps would be seen too late by its handler; this wakes poll.
        wakeup = signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(wakeup)
            for number, previous in before.items():
                signal.signal(number, previous)

    def _close(self) -> None:
        for sink in (*self._sinks, *self._gone):
            sink.close()
        self._waker.close()
        self._wake.close()


def _put(timed: TimedRecord, sink: CaptureWriter) -> None:
    sink.write_packet(timed.time_ns, timed.record.data, flags=ERROR_FLAGS.get(timed.record.kind, 0))
