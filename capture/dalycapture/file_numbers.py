# SPDX-License-Identifier: GPL-2.0-or-later
"""The numbers that pcapng and classic pcap are made of, for who writes such files, reads them, and repairs them.

Sources: draft-ietf-opsawg-pcapng (blocks), draft-ietf-opsawg-pcap (magic numbers).
"""

from __future__ import annotations

from typing import Final

SECTION_HEADER: Final = 0x0A0D0D0A
INTERFACE_DESCRIPTION: Final = 1
OBSOLETE_PACKET: Final = 2
SIMPLE_PACKET: Final = 3
INTERFACE_STATISTICS: Final = 5
ENHANCED_PACKET: Final = 6
NUMBERED_BLOCKS: Final = frozenset((0x9, 0x204, 0x216, 0xBAD, 0x40000BAD))
"""Blocks without a packet of ours that Wireshark shows as one: journal, system call, custom. They take a number."""

BYTE_ORDER_MAGIC: Final = 0x1A2B3C4D
MAX_BLOCK: Final = 16 << 20
"""Bytes of a block, as we take them from others."""

MICROSECONDS: Final = 0xA1B2C3D4
NANOSECONDS: Final = 0xA1B23C4D
MAX_PACKET: Final = 16 << 20
"""Bytes of a packet of classic pcap, as we take them from others."""
