# SPDX-License-Identifier: GPL-2.0-or-later
"""The check of Modbus RTU frames that are measured with."""

from __future__ import annotations


def with_crc(data: bytes) -> bytes:
    """Put Modbus' CRC-16 (polynomial A001, start FFFF) behind these bytes, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return data + crc.to_bytes(2, "little")
