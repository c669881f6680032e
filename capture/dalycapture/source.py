# SPDX-License-Identifier: GPL-2.0-or-later
"""The bytes of a capture file, read forward only, with the offset kept for messages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator


class Readable(Protocol):
    """What is needed of a file: ``read(n)`` gives n bytes, less only at its end; ``readinto`` the same."""

    def read(self, size: int, /) -> bytes:
        """Read up to size bytes."""
        ...

    def readinto(self, buffer: memoryview, /) -> int:
        """Fill a buffer; return how many bytes that took."""
        ...


class Source:
    """A stream with some bytes already read from it put back in front."""

    def __init__(self, stream: Readable, name: str, ahead: bytes = b"") -> None:
        self.name = name
        self.offset = 0
        self._stream = stream
        self._ahead = ahead

    def read(self, size: int = -1, /) -> bytes:
        """Read size bytes, less only at the end."""
        if self._ahead:
            data = self._ahead[:size] if size >= 0 else self._ahead
            self._ahead = self._ahead[len(data) :]
            if len(data) < size or size < 0:
                data += self._stream.read(size - len(data) if size >= 0 else -1)
        else:
            data = self._stream.read(size)
        self.offset += len(data)
        return data

    def read_into(self, buffer: memoryview, /) -> int:
        """Fill a buffer with the next bytes; return how many there are, less only at the end."""
        ahead = self._ahead[: len(buffer)]
        self._ahead = self._ahead[len(ahead) :]
        buffer[: len(ahead)] = ahead
        size = len(ahead) + self._stream.readinto(buffer[len(ahead) :])
        self.offset += size
        return size

    def peek(self, size: int) -> bytes:
        """Look at the next bytes without taking them; less only at the end."""
        if len(self._ahead) < size:
            self._ahead += self._stream.read(size - len(self._ahead))
        return self._ahead[:size]

    def lines(self, longest: int) -> Iterator[bytes]:
        """Yield the lines that are left, with their ends; one longer than `longest` bytes in pieces of that length."""
        held = b""
        while chunk := self.read(1 << 16):
            *whole, held = (held + chunk).splitlines(keepends=True)
            if held.endswith(b"\n"):
                whole.append(held)
                held = b""
            for line in whole:
                for at in range(0, len(line), longest):
                    yield line[at : at + longest]
            while len(held) > longest:
                yield held[:longest]
                held = held[longest:]
        if held:
            yield held
