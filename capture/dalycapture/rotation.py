# SPDX-License-Identifier: GPL-2.0-or-later
"""One capture in several files, in dumpcap's words (``-b``), and in what form each is kept.

    -w x.pcapng                     x.pcapng; after ``rotate()`` x_00002_20260131120000.pcapng, and so on
    -w x.pcapng -b duration:3600    x_00001_20260131110000.pcapng, x_00002_20260131120000.pcapng, ...

Each file has its final name from the start: after a kill or a power cut nothing needs to be renamed before it can be
read. That one is closed and whole is told by ``printname:`` and by its checksum file, which appear then.

The next file is opened before the one before it is closed: where that fails, the capture goes on in the old one.
"""

from __future__ import annotations

import contextlib
import math
import os
import stat
import sys
import time
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dalycapture.checksum import checksum_path
from dalycapture.disk import SYNC_S
from dalycapture.errors import CaptureError
from dalycapture.output import open_file

if TYPE_CHECKING:
    from dalycapture.output import FileOutput

AGAIN_S: Final = 5.0  # until opening the next file is tried again


@dataclass(frozen=True, slots=True)
class Rotation:
    """When to go on in the next file; None: not for this reason. As with dumpcap, several may be given.

    duration: seconds in one file; interval: at every whole multiple of so many seconds of the clock; filesize: bytes;
    packets: records and events; files: keep so many, the oldest goes; printname: a file (``-``: standard output,
    ``stderr``) that is told the name of each file when it is closed; stop_after: end the capture after so many files.
    """

    duration: float | None = None
    interval: int | None = None
    filesize: int | None = None
    packets: int | None = None
    files: int | None = None
    printname: str = ""
    stop_after: int | None = None

    @property
    def asked(self) -> bool:
        """True when files have numbers from the first."""
        return not (self.duration is self.interval is self.filesize is self.packets is None)


@dataclass(frozen=True, slots=True)
class Keeping:
    """How the files of a capture are kept.

    append: go on behind what is there, after a torn end is cut off; checksum: leave a checksum file beside each closed
    one; wait_when_full: when the disk is full count what is lost and go on when there is space again, else stop;
    sync_s: seconds between two syncs to the disk, 0: never.
    """

    append: bool = False
    checksum: bool = False
    wait_when_full: bool = False
    sync_s: float = SYNC_S
    rotation: Rotation = field(default_factory=Rotation)


