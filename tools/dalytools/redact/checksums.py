# SPDX-License-Identifier: GPL-2.0-or-later
"""The checksums of IP and TCP (RFC 1071), made right again where they were right, and as wrong as before where not."""

from __future__ import annotations

import struct


def internet(data: bytes) -> int:
    """Return the checksum of some bytes: over bytes with their own in it, it is 0."""
    total = sum(struct.unpack(f">{(len(data) + 1) // 2}H", data + bytes(len(data) % 2)))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def renewed(old: bytes, new: bytes, at: int) -> int:
    """Return the checksum that stands at offset `at`, for new bytes in the place of old ones.

    One of 0 was not calculated (the network card does it), and stays.
    """
    there = int.from_bytes(old[at : at + 2])
    if not there:
        return 0
    wrong_by = there ^ _right(old, at)
    return _right(new, at) ^ wrong_by


def _right(data: bytes, at: int) -> int:
    return internet(data[:at] + bytes(2) + data[at + 2 :])
