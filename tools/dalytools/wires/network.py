# SPDX-License-Identifier: GPL-2.0-or-later
"""From packets of a network to TCP segments, over scapy's layers: Ethernet (VLAN too), Linux cooked, raw IP, 4 and 6.

    BSD loopback (LINKTYPE_NULL)    family u32, in the byte order of the machine that captured | IP

What can't hold one of the ports is passed over before scapy looks at it, for scapy takes its time.
"""

# scapy's fields have no types that a checker could follow.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from dalytools.extra import missing
from dalytools.wires.fragments import Fragments, may_be_fragment

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalytools.wires.choice import Numbers

LINK_TYPES: Final = frozenset((0, 1, 12, 14, 101, 113, 228, 229, 276))
"""BSD loopback, Ethernet, raw IP (three numbers), Linux cooked, IPv4, IPv6, Linux cooked 2."""

SYN, RST, ACK = 0x02, 0x04, 0x10

_RAW_IP: Final = 101
_MOST_SOUGHT: Final = 64  # ports worth a search of the packet's bytes


@dataclass(frozen=True, slots=True)
class Segment:
    """One TCP segment."""

    source: tuple[str, int]
    destination: tuple[str, int]
    sequence: int
    acknowledged: int | None
    """The sequence number before which it has all bytes of the other direction; None: it does not say."""
    flags: int
    data: bytes
    missing: int
    """Bytes behind `data` that the capture cut off."""


class Network:
    """Finds the segments from and to some ports."""

    def __init__(self, ports: Numbers) -> None:
        """Raise Problem where scapy is not installed."""
        self._ports = ports
        self._layers = _layers()
        sought = ports.each() if len(ports) <= _MOST_SOUGHT else []
        words = b"|".join(re.escape(port.to_bytes(2, "big")) for port in sought)
        self._sought = re.compile(words, re.DOTALL)
        self._fragments = Fragments()

    def segment(self, link_type: int, data: bytes, time_ns: int) -> Segment | None:
        """Return the segment in a packet; None where there is none of ours, or fragments of it are missing."""
        suspect = may_be_fragment(data)
        if not suspect and not self._sought.search(data):
            return None
        layers = self._layers
        try:
            found = layers.of[link_type](data)
        except (struct.error, IndexError, ValueError):  # the lowest header is cut off
            return None
        if suspect:
            found = self._unfragmented(found, time_ns)
            if found is None:
                return None
        tcp = found.getlayer(layers.tcp)
        if tcp is None or not (tcp.sport in self._ports or tcp.dport in self._ports):
            return None
        ip, length = _under(tcp, layers)
        header = tcp.dataofs * 4
        if ip is None or header < 20:
            return None
        there: bytes = tcp.original[header:]
        return Segment(
            (str(ip.src), int(tcp.sport)),
            (str(ip.dst), int(tcp.dport)),
            int(tcp.seq),
            int(tcp.ack) if int(tcp.flags) & ACK else None,
            int(tcp.flags),
            there,
            max(0, length - len(tcp.original)) if length else 0,
        )

    def _unfragmented(self, found: Any, time_ns: int) -> Any:
        """Return a packet's layers; of fragments those of the packet that they make, None while some are missing."""
        layers = self._layers
        ip = found
        while ip is not None and not isinstance(ip, (layers.ip, layers.ipv6)):
            ip = ip.payload or None
        if ip is None or not ip.original:
            return found
        there: bytes = ip.original
        whole = self._fragments.whole(there, time_ns)
        return found if whole is there else whole and layers.of[_RAW_IP](whole)


@dataclass(frozen=True, slots=True)
class _Layers:
    """scapy's classes, and what dissects each link type as far as TCP."""

    tcp: Any
    ip: Any
    ipv6: Any
    of: dict[int, Callable[[bytes], Any]]


def _layers() -> _Layers:
    try:
        from scapy.config import conf
        from scapy.layers.inet import IP, TCP
        from scapy.layers.inet6 import IPv6
        from scapy.layers.l2 import CookedLinux, CookedLinuxV2, Ether
        from scapy.packet import Raw
    except ImportError:
        raise missing("TCP is read with", "scapy", "scapy") from None
    conf.debug_dissector = 0  # what is damaged is no reason to stop

    def by(layer: Any) -> Callable[[bytes], Any]:
        return lambda data: layer(data, stop_dissection_after=TCP)

    def raw(data: bytes) -> Any:
        return (IPv6 if data[0] >> 4 == 6 else IP)(data, stop_dissection_after=TCP)

    families = {2: IP, 24: IPv6, 28: IPv6, 30: IPv6}  # NetBSD and OpenBSD have 24, FreeBSD 28, macOS 30
    heads = {number.to_bytes(4, order): ip for number, ip in families.items() for order in ("little", "big")}

    def loopback(data: bytes) -> Any:
        """By hand: scapy takes the families of the machine that it runs on, in one byte order."""
        return heads.get(data[:4], Raw)(data[4:], stop_dissection_after=TCP)

    others = {0: loopback, 1: by(Ether), 113: by(CookedLinux), 276: by(CookedLinuxV2)}
    return _Layers(TCP, IP, IPv6, {**others, **dict.fromkeys((12, 14, 101, 228, 229), raw)})


def _under(tcp: Any, layers: _Layers) -> tuple[Any, int]:
    """Return the IP layer under a segment and the segment's length as IP tells it, 0: not told. None: a fragment."""
    below = tcp.underlayer
    while below is not None and not isinstance(below, (layers.ip, layers.ipv6)):
        if "fragment" in type(below).__name__.lower():
            return None, 0
        below = below.underlayer
    if below is None:
        return None, 0
    if isinstance(below, layers.ip):
        if below.frag or below.flags.MF:
            return None, 0
        return below, max(0, below.len - below.ihl * 4) if below.len else 0
    extensions = len(below.payload.original) - len(tcp.original)
    return below, max(0, below.plen - extensions) if below.plen else 0
