# SPDX-License-Identifier: GPL-2.0-or-later
"""The simulated bus in real time, on two pseudo-terminals, paced at the baud rate.

    client program  <-->  client  --+                  +-->  tap  -->  sniffers: all that is on the pair
                                    +--- the pair -----+
    polling host    ----------------+                  +---  boards 1..16, or a capture played back

The tap is for listening: what is written to it goes nowhere, and nothing its reader does or fails to do disturbs the
bus. A client gets the boards' answers to its own requests; the host waits while a client is at it.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
from typing import TYPE_CHECKING, Self

from dalycapture.errors import CaptureError
from dalytools.problem import Problem
from dalytools.simulator.board import may_become_request, request_length
from dalytools.simulator.bus import BITS_A_BYTE, CLIENT, HOST, Bus
from dalytools.simulator.modbus import MAX_REQUEST
from dalytools.simulator.replay import open_replay
from dalytools.simulator.scenario import Scenario
from dalytools.simulator.sent import Sent
from dalytools.simulator.terminal import Terminal

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from types import TracebackType

    from dalytools.simulator.truth import Truth

_GROUP_S = 0.004  # bytes are handed over in groups of about this length, as adapters do
_HALF_FRAME_NS = 30_000_000  # how long the rest of a client's frame may take to come
_CLIENT_FIRST_NS = 150_000_000  # the host leaves the bus to a client for so long after an answer
_MOST_AT_ONCE = 256  # bytes of a client's that is no frame; a stop or the host need not wait for more
_BEHIND_NS = 1_000_000_000  # further behind than this (machine asleep, stopped): forget it, do not catch up


class SimulatedBus:
    """A scenario on pseudo-terminals. Use it as a context manager (runs in a thread), or call ``run`` yourself.

    ``tap`` and ``client`` are the paths to open. With ``replay`` the capture is played first; then the boards take
    over, unless ``then_simulate`` is False: then the bus falls silent and is ``done``.
    Raises Problem when the capture or the pseudo-terminals cannot be had.
    """

    def __init__(
        self,
        scenario: Scenario | None = None,
        *,
        replay: Path | None = None,
        then_simulate: bool = True,
        speed: float = 1.0,
        longest_silence_s: float = 2.0,
        link: Path | None = None,
        truth: Truth | None = None,
    ) -> None:
        self.scenario = scenario or Scenario()
        self.bus = Bus(self.scenario, truth=truth)
        self.ended_ns = 0  # of bus time
        self.problem = ""  # one line, when the capture broke off
        baud = self.scenario.baud
        self._char_ns = BITS_A_BYTE * 1_000_000_000 / baud
        self._played: Iterator[Sent] | None = None
        if replay is not None:
            self._played = open_replay(replay, baud=baud, speed=speed, longest_silence_s=longest_silence_s)
        self._speed = speed
        self._then_simulate = then_simulate or replay is None
        self._tap = Terminal(None if link is None else link / "tap")
        try:
            self._client = Terminal(None if link is None else link / "client")
        except Problem:
            self._tap.close()
            raise
        self._waker, self._wake = os.pipe()
        os.set_blocking(self._wake, False)
        self._stopping = False
        self._done = threading.Event()
        self._thread: threading.Thread | None = None
        self._inbox = b""  # what a client wrote and is not on the wire yet
        self._inbox_ns = 0  # when its newest byte came
        self._client_until_ns = 0
        self._zero_ns = 0  # of the bus's time, on the monotonic clock

    @property
    def tap(self) -> str:
        """Path of the tap: every byte on the wire, for listening."""
        return self._tap.path

    @property
    def client(self) -> str:
        """Path of the port for a client program, which asks the boards itself."""
        return self._client.path

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self.run, name="simulated bus", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        if self._thread is not None:
            self._thread.join()
        self.close()

    def stop(self) -> None:
        """End ``run`` soon. May be called from a signal handler or another thread, and more than once."""
        self._stopping = True
        with contextlib.suppress(OSError):  # full: it is awake already; closed: it has ended
            os.write(self._wake, b"!")

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until ``run`` has ended by itself (a replay without boards to follow); whether it has."""
        return self._done.wait(timeout_s)

    def linger(self, seconds: float) -> None:
        """Give a reader of the tap time to fetch the last bytes before ``close`` hangs up; not when stopped."""
        if self._tap.listened():
            select.select([self._waker], [], [], seconds)

    def close(self) -> None:
        """Hang up both ports and remove their links. Only after ``run`` has ended."""
        self._tap.close()
        self._client.close()
        for fd in (self._waker, self._wake):
            os.close(fd)

    def run(self, duration_s: float | None = None) -> None:
        """Run the bus in this thread until it is stopped, its time is over, or the replay has ended."""
        self._zero_ns = time.monotonic_ns()
        end_ns = None if duration_s is None else int(duration_s * 1e9)
        try:
            if self._played is not None:
                self._play(self._played, end_ns)
            if self._then_simulate:
                self._simulate(end_ns)
        finally:
            self.ended_ns = self._now()
            self._done.set()

    def _now(self) -> int:
        return time.monotonic_ns() - self._zero_ns

    def _over(self, end_ns: int | None) -> bool:
        return self._stopping or (end_ns is not None and self._now() >= end_ns)

    def _play(self, played: Iterator[Sent], end_ns: int | None) -> None:
        """Put the capture on the wire. No board listens to clients; what they write is on the wire all the same."""
        late_ns = 0  # what clients wrote in between pushes the rest back
        char_ns = self._char_ns / self._speed
        while not self._over(end_ns):
            try:
                item = next(played, None)
            except CaptureError as error:
                self.problem = str(error)
                return
            if item is None:
                return
            while (due := item.time_ns + late_ns) > self._now() and not self._over(end_ns):
                self._wait(due if end_ns is None else min(due, end_ns), for_client=True)
                if said := self._from_client():
                    late_ns += max(0, self._put([Sent(self._now(), CLIENT, said)], self._char_ns) - due)
            self._put([Sent(due, item.sender, item.data)], char_ns)

    def _simulate(self, end_ns: int | None) -> None:
        bus = self.bus
        bus.now_ns = max(bus.now_ns, self._now())
        while not self._over(end_ns):
            now = self._now()
            if said := self._from_client():
                self._put(self._asked(said, now), self._char_ns)
                self._client_until_ns = self._now() + _CLIENT_FIRST_NS
                continue
            due = None
            if bus.speaks:
                due = max(bus.now_ns, self._client_until_ns)
                if due <= now and not self._inbox:
                    bus.now_ns = max(due, now - _BEHIND_NS)
                    self._put(bus.poll(), self._char_ns)
                    continue
            if self._inbox:
                due = self._inbox_ns + _HALF_FRAME_NS
            self._wait(
                min((time_ns for time_ns in (due, end_ns) if time_ns is not None), default=None), for_client=True
            )

    def _asked(self, said: bytes, now: int) -> list[Sent]:
        """Send a client's bytes at once: the host's next request, not begun yet, waits."""
        bus = self.bus
        planned = bus.now_ns
        bus.now_ns = now
        sent = bus.ask(said, now)
        bus.now_ns = max(planned, bus.now_ns)
        return sent

    def _from_client(self) -> bytes:
        """Take the next bytes of a client that may go on the wire: a whole request, or what will not become one."""
        inbox = self._inbox
        waiting = self._now() - self._inbox_ns < _HALF_FRAME_NS
        size = len(inbox)
        for start in range(len(inbox)):
            if length := request_length(inbox[start : start + MAX_REQUEST]):
                size = start or length  # what stands before it goes first, by itself
                break
            if waiting and size == len(inbox) and may_become_request(inbox[start : start + MAX_REQUEST]):
                size = start
        size = min(size, _MOST_AT_ONCE)
        self._inbox = inbox[size:]
        return inbox[:size]

    def _put(self, items: list[Sent], char_ns: float) -> int:
        """Put bytes on the wire, each group when its last byte has ended; the time when the wire is free again."""
        group = max(1, int(_GROUP_S * 1e9 / char_ns))
        asked = items[0].sender == CLIENT
        end = items[0].time_ns
        for item in items:
            if self._now() - item.time_ns > _BEHIND_NS:
                self._zero_ns += self._now() - item.time_ns
            for start in range(0, len(item.data), group):
                part = item.data[start : start + group]
                end = item.time_ns + int((start + len(part)) * char_ns)
                self._wait(end)
                if self._stopping:
                    return end
                self._tap.send(part)
                if asked and item.sender not in {CLIENT, HOST}:
                    self._client.send(part)
        return end

    def _wait(self, until_ns: int | None, *, for_client: bool = False) -> None:
        """Wait until then (None: until something happens); collect what clients write; ``for_client``: return then."""
        while not self._stopping:
            left = None if until_ns is None else (until_ns - self._now()) / 1e9
            if left is not None and left <= 0:
                left = 0.0
            # A pseudo-terminal that nobody has open is always "ready": it is looked at now and then instead.
            fds = [self._waker]
            fds += [port.fd for port in (self._tap, self._client) if port.listened()]
            if len(fds) < 3:
                left = 0.02 if left is None else min(left, 0.02)
            ready, _, _ = select.select(fds, [], [], left)
            if self._tap.fd in ready:
                self._tap.received()
            if said := self._client.received():  # also what somebody wrote who has left again
                self._inbox = (self._inbox + said)[-65536:]
                self._inbox_ns = self._now()
                if for_client:
                    return
            if until_ns is not None and self._now() >= until_ns:
                return
