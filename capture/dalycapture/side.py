# SPDX-License-Identifier: GPL-2.0-or-later
"""One tapped side of a bus: a port, what comes out of it as records, and what went wrong on its line.

    port --bytes--> marks of line errors out --> framer --> records with time, flags and losses

A bus tapped at one place has one side. Of a two-port tap one side hears what the host says, the other what the BMS
says::

    side    epb_flags            daly
    host    outbound (10)        requests
    bms     inbound (01)         replies

as seen by the host, who is the one that asks (an RTAC capture calls its directions the same way).
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

from dalycapture.framing import SILENCE_NS, Framer, TimedRecord
from dalycapture.line import Counts
from dalycapture.marks import Unmarker
from dalycapture.pcapng import CRC_ERROR, INBOUND, OUTBOUND, SYMBOL_ERROR, TOO_SHORT
from dalycapture.port import READ_SIZE, Facts, Port
from dalycapture.replug import Replug, can_come_back
from dalycapture.settings import Settings
from dalycapture.tally import SideTally
from dalyref.kinds import Kind

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.interface import Interface

ERROR_FLAGS: Final = {Kind.BAD_CHECKSUM: CRC_ERROR, Kind.SHORT: TOO_SHORT}
DIRECTIONS: Final = {"host": OUTBOUND, "bms": INBOUND}
TROUBLE_EVERY_NS: Final = 1_000_000_000  # a line event for each second at most
_FAR: Final = 1 << 62


class Side:
    """A port that is listened to, open or waited for.

    port: open; closed by ``close``. interface: as the file describes it. settings: as it was opened, and is opened
    again. name: ``host`` or ``bms`` of a two-port tap. wait_s: for how long to wait for a port that went away; None:
    for ever, 0: not at all.
    """

    def __init__(
        self,
        port: Port,
        interface: Interface,
        *,
        settings: Settings | None = None,
        name: str = "",
        wait_s: float | None = 0.0,
    ) -> None:
        self.interface = interface
        self.name = name
        self.tally = SideTally(port.name)
        self.rest_until_ns = 0  # the port need not be looked at before
        self._settings = settings or Settings(interface.speed or 9600)
        direction = DIRECTIONS.get(name, 0)
        self._flags = {kind: direction | ERROR_FLAGS.get(kind, 0) for kind in Kind}
        self._wait_s = wait_s
        self._port: Port | None = port
        self._name = port.name
        self._facts: Facts = port.facts
        self._framer = Framer(
            self._settings.baud, bits_per_byte=self._settings.bits_per_byte, latency=port.facts.latency
        )
        self._unmarker = Unmarker()
        self._fed = 0  # bytes, without marks
        self._errors: deque[int] = deque()  # offsets of bytes with line errors
        self._before = port.counts()
        self._untold: Counts = Counts()
        self._untold_marks = [0, 0]  # bytes with errors, breaks
        self._trouble_ns = 0  # when the first of the untold came
        self._told_ns = -TROUBLE_EVERY_NS
        self._dropped = 0  # bytes lost since the last record
        self._read_ns = 0
        self._checked_ns = 0  # all that was in the kernel then was read
        self._lost_ns = 0
        self._replug: Replug | None = None
        if self._before is not None:
            self.tally.counts = Counts()

    @property
    def fd(self) -> int:
        """Descriptor to poll; -1 while the port is away."""
        return self._port.fileno() if self._port else -1

    @property
    def number(self) -> int:
        """Which side it is, from 0: what its records and its interface carry."""
        return self._framer.side

    @number.setter
    def number(self, number: int) -> None:
        self._framer.side = number

    @property
    def lost_for_ever(self) -> bool:
        """Whether the port is away and nobody waits for it."""
        return self._port is None and self._replug is None

    def silence_at_ns(self) -> int | None:
        """When what is held must be given up, if nothing more comes; None where nothing is held."""
        last = self._framer.timing.last_ns
        return None if last is None else last + SILENCE_NS

    def horizon_ns(self) -> int:
        """Nothing that began before this will come from here any more."""
        timing = self._framer.timing
        floor = timing.floor_ns
        if floor is not None:
            return floor
        return self._checked_ns - timing.delay_ns if self._port else _FAR

    @property
    def delay_ns(self) -> int:
        """How far the horizon lies behind the present on a silent bus."""
        return self._framer.timing.delay_ns

    @property
    def quiet(self) -> bool:
        """Whether no byte waits for its record."""
        return not self._framer.pending

    def checked(self, now_ns: int) -> None:
        """Note that nothing was there to be read at this moment."""
        self._checked_ns = now_ns

    def read(self, clock: Callable[[], int], woken_ns: int, late_ns: int) -> list[TimedRecord]:
        """Read what is there; the records that are complete now. Raises PortError when the port is gone.

        woken_ns, late_ns: as dalycapture.lateness has them.
        """
        if self._port is None:
            return []
        data = self._port.read()
        now = clock()
        if not data:
            return []
        late_ns += now - woken_ns
        if self.rest_until_ns:  # nobody looked in between
            late_ns += max(0, now - self._read_ns)
            self.rest_until_ns = 0
        self._checked_ns = woken_ns
        self._read_ns = now
        more = len(data) >= READ_SIZE - 1  # a tty gives 4095 at most
        if self._facts.marked:
            data = self._unmark(data, now)
            if not data:
                return []
        self.tally.bytes += len(data)
        self._fed += len(data)
        records = self._framer.feed(data, now, late_ns, more=more)
        until = self._framer.rest_until_ns()
        if until > now + 2_000_000:
            self.rest_until_ns = until
        return records

    def _unmark(self, data: bytes, now: int) -> bytes:
        data, errors, breaks = self._unmarker.feed(data)
        if errors or breaks:
            self._errors += [self._fed + at for at in (*errors, *breaks)]
            self.tally.marked += len(errors)
            self.tally.breaks += len(breaks)
            self._untold_marks[0] += len(errors)
            self._untold_marks[1] += len(breaks)
            self._trouble_ns = self._trouble_ns or now
        return data

    def flush(self, now: int) -> list[TimedRecord]:
        """Close what is incomplete: silence, or the end."""
        records: list[TimedRecord] = []
        if held := self._unmarker.flush():
            self.tally.bytes += len(held)
            self._fed += len(held)
            records = self._framer.feed(held, now, now - self._read_ns)
        self.rest_until_ns = 0
        return records + self._framer.flush()

    def event(self) -> list[TimedRecord]:
        """Note that an event lies here; records that end at it."""
        return self._framer.event()

    def flags_and_losses(self, timed: TimedRecord) -> tuple[int, int]:
        """Return epb_flags of a record, and how many bytes were lost before it. Records are asked for in order."""
        record = timed.record
        flags = self._flags[record.kind]
        if self._errors:
            end = record.start + len(record.data)
            while self._errors and self._errors[0] < end:
                self._errors.popleft()
                flags |= SYMBOL_ERROR
        dropped, self._dropped = self._dropped, 0
        return flags, dropped

    def count_line_errors(self, now: int) -> None:
        """Ask the driver for its counters."""
        counts = self._port.counts() if self._port else None
        if counts is None or self._before is None:
            return
        new = counts.since(self._before)
        self._before = counts
        self.tally.counts = Counts(*map(sum, zip(self.tally.counts or Counts(), new, strict=True)))
        if any(new[1:]):
            self._untold = Counts(*map(sum, zip(self._untold, new, strict=True)))
            self._dropped += new.lost
            self._trouble_ns = self._trouble_ns or now

    def trouble(self, now: int) -> tuple[int, str] | None:
        """Tell what is wrong with the line since last told, once a second at most: (when it began, in words)."""
        if not self._trouble_ns or now < self._told_ns + TROUBLE_EVERY_NS:
            return None
        marked, breaks = self._untold_marks
        words = [
            f"{marked} bytes marked" if marked else "",
            f"{breaks} breaks marked" if breaks else "",
            f"driver counts {self._untold}" if any(self._untold[1:]) else "",
        ]
        told = self._trouble_ns, f"line errors: {', '.join(word for word in words if word)}"
        self._told_ns, self._trouble_ns = now, 0
        self._untold, self._untold_marks = Counts(), [0, 0]
        return told

    def lost(self, now: int, found: Callable[[], None]) -> None:
        """Let a port go that is gone; begin to wait for it, if it may be waited for. found: called when it is back."""
        if self._port:
            self._port.close()
            if self._wait_s != 0 and can_come_back(self._name):
                self._replug = Replug(self._port, self._settings, found)
        self._port = None
        self.tally.away = self._replug is not None
        self._lost_ns = now
        self._unmarker = Unmarker()

    def give_up_ns(self) -> int:
        """When to wait no longer."""
        if self._replug is None or self._wait_s is None:
            return _FAR
        return self._lost_ns + round(self._wait_s * 1e9)

    def give_up(self) -> None:
        """Wait no longer."""
        if self._replug:
            self._replug.stop()
            self._replug = None

    def back(self, now: int) -> str | None:
        """Go on with the port, if it is back: what happened, in words."""
        port = self._replug.take() if self._replug else None
        if port is None:
            return None
        gap = (now - self._lost_ns) / 1e9
        self._replug = None
        self.tally.away = False
        self._port, self._facts = port, port.facts
        self._framer.timing.opened(now, port.facts.latency)
        self._before = port.counts()
        self.tally.gap(gap)
        return f"port back after {gap:.3f} s: {'; '.join((port.name, *port.facts.remarks))}"

    def end(self, now: int) -> None:
        """Note that the capture ends: a port that is still waited for was away until then."""
        if self.tally.away:
            self.tally.gap((now - self._lost_ns) / 1e9)

    def close(self) -> None:
        """Close the port, or stop waiting for it."""
        self.give_up()
        if self._port:
            self._port.close()
            self._port = None
