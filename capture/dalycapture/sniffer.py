# SPDX-License-Identifier: GPL-2.0-or-later
"""The sniffer: listen to one port or several, cut what comes into records, write every record to every sink.

    port --read, time--> side --records--+
    port --read, time--> side --records--+--> order of time --> sinks (files and pipes), listener
    signals, user, clock ------events----+

It waits in one ``poll`` for the ports, for whoever calls ``stop``, ``mark`` or ``rotate`` (from a thread or a signal),
for ports that come back, for pipes whose reader catches up or goes away, and for what is due by time.

A file is evidence: when it can not be written, the capture ends with an error. A pipe is a view: when its reader goes
away, the capture goes on, unless nothing is left to write to. A port that goes away is waited for, where its side says
so. Each of these is an event in the file: a packet without bytes, with a comment.
"""

from __future__ import annotations

import contextlib
import functools
import signal
import socket
import time
from collections import deque
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NoReturn

from dalycapture.clock import WallClock
from dalycapture.errors import CaptureError, PortError
from dalycapture.framing import TimedRecord
from dalycapture.lateness import Lateness
from dalycapture.order import Event, Order
from dalycapture.output import PipeOutput
from dalycapture.side import ERROR_FLAGS, Side
from dalycapture.tally import End, Tally
from dalycapture.waiting import Waiter

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Sequence
    from types import FrameType

    from dalycapture.writer import CaptureWriter

__all__ = ["ERROR_FLAGS", "End", "Limits", "Side", "Sniffer", "Tally"]

TICK_NS: Final = 1_000_000_000
SHOW_NS: Final = 250_000_000
MOST_ASKED: Final = 100  # marks that may wait to be written; the rest of a flood is left out


@dataclass(frozen=True, slots=True)
class Limits:
    """When to stop by oneself; None: never. duration in seconds, filesize in bytes, packets are records."""

    duration: float | None = None
    packets: int | None = None
    filesize: int | None = None


