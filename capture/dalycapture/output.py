# SPDX-License-Identifier: GPL-2.0-or-later
"""Where blocks of a capture go: a file or a pipe, each block whole or not at all.

A file gets every block by one ``write`` as soon as it is made, so that a kill loses nothing that was framed. A block
that does not fit (disk full, size limit) is cut off again: the file always ends at the border of a block.

A pipe belongs to somebody else (tshark, Wireshark) who may be slow or gone. Blocks wait for it in a bounded backlog and
go out in pieces that a pipe takes without blocking, so that a stalled reader never stalls the bus.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import select
import stat
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dalycapture.checksum import checksum_path, write_checksum
from dalycapture.disk import DiskThread
from dalycapture.errors import CaptureError, reason
from dalycapture.torn import find_end

if TYPE_CHECKING:
    from collections.abc import Callable
    from hashlib import _Hash as Hasher  # pyright: ignore[reportPrivateUsage]

    from dalycapture.torn import Whole

CAPTURE_MAGICS = frozenset(
    bytes.fromhex(text) for text in ("0a0d0d0a", "a1b2c3d4", "d4c3b2a1", "a1b23c4d", "4d3cb2a1", "a1b2cd34", "34cdb2a1")
)
"""First four bytes of pcapng and of the classic pcap kinds."""

PIPE_PIECE = 4096  # PIPE_BUF on Linux: a pipe that polls writable takes this many bytes at once
BACKLOG_LIMIT = 8 << 20  # bytes; half an hour of a full bus at 9600 baud with all headers
GOODBYE_S = 2.0  # how long closing waits for the reader of a pipe


class Output(Protocol):
    """Takes whole blocks."""

    @property
    def name(self) -> str:
        """What to call it."""
        ...

    @property
    def size(self) -> int:
        """Bytes taken so far."""
        ...

    def write(self, block: bytes) -> bool:
        """Take a block; False: it had to be dropped, though the output lives. Raises OSError when it is broken."""
        ...

    def pump(self) -> None:
        """Hand on what waits for a slow reader. Raises OSError."""
        ...

    def close(self) -> None:
        """Close; what could not go out is lost."""
        ...


class FileOutput:
    """A regular file. The file keeps its last whole block, whatever happens.

    sync_s: seconds between two syncs to the disk, 0: never. path, hasher: where and by what its checksum is to be left
    when it is closed. told: called then with its name. appended: what was there before, where it is gone on with.
    """

    def __init__(
        self,
        fd: int,
        name: str,
        *,
        path: Path | None = None,
        sync_s: float = 0.0,
        hasher: Hasher | None = None,
        told: Callable[[str], None] | None = None,
        appended: Whole | None = None,
    ) -> None:
        self.name = name
        self.size = 0
        self.path = path
        self.appended = appended
        self.notes: list[str] = []  # what went wrong at its end
        self.closed = False
        self._fd = fd
        self._hasher = hasher
        self._told = told
        self._after: FileOutput | None = None
        appending = _is_appending(fd)
        self._start = os.fstat(fd).st_size if appending else os.lseek(fd, 0, os.SEEK_CUR)
        self._disk = DiskThread(fd, path, sync_s, self._at_end)

    def write(self, block: bytes) -> bool:
        """Write one block. Raises OSError after the file was cut back to the block before."""
        done = 0
        try:
            while done < len(block):  # a short write tells nothing; the next one says why
                done += os.write(self._fd, block[done:] if done else block)
        except OSError:
            end = self._start + self.size
            if done:
                os.ftruncate(self._fd, end)
            with contextlib.suppress(OSError):
                os.lseek(self._fd, end, os.SEEK_SET)
            raise
        self.size += done
        if self._hasher:
            self._hasher.update(block)
        self._disk.dirty()
        return True

    def pump(self) -> None:
        """Raise OSError where the disk refused what it had seemed to take."""
        if self._disk.problem:
            raise self._disk.problem

    def sync_soon(self) -> None:
        """Have what was written on the disk as soon as it can."""
        self._disk.sync_soon()

    def end(self, after: FileOutput | None = None) -> None:
        """Close the file without waiting for the disk; ``join`` does. after: its name is to be told before ours."""
        self._after = after
        self._disk.end()

    def join(self) -> None:
        """Wait until the file is closed; ``notes`` then says what went wrong."""
        self._disk.join()

    def close(self) -> None:
        """Close the file, and wait for it."""
        self.end()
        self.join()

    def _at_end(self) -> None:
        if self._disk.problem:
            self.notes.append(f"{self.name}: {reason(self._disk.problem)} when it was closed; its end may be missing")
        elif self._hasher and self.path:
            try:
                write_checksum(self.path, self._hasher.hexdigest())
            except OSError as error:
                self.notes.append(f"{self.name} has no checksum file: {reason(error)}")
        if self._after:
            self._after.join()
            self._after = None
        if self._told:
            self._told(self.name)
        self.closed = True


class PipeOutput:
    """A pipe, FIFO, socket or character device, never waited for, but at its end for goodbye_s seconds.

    Where the system can not tell when a pipe takes more (Windows), a thread waits for it instead of ``pump``.
    """

    def __init__(self, fd: int, name: str, goodbye_s: float | None = None) -> None:
        self.name = name
        self.size = 0
        self._fd = fd
        self._backlog = bytearray()
        self._goodbye_s = GOODBYE_S if goodbye_s is None else goodbye_s
        self._poll = select.poll() if hasattr(select, "poll") else None
        self._more = threading.Condition()
        self._broken: OSError | None = None
        if self._poll:
            self._poll.register(fd, select.POLLOUT)
        else:
            threading.Thread(target=self._work, name=f"writer of {name}", daemon=True).start()

    def fileno(self) -> int:
        """Poll this for POLLERR (the reader went away) and, while something waits, for POLLOUT; -1: it can't be."""
        return self._fd if self._poll else -1

    @property
    def waiting(self) -> int:
        """Bytes that the reader has not taken yet."""
        return len(self._backlog)

    def write(self, block: bytes) -> bool:
        """Take a block; False if the backlog is full. Raises OSError (EPIPE) when the reader went away."""
        if len(self._backlog) + len(block) > BACKLOG_LIMIT:
            self.pump()
            if len(self._backlog) + len(block) > BACKLOG_LIMIT:
                return False
        with self._more:
            self._backlog += block
            self._more.notify()
        self.size += len(block)
        self.pump()
        return True

    def pump(self) -> None:
        """Hand over what the pipe takes now. Raises OSError (EPIPE) when the reader went away."""
        if self._broken:
            raise self._broken
        while self._poll:
            ready = self._poll.poll(0)
            events = ready[0][1] if ready else 0
            if events & (select.POLLERR | select.POLLNVAL):
                raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))
            if not self._backlog or not events & select.POLLOUT:
                return
            del self._backlog[: os.write(self._fd, self._backlog[:PIPE_PIECE])]

    def close(self) -> None:
        """Give the reader a moment to take the rest, then close. A reader that went away is no error here."""
        deadline = time.monotonic() + self._goodbye_s
        with contextlib.suppress(OSError):
            self.pump()
            while self._backlog and (left := deadline - time.monotonic()) > 0:
                if self._poll:
                    self._poll.poll(left * 1000)
                else:
                    time.sleep(min(left, 0.01))
                self.pump()
        with contextlib.suppress(OSError):
            os.close(self._fd)

    def _work(self) -> None:
        while True:
            with self._more:
                self._more.wait_for(lambda: self._backlog)
                piece = bytes(self._backlog[:PIPE_PIECE])
            try:
                done = os.write(self._fd, piece)
            except OSError as error:
                # Windows says EINVAL of a pipe whose reader is gone.
                gone = error.errno in {errno.EPIPE, errno.EINVAL}
                self._broken = BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE)) if gone else error
                return
            with self._more:
                del self._backlog[:done]