class FileSeries:
    """An output that goes from file to file. ``size`` counts over all of them."""

    def __init__(self, path: Path, keeping: Keeping, file_format: str = "pcapng") -> None:
        """Open the first file. Raises CaptureError."""
        rotation = keeping.rotation
        if keeping.append and rotation.asked:
            raise CaptureError("--append goes on in one file, -b begins new ones; leave one of them out")
        self.notes: list[str] = []
        self.number = 1  # of the current file
        self._path, self._keeping, self._rotation = path, keeping, rotation
        self._format = file_format
        self._names = _Names(rotation.printname) if rotation.printname else None
        self._before = 0  # bytes in earlier files
        self._files: deque[Path] = deque()  # those that may be removed
        self._closing: list[FileOutput] = []
        self._not_before = 0.0
        self.current = self._open(self._name(1) if rotation.asked else path, new=rotation.asked, append=keeping.append)
        self._since = time.monotonic()
        self._until = self._next_time()

    @property
    def name(self) -> str:
        """The current file."""
        return self.current.name

    @property
    def paths(self) -> list[Path]:
        """The files that are there, the current one last."""
        return [*self._files, *([self.current.path] if self.current.path else [])]

    @property
    def size(self) -> int:
        """Bytes written so far, in all files."""
        return self._before + self.current.size

    @property
    def due(self) -> float:
        """When (``time.monotonic``) the current file has had its time."""
        return self._until

    @property
    def last(self) -> bool:
        """True when no further file may be begun."""
        return self._rotation.stop_after is not None and self.number >= self._rotation.stop_after

    def is_full(self, packets: int) -> bool:
        """Tell whether the current file, with so many packets in it, has had its share."""
        rotation = self._rotation
        full = (rotation.packets is not None and packets >= rotation.packets) or (
            rotation.filesize is not None and self.current.size >= rotation.filesize
        )
        return full and (not self._not_before or time.monotonic() >= self._not_before)

    def write(self, block: bytes) -> bool:
        """Write one block to the current file. Raises OSError."""
        return self.current.write(block)

    def pump(self) -> None:
        """Raise OSError where the disk refused what it had seemed to take."""
        self.current.pump()

    def sync_soon(self) -> None:
        """Have what was written on the disk as soon as it can."""
        self.current.sync_soon()

    def open_next(self) -> FileOutput | None:
        """Open the next file; ``go_on`` makes it the current one. None where that can not be: it is noted."""
        number = self.number + 1
        try:
            # A name that somebody moved away, as logrotate does, is free again.
            moved = not self._rotation.asked and not os.path.lexists(self._path)
            following = self._open(self._path if moved else self._name(number), new=True)
        except CaptureError as error:
            self._not_before = time.monotonic() + AGAIN_S
            self._until = max(self._until, self._not_before) if self._until < math.inf else math.inf
            note = f"went on in {self.name}: {error}"
            if note not in self.notes:
                self.notes.append(note)
            return None
        self.number = number
        return following

    def go_on(self, following: FileOutput) -> None:
        """Close the current file and go on in this one; files beyond those to keep are removed."""
        self._before += self.current.size
        if self.current.path:
            self._files.append(self.current.path)
        self.current.end(self._closing[-1] if self._closing else None)
        self._closing.append(self.current)
        self._closing = [one for one in self._closing if not self._gather(one, wait=False)]
        self.current = following
        self._not_before = 0.0
        self._since = time.monotonic()
        self._until = self._next_time()
        while self._rotation.files is not None and len(self._files) >= self._rotation.files:
            oldest = self._files.popleft()
            for one in [one for one in self._closing if one.path == oldest]:
                self._gather(one, wait=True)  # else its checksum would come after it went
            self._remove(oldest)

    def close(self) -> None:
        """Close the current file, and wait until all are closed."""
        self.current.end(self._closing[-1] if self._closing else None)
        for one in (*self._closing, self.current):
            self._gather(one, wait=True)
        self._closing = []
        if self._names:
            self._names.close()

    def _open(self, path: Path, *, new: bool, append: bool = False) -> FileOutput:
        return open_file(
            path,
            file_format=self._format,
            append=append,
            new=new,
            sync_s=self._keeping.sync_s,
            checksum=self._keeping.checksum,
            told=self._names.tell if self._names else None,
        )

    def _gather(self, one: FileOutput, *, wait: bool) -> bool:
        """Take what the closing of a file has to say; False: it is not closed yet."""
        if wait:
            one.join()
        if not one.closed:
            return False
        self.notes += one.notes
        one.notes.clear()
        return True

    def _remove(self, path: Path) -> None:
        try:
            path.unlink()
            if self._keeping.checksum:
                checksum_path(path).unlink(missing_ok=True)
        except FileNotFoundError:
            pass
        except OSError as error:
            self.notes.append(f"{path} could not be removed: {error.strerror}")

    def _name(self, number: int) -> Path:
        label = f"{number:05}_{time.strftime('%Y%m%d%H%M%S')}"  # local time, as dumpcap has it
        return self._path.with_name(f"{self._path.stem}_{label}{self._path.suffix}")

    def _next_time(self) -> float:
        until = math.inf
        if self._rotation.duration is not None:
            until = self._since + self._rotation.duration
        if self._rotation.interval is not None:
            left = self._rotation.interval - time.time() % self._rotation.interval
            until = min(until, self._since + left)
        return until


class _Names:
    """Where the names of closed files go, a line each. An ordinary file is added to, a pipe never waited for."""

    def __init__(self, place: str) -> None:
        self._own = place not in {"-", "stdout", "stderr"}
        if not self._own:
            self._fd = (sys.stderr if place == "stderr" else sys.stdout).fileno()
            return
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
        try:
            with contextlib.suppress(FileNotFoundError):
                if stat.S_ISFIFO(Path(place).stat().st_mode):
                    flags = os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC  # opens though nobody reads yet
            self._fd = os.open(place, flags, 0o666)
        except OSError as error:
            message = f"printname:{place} can not be written: {error.strerror}; name a file, - or stderr"
            raise CaptureError(message) from None

    def tell(self, name: str) -> None:
        with contextlib.suppress(OSError):
            os.write(self._fd, os.fsencode(name + "\n"))

    def close(self) -> None:
        if self._own:
            os.close(self._fd)