class Sniffer:
    """One capture of one bus. ``run`` works until a limit, ``stop``, or the end of a port.

    sides: with open ports, closed here. sinks: open writers, closed here, each with its statistics. listener: called
    for each record after it was written, in the thread of ``run``. ticker: called in it too, four times a second.
    ``tally`` may be read from other threads. verbose: each record's time bound as a comment.
    """

    def __init__(
        self,
        sides: Sequence[Side],
        sinks: Sequence[CaptureWriter],
        *,
        limits: Limits | None = None,
        listener: Callable[[TimedRecord], None] | None = None,
        ticker: Callable[[Tally], None] | None = None,
        verbose: bool = False,
        clock: WallClock | None = None,
    ) -> None:
        self.tally = Tally(sides=[side.tally for side in sides])
        self._sides = list(sides)
        for number, side in enumerate(sides):
            side.number = number
        self._sinks = list(sinks)
        self._limits = limits or Limits()
        self._listener = listener
        self._ticker = ticker
        self._verbose = verbose
        self._clock = clock or WallClock()
        self._order = Order()
        self._asked: deque[tuple[int, str]] = deque()  # the user's marks
        self._rotation_asked = False
        self._stop_asked = False
        self._lateness: Lateness | None = None
        self._end: End | None = None
        self._gone: list[CaptureWriter] = []  # pipes whose reader went away
        self._started_ns = 0
        self._waker, self._wake = socket.socketpair()
        self._waker.setblocking(False)
        self._wake.setblocking(False)

    def stop(self) -> None:
        """End the capture soon, in order. Safe from any thread and from a signal handler; may be called again."""
        self._stop_asked = True
        self._wake_up()

    def mark(self, text: str = "") -> None:
        """Put a user's mark into the file, at the present moment. Safe as ``stop`` is."""
        if len(self._asked) < MOST_ASKED:
            self._asked.append((time.monotonic_ns(), text))
        self._wake_up()

    def rotate(self) -> None:
        """Go on in the next file, where the sinks have one. Safe as ``stop`` is."""
        self._rotation_asked = True
        self._wake_up()

    def _wake_up(self) -> None:
        with contextlib.suppress(OSError):  # full: it is awake already; closed: it has ended already
            self._wake.send(b"\x00")

    def run(self, *, stop_signals: Sequence[signal.Signals] = (), user_signals: bool = False) -> Tally:
        """Capture until the end; what was heard, and why it ended.

        stop_signals: these end the capture as ``stop`` does; user_signals: SIGUSR1 rotates, SIGUSR2 marks (main thread
        only, both). Raises CaptureError when a file could not be written: it says how many records are safe and how
        many are lost.
        """
        handlers: dict[str, Callable[[], None]] = {number.name: self.stop for number in stop_signals}
        if user_signals:
            handlers |= {"SIGUSR1": self.rotate, "SIGUSR2": self.mark, "SIGCONT": self._continued}
        with contextlib.ExitStack() as stack:
            stack.callback(self._close)
            stack.enter_context(self._called_by(handlers))
            self._lateness = Lateness()
            stack.callback(self._lateness.close)
            self._started_ns = time.monotonic_ns()
            for side in self._sides:
                self._to_all(functools.partial(_describe, side))
            self.tally.end = self._listen(self._lateness)
            now = time.monotonic_ns()
            for side in self._sides:
                self._count_line_errors(side, now)
                self._take(side.flush(now))
                self._tell_trouble(side, now + TICK_NS)
                side.end(now)
            self._write(self._order.rest())
            self.tally.seconds = (now - self._started_ns) / 1e9
            self._to_all(lambda sink: sink.finish())
        return self.tally

    def _continued(self) -> None:
        if self._lateness:
            self._lateness.stopped = True

    def _listen(self, lateness: Lateness) -> End:
        waiter = Waiter()
        waker = self._waker.fileno()
        waiter.watch(waker, read=True)
        now = self._started_ns
        until = None if self._limits.duration is None else now + round(self._limits.duration * 1e9)
        pipes = any(isinstance(sink.output, PipeOutput) for sink in self._sinks)
        period = SHOW_NS if self._ticker else TICK_NS
        tick_at, show_at = now + TICK_NS, now
        watched = [-1] * len(self._sides)
        while self._end is None:
            if pipes:
                self._watch_pipes(waiter)
                if self._end:  # the last reader went away: nothing would wake us
                    break
            if self._ticker and now >= show_at:
                show_at = now + period
                self._count_outputs()
                self._ticker(self.tally)
            waited_from = time.monotonic_ns()
            wake_at = min(tick_at, show_at) if self._ticker else tick_at
            wake_at = min(self._due_ns(wake_at), until or wake_at)
            due = min(sink.due for sink in self._sinks)  # the next file, statistics
            if due < wake_at / 1e9:
                wake_at = round(due * 1e9)
            for number, side in enumerate(self._sides):
                watched[number] = self._watch(waiter, side, watched[number], waited_from)
                if side.rest_until_ns > waited_from:
                    wake_at = min(wake_at, side.rest_until_ns)
            timeout_ns = max(0, wake_at - waited_from)
            ready = waiter.wait(timeout_ns / 1e9)
            now, late = lateness.woken(waited_from, timeout_ns)
            for side in self._sides:
                if side.fd in ready:
                    self._on_port(side, now, late)
                else:
                    if not side.rest_until_ns:
                        side.checked(waited_from)
                    silence_at = side.silence_at_ns()
                    if silence_at is not None and now >= silence_at:
                        self._take(side.flush(now))
            if waker in ready:
                self._on_wake(now)
            if now >= tick_at:
                tick_at = now + TICK_NS
                self._tick(now)
            if now >= due * 1e9:
                self._to_all(lambda sink: sink.tick())
                self._end = self._end or self._limit()
            if self._order:
                self._write(self._order.due([side.horizon_ns() for side in self._sides]))
            if self._clock.stepped and not self._order and all(side.quiet for side in self._sides):
                self._clock.adopt()
            self.tally.seconds = (now - self._started_ns) / 1e9
            if self._end is None and (self._stop_asked or (until is not None and now >= until)):
                self._end = End.STOPPED if self._stop_asked else End.DURATION
        return self._end

    def _watch(self, waiter: Waiter, side: Side, watched: int, now: int) -> int:
        """Have the side's port waited for; not for its bytes while nothing is gained by them. Its descriptor."""
        fd = side.fd
        if watched not in {fd, -1}:
            waiter.forget(watched)
        if fd >= 0:
            waiter.watch(fd, read=now >= side.rest_until_ns)
        return fd

    def _due_ns(self, wake_at: int) -> int:
        """When something is due by time: silence, a record that waits for its turn, the end of waiting for a port."""
        for side in self._sides:
            silence_at = side.silence_at_ns()
            if silence_at is not None:
                wake_at = min(wake_at, silence_at)
            wake_at = min(wake_at, side.give_up_ns())
        oldest = self._order.oldest_ns
        if oldest is not None:
            wake_at = min(wake_at, oldest + max(side.delay_ns for side in self._sides) + 1_000_000)
        return wake_at

    def _limit(self) -> End | None:
        """Tell which limit, if any, what was written has reached."""
        limits = self._limits
        if limits.packets is not None and self.tally.records >= limits.packets:
            return End.PACKETS
        for sink in self._sinks:
            if limits.filesize is not None and sink.output.size >= limits.filesize:
                return End.FILESIZE
            if sink.complete:
                return End.FILES
        return None

    def _on_port(self, side: Side, now: int, late: int) -> None:
        try:
            records = side.read(time.monotonic_ns, now, late)
        except PortError as error:
            self._on_loss(side, str(error), time.monotonic_ns())
            return
        self._take(records)
        self._tell_trouble(side, now)

    def _on_loss(self, side: Side, why: str, now: int) -> None:
        self._take(side.flush(now))
        self._event(side, now, f"port lost: {why.rpartition('; ')[0]}")  # without what to do about it
        side.lost(now, self._wake_up)
        if side.lost_for_ever:
            self.tally.problem = why
            self._end = self._end or End.PORT_LOST

    def _on_wake(self, now: int) -> None:
        with contextlib.suppress(BlockingIOError):
            while self._waker.recv(4096):
                pass
        first = self._sides[0]
        while self._asked:
            at, text = self._asked.popleft()
            self.tally.marks += 1
            self._event(first, at, f"user mark {self.tally.marks}{f': {text}' if text else ''}")
        for side in self._sides:
            if news := side.back(now):
                self._event(side, now, news)
        if self._rotation_asked:
            self._rotation_asked = False
            self._to_all(lambda sink: sink.rotate())

    def _tick(self, now: int) -> None:
        """Do what is due once a second."""
        for side in self._sides:
            self._count_line_errors(side, now)
            self._tell_trouble(side, now)
            if now >= side.give_up_ns():
                side.give_up()
                self.tally.problem = f"{side.interface.name} went away and did not come back"
                self._end = self._end or End.PORT_LOST
        if step := self._clock.step():
            self.tally.clock_steps += 1
            self._event(self._sides[0], now, str(step))

    def _count_line_errors(self, side: Side, now: int) -> None:
        lost = side.tally.lost
        side.count_line_errors(now)
        if lost := side.tally.lost - lost:
            self._to_all(lambda sink: sink.count_dropped(side.number, lost))

    def _tell_trouble(self, side: Side, now: int) -> None:
        if trouble := side.trouble(now):
            self._event(side, *trouble)

    def _event(self, side: Side, time_ns: int, text: str) -> None:
        self._take(side.event())
        self._order.put(Event(time_ns, text, side.number))

    def _take(self, records: list[TimedRecord]) -> None:
        """Put records into the order of time; with one side, and nothing before them, they are in it."""
        if not records:
            return
        if len(self._sides) == 1 and not self._order:
            self._write(records)
        else:
            for record in records:
                self._order.put(record)

    def _write(self, items: Iterable[TimedRecord | Event]) -> None:
        """Write records and events to all sinks, up to a limit: what comes behind it is not part of the capture."""
        todo = list(items)
        offset_ns = self._clock.offset_ns
        for done, item in enumerate(todo, 1):
            if isinstance(item, Event):
                self._write_event(item)
                continue
            if self._limit():
                break
            time_ns = item.time_ns + offset_ns
            side = self._sides[item.side]
            flags, dropped = side.flags_and_losses(item)
            comment = _bound(item) if self._verbose else ""
            try:
                self._put(item, time_ns, flags, dropped, comment)
            except CaptureError:
                self._give_up(sum(isinstance(one, TimedRecord) for one in todo[done:]))
            side.tally.add(item)
            if self._listener:
                self._listener(replace(item, time_ns=time_ns))
        self._end = self._end or self._limit()

    def _put(self, timed: TimedRecord, time_ns: int, flags: int, dropped: int, comment: str) -> None:
        """Write a record to all sinks, with the time of day."""
        data, side = timed.record.data, timed.side
        gone: list[tuple[CaptureWriter, str]] = []
        for sink in self._sinks:
            try:
                sink.write_packet(time_ns, data, interface=side, flags=flags, comment=comment, dropped=dropped)
            except CaptureError as error:
                if not isinstance(sink.failure, BrokenPipeError):
                    raise
                gone.append((sink, str(error)))
        for sink, note in gone:
            self._let_go(sink, note)

    def _write_event(self, event: Event) -> None:
        self.tally.events += 1
        time_ns = self._clock.time_ns(event.time_ns)
        self._to_all(lambda sink: sink.write_packet(time_ns, b"", interface=event.side, comment=event.text))

    def _count_outputs(self) -> None:
        self.tally.written = self._sinks[0].output.size if self._sinks else 0
        self.tally.unwritten = sum(sink.lost for sink in self._sinks)

    def _give_up(self, unwritten: int) -> NoReturn:
        """Count all that was heard and is in no file, as a file broke, and say so."""
        now = time.monotonic_ns()
        unwritten += sum(isinstance(item, TimedRecord) for item in self._order.rest())
        unwritten += sum(len(side.flush(now)) for side in self._sides)
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
                if (fd := sink.output.fileno()) >= 0:
                    waiter.watch(fd, write=sink.output.waiting > 0)
        for sink in self._gone:
            if isinstance(sink.output, PipeOutput):
                waiter.forget(sink.output.fileno())

    @contextlib.contextmanager
    def _called_by(self, handlers: dict[str, Callable[[], None]]) -> Generator[None]:
        calls = {getattr(signal, name): call for name, call in handlers.items() if hasattr(signal, name)}
        if not calls:
            yield
            return

        def handler(number: int, _frame: FrameType | None) -> None:
            calls[number]()

        before = {number: signal.signal(number, handler) for number in calls}
        # A signal that comes just before poll sleeps would be seen too late by its handler; this wakes poll.
        wakeup = signal.set_wakeup_fd(self._wake.fileno(), warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(wakeup)
            for number, previous in before.items():
                signal.signal(number, previous)

    def _close(self) -> None:
        self._count_outputs()
        for side in self._sides:
            side.close()
        for sink in (*self._sinks, *self._gone):
            sink.close()
        self._waker.close()
        self._wake.close()


def _describe(side: Side, sink: CaptureWriter) -> None:
    sink.add_interface(side.interface)


def _bound(timed: TimedRecord) -> str:
    """Say how sure the time of a record is: ``began within 0.41 ms of this time``."""
    doubt = "" if timed.consistent else "; the reads contradict each other: a pause of the sender, or a slow adapter"
    return f"began within {timed.bound_ns / 1e6:.2f} ms of this time{doubt}"
