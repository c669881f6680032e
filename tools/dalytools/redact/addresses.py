# SPDX-License-Identifier: GPL-2.0-or-later
"""Addresses of devices and networks, each replaced by one that says nothing: the same for the same.

    Bluetooth, Ethernet   02:00:00:00:00:01 ...        addresses of nobody
    IPv4                  192.0.2.1 ... , 198.18.0.0 ...   for documentation (RFC 5737), then for tests (RFC 2544)
    IPv6                  2001:db8::1 ...              for documentation (RFC 3849)

Those that name nobody stay: all zero, all FF (to all).
"""

from __future__ import annotations

from typing import Final

_FEW: Final = 250
_TESTS: Final = int.from_bytes(bytes((198, 18, 0, 0)))
_MOST_TESTS: Final = 1 << 17


class Addresses:
    """The addresses of one capture."""

    def __init__(self) -> None:
        self._known: dict[bytes, bytes] = {}
        self._counts: dict[int, int] = {}

    def of(self, address: bytes, *, low_first: bool = False) -> bytes:
        """Return what stands for an address of 4, 6 or 16 bytes. low_first: as Bluetooth sends it."""
        if low_first:
            return self.of(address[::-1])[::-1]
        if not address.strip(b"\x00") or not address.strip(b"\xff"):
            return address
        new = self._known.get(address)
        if new is None:
            size = len(address)
            number = self._counts[size] = self._counts.get(size, 0) + 1
            new = self._known[address] = _made(size, number)
        return new


def _made(size: int, number: int) -> bytes:
    if size == 6:
        return b"\x02" + (number % (1 << 40)).to_bytes(5)
    if size == 16:
        return b"\x20\x01\x0d\xb8" + number.to_bytes(12)
    if number <= _FEW:
        return bytes((192, 0, 2, number))
    return (_TESTS + number % _MOST_TESTS).to_bytes(4)
