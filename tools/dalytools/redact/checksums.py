# SPDX-License-Identifier: GPL-2.0-or-later
"""The checksums of IP and TCP (RFC 1071), made right again where they were right, and wrong where they were wrong.

By how much they were wrong is not kept: a sum over what was blanked, or the difference to one, would tell of it.
"""

from __future__ import annotations

import struct
from typing import Final

_WRONG: Final = 0x5555


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
    wrong = there != _right(old, at)
    return _right(new, at) ^ (_WRONG if wrong else 0)


def _right(data: bytes, at: int) -> int:
    return internet(data[:at] + bytes(2) + data[at + 2 :])
