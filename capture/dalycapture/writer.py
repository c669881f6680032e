# SPDX-License-Identifier: GPL-2.0-or-later
"""What the writers of pcapng and of classic pcap have in common: packets counted, and none lost in silence.

    add_interface    header, descriptions        (again at the beginning of each further file)
    write_packet     packets                     a full disk: the block is cut off again, and
                                                   stop: CaptureError, with the counts
                                                   wait: counted; when there is space, an event that says so, then on
    finish           statistics of each interface

Statistics come also each minute, and at the end of each file.
"""

from __future__ import annotations

import errno
import math
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final, Self

from dalycapture.errors import CaptureError, reason
from dalycapture.rotation import FileSeries

if TYPE_CHECKING:
    from types import TracebackType

    from dalycapture.interface import Interface
    from dalycapture.output import Output
    from dalycapture.torn import Whole

STATISTICS_S: Final = 60.0
FULL: Final = frozenset((errno.ENOSPC, errno.EDQUOT))
MISSED_LIMIT: Final = 20  # texts of events kept in memory while the disk is full


@dataclass(slots=True)
class _Side:
    """An interface, and what came of it into the current file."""

    interface: Interface
    since_ns: int
    received: int = 0
    lost: int = 0
    os_dropped: int = 0
    dropped: int = 0  # since the last packet that went out


@dataclass(slots=True)
class _Full:
    """The disk is full, since when, and what was lost meanwhile."""

    since_ns: int
    records: int = 0
    bytes: int = 0
    missed: list[str] = field(default_factory=list[str])  # events
    events: int = 0