def open_output(path: Path | str) -> FileOutput | PipeOutput:
    """Open a capture output: a path (made, or overwritten if it is a capture), a FIFO, ``-`` for standard output.

    As dumpcap does, an older capture of that name is overwritten; a file that is no capture never is. Raises
    CaptureError.
    """
    if str(path) == "-":
        return _standard_output()
    return open_pipe(path) or open_file(Path(path))


def open_pipe(path: Path | str) -> PipeOutput | None:
    """Open what is there and is no regular file (a FIFO, a device); else None. Raises CaptureError."""
    try:
        kind = _kind_of(Path(path))
        if kind is None or stat.S_ISREG(kind):
            return None
        return PipeOutput(os.open(path, os.O_WRONLY | os.O_CLOEXEC | os.O_NOCTTY), str(path))
    except OSError as error:
        raise CaptureError(_cannot_write(path, error)) from None


def open_file(
    path: Path,
    *,
    file_format: str = "pcapng",
    append: bool = False,
    new: bool = False,
    sync_s: float = 0.0,
    checksum: bool = False,
    told: Callable[[str], None] | None = None,
) -> FileOutput:
    """Open a regular file to write a capture. Raises CaptureError.

    append: go on behind what is whole of the capture of this format that is there; new: only if nothing is there. The
    rest is told in FileOutput.
    """
    name = str(path)
    flags = (os.O_RDWR if append else os.O_WRONLY) | os.O_CREAT | os.O_CLOEXEC | os.O_APPEND
    try:
        if not new and not append:
            refuse_other_files(path)
        fd = os.open(path, flags | (os.O_EXCL if new else 0) | getattr(os, "O_NOCTTY", 0), 0o666)
    except OSError as error:
        raise CaptureError(_cannot_write(path, error)) from None
    try:
        _own(fd, name)
        hasher = hashlib.sha256() if checksum else None
        appended = _whole(fd, name, file_format, hasher) if append else None
        os.ftruncate(fd, appended.end if appended else 0)
        if checksum:
            checksum_path(path).unlink(missing_ok=True)  # that of what was there; ours comes when all is whole
        return FileOutput(fd, name, path=path, sync_s=sync_s, hasher=hasher, told=told, appended=appended)
    except OSError as error:
        os.close(fd)
        raise CaptureError(_cannot_write(path, error)) from None
    except BaseException:
        os.close(fd)
        raise


