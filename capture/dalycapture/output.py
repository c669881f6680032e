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
import os
import select
import stat
import sys
import time
from pathlib import Path
from typing import Protocol

from dalycapture.errors import CaptureError

CAPTURE_MAGICS = frozenset(
    bytes.fromhex(text) for text in ("0a0d0d0a", "a1b2c3d4", "d4c3b2a1", "a1b23c4d", "4d3cb2a1", "a1b2cd34", "34cdb2a1")
)
"""First four bytes of pcapng and of the classic pcap kinds."""

PIPE_PIECE = 4096  # PIPE_BUF on Linux: a pipe that polls writable takes this many bytes at once
BACKLOG_LIMIT = 8 << 20  # bytes; half an hour of a full bus at 9600 baud with all headers
GOODBYE_S = 2.0  # how long closing waits for the reader of a pipe


class Output(Protocol):
    """Takes whole blocks."""

    name: str
    size: int  # bytes taken so far

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
    """A regular file. The file keeps its last whole block, whatever happens."""

    def __init__(self, fd: int, name: str) -> None:
        self.name = name
        self.size = 0
        self._fd = fd
        appending = _is_appending(fd)
        self._start = os.fstat(fd).st_size if appending else os.lseek(fd, 0, os.SEEK_CUR)

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
        return True

    def pump(self) -> None:
        """Do nothing: a file takes all at once."""

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)


class PipeOutput:
    """A pipe, FIFO, socket or character device, never waited for."""

    def __init__(self, fd: int, name: str) -> None:
        self.name = name
        self.size = 0
        self._fd = fd
        self._backlog = bytearray()
        self._poll = select.poll()
        self._poll.register(fd, select.POLLOUT)

    def fileno(self) -> int:
        """Poll this for POLLERR (the reader went away) and, while something waits, for POLLOUT."""
        return self._fd

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
        self._backlog += block
        self.size += len(block)
        self.pump()
        return True

    def pump(self) -> None:
        """Hand over what the pipe takes now. Raises OSError (EPIPE) when the reader went away."""
        while True:
            ready = self._poll.poll(0)
            events = ready[0][1] if ready else 0
            if events & (select.POLLERR | select.POLLNVAL):
                raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))
            if not self._backlog or not events & select.POLLOUT:
                return
            del self._backlog[: os.write(self._fd, self._backlog[:PIPE_PIECE])]

    def close(self) -> None:
        """Give the reader a moment to take the rest, then close. A reader that went away is no error here."""
        deadline = time.monotonic() + GOODBYE_S
        with contextlib.suppress(OSError):
            self.pump()
            while self._backlog and (left := deadline - time.monotonic()) > 0:
                self._poll.poll(left * 1000)
                self.pump()
        with contextlib.suppress(OSError):
            os.close(self._fd)


def open_output(path: Path | str) -> FileOutput | PipeOutput:
    """Open a capture output: a path (made, or overwritten if it is a capture), a FIFO, ``-`` for standard output.

    As dumpcap does, an older capture of that name is overwritten; a file that is no capture never is. Raises
    CaptureError.
    """
    if str(path) == "-":
        return _standard_output()
    name = str(path)
    flags = os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | os.O_APPEND | getattr(os, "O_NOCTTY", 0)
    try:
        before = _kind_of(Path(path))
        if before is not None and not stat.S_ISREG(before):
            return PipeOutput(os.open(path, os.O_WRONLY | os.O_CLOEXEC | os.O_NOCTTY), name)
        if before is not None:
            _refuse_other_files(Path(path))
        fd = os.open(path, flags, 0o666)
    except OSError as error:
        raise CaptureError(_cannot_write(path, error)) from None
    try:
        _own(fd, name)
        os.ftruncate(fd, 0)
        return FileOutput(fd, name)
    except BaseException:
        os.close(fd)
        raise


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


def _refuse_other_files(path: Path) -> None:
    try:
        with path.open("rb") as file:
            magic = file.read(4)
    except PermissionError:
        raise CaptureError(f"{path} is there and can not be read; choose another name") from None
    if magic and magic not in CAPTURE_MAGICS:
        raise CaptureError(f"{path} is there and is not a capture file, so it is not overwritten; choose another name")


def _cannot_write(path: Path | str, error: OSError) -> str:
    folder = Path(path).parent
    if isinstance(error, IsADirectoryError):
        return f"{path} is a directory; give the name of a file in it"
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


def reason(error: OSError) -> str:
    """Say what the system said, in lower case: ``no space left on device``."""
    text = error.strerror or str(error)
    return text[:1].lower() + text[1:]
