# SPDX-License-Identifier: GPL-2.0-or-later
"""The bytes of a capture file, read forward only, with the offset kept for messages."""

from __future__ import annotations

from typing import Protocol


class Readable(Protocol):
    """What is needed of a file: ``read(n)`` gives n bytes, less only at its end."""

    def read(self, size: int, /) -> bytes:
        """Read up to size bytes."""
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

    def peek(self, size: int) -> bytes:
        """Look at the next bytes without taking them; less only at the end."""
        if len(self._ahead) < size:
            self._ahead += self._stream.read(size - len(self._ahead))
        return self._ahead[:size]