class CaptureWriter(ABC):
    """Writes one capture. Every packet reaches the output before ``write_packet`` returns.

    ``written`` and ``lost`` count packets with bytes in them (records); events are not counted. ``failure`` is what
    broke the output, ``notes`` what else went wrong, a line each. ``complete`` turns true when the last file that was
    asked for has had its share.
    """

    def __init__(self, output: Output, *, wait_when_full: bool = False) -> None:
        self.output = output
        self.written = 0
        self.lost = 0
        self.failure: OSError | None = None
        self.notes: list[str] = []
        self.complete = False
        self.origin = ""  # of the section: what it goes on from
        self._wait_when_full = wait_when_full
        self._sides: list[_Side] = []
        self._owed: list[bytes] = []  # introductions that are not in the file yet
        self._full: _Full | None = None
        self._in_file = 0  # packets in the current file
        self._series = output if isinstance(output, FileSeries) else None
        self._statistics_at = math.inf

    @abstractmethod
    def _introduction(self, interface: Interface, *, first: bool) -> list[bytes]:
        """Lay out what must stand before an interface's packets. Raises CaptureError."""

    @abstractmethod
    def _packet(self, time_ns: int, data: bytes, *, interface: int, flags: int, comment: str, dropped: int) -> bytes:
        """Lay out one packet."""

    @abstractmethod
    def write_statistics(
        self, interface: int, *, start_ns: int, end_ns: int, received: int, dropped: int, os_dropped: int = 0
    ) -> None:
        """Write an interface's counts so far in this file, where the format has a place for them.

        received, dropped: records that came, and those that no file has; os_dropped: losses before us, in the kernel or
        the UART.
        """

    def add_interface(self, interface: Interface) -> int:
        """Describe an interface; the number that its packets carry, from 0. Raises CaptureError."""
        first = not self._sides
        appended = self._appended() if first else None
        if appended:
            self.origin = _repair(appended)
        blocks = self._introduction(interface, first=first)
        self._sides.append(_Side(interface, time.time_ns()))
        self._owed += blocks
        self._pay()
        if appended and appended.torn_size:
            self.notes.append(f"{self.output.name}: {self.origin}")
            torn = f": {appended.torn.hex()}" if appended.torn else " (zeros)"
            self.write_packet(time.time_ns(), b"", comment=self.origin + torn)
        return len(self._sides) - 1

    def write_packet(
        self,
        time_ns: int,
        data: bytes,
        *,
        interface: int = 0,
        flags: int = 0,
        comment: str = "",
        dropped: int = 0,
    ) -> None:
        """Write one packet; without bytes it is an event.

        time_ns: nanoseconds since 1970 (UTC); flags: see pcapng's ``epb_flags``; dropped: what the port lost before it.
        Raises CaptureError, which says how many records are safe and how many are lost, when the output broke; the
        output then ends in a whole block.
        """
        if not 0 <= interface < len(self._sides):
            message = f"interface {interface} was not described"
            raise ValueError(message)
        if self._series and self._series.is_full(self._in_file):
            self._go_on()
        side = self._sides[interface]
        side.dropped += dropped
        records = 1 if data else 0
        side.received += records
        if (not self._owed or self._pay(records)) and (self._full is None or self._tell_full(time_ns, records)):
            block = self._packet(time_ns, data, interface=interface, flags=flags, comment=comment, dropped=side.dropped)
            if self._write(block, records):
                self.written += records
                self._in_file += 1
                side.dropped = 0
                if self._statistics_at == math.inf:
                    self._statistics_at = time.monotonic() + STATISTICS_S
                if self._series:
                    if not data:
                        self._series.sync_soon()
                    if self._series.last and self._series.is_full(self._in_file):
                        self.complete = True
                return
        self.lost += records
        side.lost += records
        side.dropped += records
        if self._full:
            self._full.records += records
            self._full.bytes += len(data)
            self._full.events += not data
            if not data and len(self._full.missed) < MISSED_LIMIT:
                self._full.missed.append(f"{_clock(time_ns)} {comment}")

    def count_dropped(self, interface: int, records: int) -> None:
        """Count what the system or the adapter lost (bytes or marks, as the driver counts them), for the statistics."""
        self._sides[interface].os_dropped += records

    def rotate(self) -> str | None:
        """Close the current file in order and go on in a new one; its name. None: this output has no files to change.

        Raises CaptureError when the new file can not be written; where it can not be opened the capture goes on in the
        old one, and ``notes`` says so.
        """
        if self._series is None:
            return None
        following = self._series.open_next()
        if following is None:
            return self._series.name
        self.finish()
        self.origin = f"goes on from {self._series.name}"
        self._owed.clear()
        self._series.go_on(following)
        self._in_file = 0
        self._statistics_at = math.inf
        now_ns = time.time_ns()
        for number, side in enumerate(self._sides):
            self._sides[number] = _Side(side.interface, now_ns, dropped=side.dropped)
            self._owed += self._introduction(side.interface, first=number == 0)
        self._pay()
        return self._series.name

    @property
    def due(self) -> float:
        """When (``time.monotonic``) to call ``tick``, though there is nothing to write."""
        return min(self._statistics_at, self._series.due) if self._series else self._statistics_at

    def hand_on(self) -> None:
        """Hand on what waits for a slow reader, as far as it takes it. Raises CaptureError when the output broke."""
        try:
            self.output.pump()
        except OSError as error:
            self.failure = error
            raise self.broken() from error

    def tick(self) -> None:
        """Do what is due by time: the next file, statistics. Raises CaptureError when the output broke."""
        self.hand_on()
        now = time.monotonic()
        if self._series and now >= self._series.due:
            self._go_on()
        if now >= self._statistics_at:
            self._statistics_at = math.inf
            self.finish()

    def finish(self) -> None:
        """Write the statistics of each interface, of the current file. Raises CaptureError when the output broke."""
        now_ns = time.time_ns()
        if not self._pay() or not self._tell_full(now_ns):
            return
        for number, side in enumerate(self._sides):
            self.write_statistics(
                number,
                start_ns=side.since_ns,
                end_ns=max(now_ns, side.since_ns),
                received=side.received,
                dropped=side.lost,
                os_dropped=side.os_dropped,
            )

    def _go_on(self) -> None:
        """Change files by the rules, unless it was the last."""
        if self._series and self._series.last:
            self.complete = True
        else:
            self.rotate()

    def _appended(self) -> Whole | None:
        """Return what the current file held before."""
        return self._series.current.appended if self._series else None

    def _pay(self, records: int = 0) -> bool:
        """Write the introductions that are owed; False: they do not fit yet."""
        while self._owed:
            if not self._write(self._owed[0], records):
                return False
            del self._owed[0]
        return True

    def _tell_full(self, now_ns: int, records: int = 0) -> bool:
        """When the disk was full: try whether there is space again, and write what happened; False: still full."""
        full = self._full
        if full is None:
            return True
        text = f"disk full from {_clock(full.since_ns)} to {_clock(now_ns)}: "
        text += f"{counted(full.records, 'record')} ({counted(full.bytes, 'byte')}) lost here"
        if full.events:
            text += f"; {counted(full.events, 'event')} meanwhile: {'; '.join(full.missed)}"
        block = self._packet(now_ns, b"", interface=0, flags=0, comment=text, dropped=0)
        if not self._write(block, records):
            return False
        self._in_file += 1
        self.notes.append(f"{self.output.name}: {text}")
        self._full = None
        return True

    def _write(self, block: bytes, records: int = 0) -> bool:
        try:
            return self.output.write(block)
        except OSError as error:
            if self._wait_when_full and error.errno in FULL:
                if self._full is None:
                    self._full = _Full(time.time_ns())
                return False
            self.lost += records
            self.failure = error
            raise self.broken() from error

    def broken(self) -> CaptureError:
        """Say what happened to the output, and to the records."""
        if isinstance(self.failure, BrokenPipeError):
            why, advice = "its reader went away", "start the reader again"
        else:
            why = reason(self.failure) if self.failure else "can not be written"
            advice = "free some space, or write elsewhere"
        return CaptureError(
            f"{self.output.name}: {why}; {counted(self.written, 'record')} written, {self.lost} lost; {advice}"
        )

    def close(self) -> None:
        """Close the output. What goes wrong is in ``notes``."""
        self.output.close()
        if self._full:
            lost = f"{counted(self._full.records, 'record')} ({counted(self._full.bytes, 'byte')}) lost"
            since = _clock(self._full.since_ns)
            self.notes.append(f"{self.output.name}: the disk was full to the end, since {since}: {lost}")
            self._full = None
        if self._series:
            self.notes += self._series.notes
            self._series.notes.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _repair(appended: Whole) -> str:
    """Say what was there, and what was cut off of it."""
    text = f"appended to {counted(appended.end, 'byte')}"
    if appended.torn_size:
        text += f", after a torn end of {counted(appended.torn_size, 'byte')} was cut off"
    return text


def _clock(time_ns: int) -> str:
    """``2026-01-31 12:00:00.123 UTC``."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03} UTC"


def counted(number: int, what: str) -> str:
    """``1 record``, ``2 records``."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