def _whole(fd: int, name: str, file_format: str, hasher: Hasher | None) -> Whole | None:
    """Find what is whole of the capture that is there, and begin its checksum; None: there is nothing."""
    size = os.fstat(fd).st_size
    if not size:
        return None
    with os.fdopen(os.dup(fd), "rb", buffering=0) as file:
        whole = find_end(file, name, size)
        if whole.file_format not in {file_format, ""}:
            raise CaptureError(f"{name} is {whole.file_format}, and {file_format} can not follow it; use another name")
        if hasher:
            file.seek(0)
            left = whole.end
            while left and (piece := file.read(min(left, 1 << 20))):
                hasher.update(piece)
                left -= len(piece)
    return whole


def _standard_output() -> FileOutput | PipeOutput:
    fd = os.dup(sys.stdout.fileno())
    if os.isatty(fd):
        os.close(fd)
        raise CaptureError("standard output is a terminal; give -w FILE, or pipe it: ... -w - | tshark -r -")
    if stat.S_ISREG(os.fstat(fd).st_mode):
        return FileOutput(fd, "standard output")
    return PipeOutput(fd, "standard output")


def _kind_of(path: Path) -> int | None:
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a directory")
    if stat.S_ISBLK(mode):
        raise CaptureError(f"{path} is a disk, not a capture file; give the name of a file")
    return mode


def refuse_other_files(path: Path) -> None:
    """See that nothing but a capture is overwritten. Raises CaptureError, OSError."""
    try:
        with path.open("rb") as file:
            magic = file.read(4)
    except FileNotFoundError:
        return
    except PermissionError:
        raise CaptureError(f"{path} is there and can not be read; choose another name") from None
    if magic and magic not in CAPTURE_MAGICS:
        raise CaptureError(f"{path} is there and is not a capture file, so it is not overwritten; choose another name")


def beside(place: Path) -> Path:
    """Name a file beside `place`, which takes its name when it is whole. Raises CaptureError where none can be made."""
    refuse_other_files(place)
    if not place.parent.is_dir():
        raise CaptureError(_cannot_write(place, FileNotFoundError()))
    if not os.access(place.parent, os.W_OK):
        raise CaptureError(_cannot_write(place, PermissionError()))
    return place.with_name(f".{place.name}.{os.getpid()}.part")


def _cannot_write(path: Path | str, error: OSError) -> str:
    folder = Path(path).parent
    if isinstance(error, IsADirectoryError):
        return f"{path} is a directory; give the name of a file in it"
    if isinstance(error, FileExistsError):
        return f"{path} is there already; wait a second, or write elsewhere"
    if isinstance(error, FileNotFoundError):
        return f"there is no directory {folder} for {Path(path).name}; make it first, or write elsewhere"
    if isinstance(error, PermissionError):
        return f"no permission to write {path}; choose another directory, or change its permissions"
    return f"can not write {path}: {reason(error)}"


def _own(fd: int, name: str) -> None:
    """Keep a second capture from cutting this one's file to nothing."""
    try:
        import fcntl
    except ImportError:  # Windows has no such lock
        return
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise CaptureError(f"{name} is being written by another capture; choose another name") from None
    except OSError:
        return  # a file system without locks


def _is_appending(fd: int) -> bool:
    try:
        import fcntl
    except ImportError:
        return True
    return bool(fcntl.fcntl(fd, fcntl.F_GETFL) & os.O_APPEND)
