# SPDX-License-Identifier: GPL-2.0-or-later
"""The newest payload of every place of a bus, one behind the other: so that a value is found in all of them at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterator


class HasPayload(Protocol):
    """A place, as far as it matters here."""

    index: int
    """Its number among all."""
    last: bytes
    """Its newest payload, always as long."""


Source = TypeVar("Source", bound=HasPayload)


class Newest(Generic[Source]):
    """Of one bus."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._starts: dict[int, int] = {}  # by stream
        self._whose: list[Source] = []  # by byte

    def put(self, stream: Source) -> None:
        """Take the newest payload of a place."""
        start = self._starts.get(stream.index)
        if start is None:
            start = self._starts[stream.index] = len(self._bytes)
            self._whose += [stream] * len(stream.last)
        self._bytes[start : start + len(stream.last)] = stream.last

    def count(self, value: int) -> int:
        """Return how many bytes have a value."""
        return self._bytes.count(value)

    def where(self, value: int) -> Iterator[tuple[Source, int]]:
        """Give each byte that has a value: its place, and which byte of it."""
        at = self._bytes.find(value)
        while at >= 0:
            stream = self._whose[at]
            yield stream, at - self._starts[stream.index]
            at = self._bytes.find(value, at + 1)
