# SPDX-License-Identifier: GPL-2.0-or-later
"""Link types: which ones hold serial bytes of ours, and the names of those that people meet.

Numbers are those of the public registry of link types (LINKTYPE_...), as they stand in pcap and pcapng headers.
"""

from __future__ import annotations

from dalycapture.errors import CaptureError

DEFAULT_LINK_TYPE = 147  # USER0

DALY_LINK_TYPES = frozenset(range(147, 163))
"""USER0..USER15: raw serial bytes, nothing in front."""

TAKEN_LINK_TYPE = 149  # USER2: a stock Wireshark reads it as PKTAP, so nothing of ours is written with it

_NAMES = {
    0: "BSD loopback",
    1: "Ethernet",
    101: "raw IP",
    105: "IEEE 802.11",
    113: "Linux cooked capture",
    127: "IEEE 802.11 with radiotap",
    187: "Bluetooth HCI",
    189: "Linux USB",
    195: "IEEE 802.15.4",
    201: "Bluetooth HCI with direction",
    220: "Linux USB, mmapped",
    227: "SocketCAN",
    249: "USBPcap",
    250: "RTAC serial",
    251: "Bluetooth Low Energy",
    252: "Wireshark upper PDU",
    254: "Bluetooth Linux monitor",
    256: "Bluetooth Low Energy with radio header",
    272: "nRF Sniffer for Bluetooth LE",
    276: "Linux cooked capture v2",
}


def link_type_name(link_type: int) -> str:
    """Name a link type for people: ``"147 (USER0)"``, ``"1 (Ethernet)"``, ``"999"`` where none is known."""
    name = f"USER{link_type - 147}" if link_type in DALY_LINK_TYPES else _NAMES.get(link_type)
    return f"{link_type} ({name})" if name else str(link_type)


def check_link_type(link_type: int) -> int:
    """Refuse to write link types that a stock Wireshark would not leave to our dissector. Raises CaptureError."""
    if link_type == TAKEN_LINK_TYPE:
        raise CaptureError(
            "link type 149 (USER2) is taken: Wireshark reads it as Apple's PKTAP; use 147, 148 or 150..162"
        )
    if link_type not in DALY_LINK_TYPES:
        message = f"link type {link_type_name(link_type)} is not for private use; use 147, 148 or 150..162"
        raise CaptureError(message)
    return link_type
