# SPDX-License-Identifier: GPL-2.0-or-later
"""The whole of it: learn what is secret, write the copy, and prove it before it gets its name.

    IN  --> learn    what the codes, numbers and passwords are
    IN  --> write    beside OUT
        <-- prove    the same records, times and links; nothing of what was learned is left in any byte of the file
        --> OUT

Where the bytes that blank others come to look like a frame by accident, it is written again with other ones.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dalycapture.captured import Statistics, Told
from dalycapture.create import open_writer
from dalycapture.errors import CaptureError, reason
from dalycapture.output import beside
from dalycapture.reader import read_capture
from dalytools import __version__
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.redact.blanker import Blanker
from dalytools.redact.copies import Copies, shapes
from dalytools.redact.fill import Fill
from dalytools.redact.labels import Labels
from dalytools.redact.lines import OutOfStepError
from dalytools.redact.redactor import Redactor
from dalytools.redact.tally import Tally

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.captured import CapturedPacket
    from dalycapture.interface import Interface
    from dalycapture.writer import CaptureWriter
    from dalyref.options import Options
    from dalytools.redact.what import What

_FILLS: Final = (0x00, 0x01, 0x02, 0x04, 0x20, 0x40)
_SURELY: Final = 6
"""Bytes of the shortest value that can't stand in a file by accident."""
_MOST_LOOKED_FOR: Final = 256
_APPLICATION: Final = f"dalyshark {__version__} redact"
_PIECE: Final = 1 << 20
_TIMES: Final = range(1 << 63)


@dataclass(frozen=True, slots=True)
class Redacted:
    """What came of it."""

    tally: Tally
    broken: str
    """Where IN ends too early: what is wrong."""


def redact(source: str, target: str, options: Options, keep: frozenset[What]) -> Redacted:
    """Write a redacted copy, pcapng. Raises Problem where it can not be written, or would not be what it says."""
    place = Path(os.path.realpath(target))
    try:
        new = beside(place)
    except CaptureError as error:
        raise Problem(str(error)) from None
    try:
        original = _Original(source, options, keep)
        before, broken = original.learn()
        for fill in _FILLS:
            tally = original.write(new, fill)
            if _structure(new, options) == before:
                break
        else:
            raise Problem(
                f"{source}: bytes that blank others come to look like frames, so nothing was written; "
                "cut the capture up with editcap, and redact its parts"
            )
        _prove(new, original.copies)
        new.replace(place)
    except CaptureError as error:
        raise Problem(str(error)) from None
    except OutOfStepError:
        raise Problem(
            f"{source}: the records are not the bytes of its packets, a defect of this program, so nothing was "
            "written; please tell us"
        ) from None
    except OSError as error:
        raise Problem(f"{target} can not be written: {reason(error)}") from None
    finally:
        new.unlink(missing_ok=True)
    return Redacted(tally, broken)


@dataclass(slots=True)
class _Original:
    """The capture to copy; and the codes, numbers and passwords in it, as far as they are known."""

    source: str
    options: Options
    keep: frozenset[What]
    copies: Copies = field(default_factory=Copies)

    def learn(self) -> tuple[bytes, str]:
        """Read it for what is secret; return its structure, and what is wrong where it ends too early."""
        tally = Tally()
        blanker = Blanker(Fill(), tally, self.copies, self.keep, learning=True)
        redactor = Redactor(self.options, blanker, tally, _ignore)
        broken: list[str] = []
        for packet in _read(self.source, "redact, reading", Told(), broken):
            redactor.feed(packet)
        redactor.finish()
        if not tally.packets:
            raise Problem(f"{self.source}: the capture holds no packet, so there is nothing to copy")
        return redactor.structure.digest(), "".join(broken)

    def write(self, new: Path, fill: int) -> Tally:
        """Write the copy; return what was blanked. fill: the byte that numbers are blanked with."""
        tally = Tally()
        blanker = Blanker(Fill(fill), tally, self.copies, self.keep, learning=False)
        with open_writer(new, application=_APPLICATION, about_machine=False) as writer:
            between = _Between(writer, tally)

            def take(packet: CapturedPacket, data: bytes, said: str) -> None:
                if packet.time_ns not in _TIMES:
                    raise Problem(f"{self.source}: packet {packet.number} has a time that pcapng can not hold")
                writer.write_packet(
                    packet.time_ns,
                    data,
                    interface=packet.interface,
                    flags=packet.flags,
                    comment=said,
                    dropped=packet.dropped,
                )

            redactor = Redactor(self.options, blanker, tally, take)
            for packet in _read(self.source, "redact, writing", between.told, []):
                redactor.feed(packet)
            redactor.finish()
            between.finish()
        return tally


def _ignore(packet: CapturedPacket, data: bytes, said: str) -> None: ...


def _read(source: str, what: str, told: Told, broken: list[str]) -> Iterator[CapturedPacket]:
    """Yield the packets; where the file breaks off behind some, say so in `broken` and end."""
    number = 0
    with progress_bar(what) as advance:
        try:
            for packet in read_capture(source, told):
                number += 1
                if number % 1024 == 0:
                    advance(number)
                yield packet
        except CaptureError as error:
            if not number:
                raise
            broken.append(str(error))


class _Between:
    """Writes what stands between the packets."""

    def __init__(self, writer: CaptureWriter, tally: Tally) -> None:
        self.told = Told(self._interface, self._counted)
        self._writer = writer
        self._tally = tally
        self._labels = Labels()
        self._statistics: dict[int, Statistics] = {}

    def _interface(self, old: Interface) -> None:
        self._tally.interfaces += bool(old.name or old.description or old.hardware)
        self._writer.add_interface(self._labels.interface(old))

    def _counted(self, statistics: Statistics) -> None:
        self._statistics[statistics.interface] = statistics

    def finish(self) -> None:
        """Write the statistics of the interfaces that have some."""
        for number, old in sorted(self._statistics.items()):
            start_ns, end_ns = old.start_ns, old.end_ns  # asked first: a range looks for None in all of its numbers
            if start_ns is not None and end_ns is not None and start_ns in _TIMES and end_ns in _TIMES:
                self._writer.write_statistics(
                    number,
                    start_ns=start_ns,
                    end_ns=end_ns,
                    received=old.received or 0,
                    dropped=old.dropped or 0,
                    os_dropped=old.os_dropped or 0,
                )


def _structure(path: Path, options: Options) -> bytes:
    """Read the copy as anybody would."""
    tally = Tally()
    redactor = Redactor(options, Blanker(Fill(), tally, Copies(), frozenset(), learning=True), tally, _ignore)
    for packet in _read(str(path), "redact, proving", Told(), []):
        redactor.feed(packet)
    redactor.finish()
    return redactor.structure.digest()


def _prove(path: Path, copies: Copies) -> None:
    """Look for what was learned in all bytes of the file, in every shape, as hex too. Raises Problem."""
    looked_for = {
        shape
        for value in list(copies.values)[:_MOST_LOOKED_FOR]
        if len(value) >= _SURELY and value not in _APPLICATION.encode()
        for one in shapes(value)
        for shape in (one, one.hex().encode(), one.hex().upper().encode())
    }
    longest = max(map(len, looked_for), default=0)
    before = b""
    with path.open("rb") as file:
        while looked_for and (piece := file.read(_PIECE)):
            window = before + piece
            if any(shape in window for shape in looked_for):
                raise Problem(
                    f"{path.name}: a code or number of the capture is still in the copy, so it was taken away again; "
                    "please tell us"
                )
            before = window[-longest:]
