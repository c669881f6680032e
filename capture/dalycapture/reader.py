# SPDX-License-Identifier: GPL-2.0-or-later
"""Read any capture file we know, plain or gzip-compressed, from a path or standard input.

pcapng, classic pcap, btsnoop (Bluetooth), and the text logs of ``candump -L`` (CAN).
"""

from __future__ import annotations

import gzip
import sys
import zlib
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

from dalycapture import candump
from dalycapture.btsnoop import MAGIC as _BTSNOOP
from dalycapture.btsnoop import read_btsnoop
from dalycapture.errors import CaptureError, TruncatedError, reason
from dalycapture.file_numbers import MICROSECONDS, NANOSECONDS
from dalycapture.pcap import read_pcap
from dalycapture.pcapng import read_pcapng
from dalycapture.source import Source

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator
    from io import BufferedReader

    from dalycapture.captured import CapturedPacket, Told

_PCAPNG = b"\x0a\x0d\x0d\x0a"
_PCAP = frozenset(magic.to_bytes(4, order) for magic in (MICROSECONDS, NANOSECONDS) for order in ("little", "big"))
_GZIP = b"\x1f\x8b"
_OTHERS = (
    (b"\x28\xb5\x2f\xfd", "is compressed with zstd; unpack it first: zstd -d"),
    (b"\x04\x22\x4d\x18", "is compressed with lz4; unpack it first: lz4 -d"),
    (b"\xfd7zXZ", "is compressed with xz; unpack it first: xz -d"),
    (b"PK\x03\x04", "is a zip archive; unpack it first"),
    (b"\xa1\xb2\xcd\x34", "is a modified pcap; convert it first: editcap -F pcapng"),
    (b"\x34\xcd\xb2\xa1", "is a modified pcap; convert it first: editcap -F pcapng"),
)


def read_capture(path: Path | str, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the packets of a capture file, in order, numbered from 1 as Wireshark numbers them.

    path: pcapng, classic pcap, btsnoop or a log of candump, each also gzip-compressed; ``-`` is standard input. told:
    who hears of interfaces and statistics. Packets of every link type come, with their ``link_type``; DALY_LINK_TYPES
    (dalycapture.linktype) says which hold our serial bytes. Memory is bounded by one block of at most 16 MiB. Raises
    CaptureError (one line) when the file is missing, no capture, or damaged, and TruncatedError after the last whole
    packet when it ends in the middle of one.
    """
    with opened(path) as source:
        yield from packets(source, told)


@contextmanager
def opened(path: Path | str) -> Generator[Source]:
    """Open a file, or standard input for ``-``. What the system refuses is a CaptureError, of one line."""
    name = "standard input" if str(path) == "-" else str(path)
    with ExitStack() as stack:
        try:
            if str(path) == "-":
                stream = cast("BufferedReader", sys.stdin.buffer)
            else:
                stream = stack.enter_context(Path(path).open("rb"))
            yield Source(stream, name)
        except FileNotFoundError:
            raise CaptureError(f"{name}: there is no such file") from None
        except IsADirectoryError:
            raise CaptureError(f"{name} is a directory; give a capture file in it") from None
        except PermissionError:
            raise CaptureError(f"{name}: no permission to read it") from None
        except OSError as error:
            raise CaptureError(f"{name}: can not be read: {reason(error)}") from None


def is_pcapng(source: Source) -> bool:
    """Tell whether a source that nothing was read of is pcapng, not compressed."""
    return source.peek(4) == _PCAPNG


def packets(source: Source, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the packets of an opened file; see ``read_capture``."""
    if source.peek(2) == _GZIP:
        try:
            with gzip.GzipFile(fileobj=source) as unpacked:  # pyright: ignore[reportArgumentType]
                yield from _plain(Source(unpacked, source.name), told)
        except EOFError:
            raise TruncatedError(f"{source.name}: cut off in the middle of its compressed data") from None
        except (gzip.BadGzipFile, zlib.error) as error:
            raise CaptureError(f"{source.name}: its compressed data is damaged: {error}") from None
    else:
        yield from _plain(source, told)


def _plain(source: Source, told: Told | None) -> Iterator[CapturedPacket]:
    magic = source.peek(4)
    if magic == _PCAPNG:
        yield from read_pcapng(source, told)
    elif magic in _PCAP:
        yield from read_pcap(source, told)
    elif source.peek(len(_BTSNOOP)) == _BTSNOOP:
        yield from read_btsnoop(source, told)
    elif candump.looks_like(source.peek(64)):
        yield from candump.read_candump(source, told)
    elif magic and any(whole.startswith(magic) for whole in (_PCAPNG, *_PCAP)):
        raise TruncatedError(f"{source.name}: cut off in the middle of its header, after {len(magic)} bytes")
    else:
        raise CaptureError(f"{source.name} {_what_else(source.peek(512))}")


def _what_else(start: bytes) -> str:
    if not start:
        return "is empty; a capture has at least a header"
    for magic, text in _OTHERS:
        if start.startswith(magic):
            return text
    if not any(byte < 0x20 and byte not in b"\t\n\v\f\r\x1b" for byte in start):
        return "is a text file, not a capture; dalyshark import makes one of a log"
    return "is not a capture file; give a pcapng or pcap file"
