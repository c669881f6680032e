# SPDX-License-Identifier: GPL-2.0-or-later
"""IP packets in fragments, cut by scapy, put together by us and by Wireshark (docs/wires.md, 4; RFC 791, 5722)."""

# scapy's functions have no types.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from scapy.layers.inet import IP, TCP, fragment
from scapy.layers.inet6 import IPv6, IPv6ExtHdrDestOpt, IPv6ExtHdrFragment, fragment6
from scapy.layers.l2 import CookedLinux, CookedLinuxV2, Dot1Q, Ether
from scapy.packet import Packet as Layers
from scapy.packet import Raw
from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, a5

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalyref.packet import Packet
from dalytools.comparison import compare
from dalytools.tshark import Tshark
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers
from dalytools.wires.fragments import MOST_BYTES, Fragments

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

CHOICE = Choice(tcp_ports=numbers("8899"))
RAW_IP = 101
DATA = bytes(range(100))


def whole(data: bytes, *, number: int = 7, sequence: int = 1000) -> Layers:
    ends = IP(src="192.0.2.20", dst="192.0.2.10", id=number)
    return ends / TCP(sport=8899, dport=50000, seq=sequence, flags="PA") / Raw(data)


def whole_6(data: bytes, *, sequence: int = 1000) -> Layers:
    ends = IPv6(src="2001:db8::20", dst="2001:db8::10") / IPv6ExtHdrFragment(id=9) / IPv6ExtHdrDestOpt()
    return ends / TCP(sport=8899, dport=50000, seq=sequence, flags="PA") / Raw(data)


def cut(layers: Layers, size: int = 40) -> list[bytes]:
    """Cut into fragments of `size` bytes, behind the IP header."""
    return [bytes(piece) for piece in fragment(layers, size)]


def handed(packets: Sequence[bytes], *, link_type: int = RAW_IP, every_ms: int = 1) -> list[tuple[int, bytes]]:
    carriers = Carriers(CHOICE)
    given: list[Packet] = []
    for number, data in enumerate(packets, 1):
        at = EPOCH_NS + number * every_ms * 1_000_000
        given += carriers.of(Packet(number=number, time_ns=at, data=data, link_type=link_type))
    return [(one.number, one.data) for one in (*given, *carriers.finish())]


PIECES = cut(whole(DATA))  # 20 bytes of TCP's header and 100 of data: 0-40, 40-80, 80-120


def test_fragments_count_to_the_packet_that_makes_them_whole() -> None:
    assert len(PIECES) == 3
    first, middle, last = PIECES
    for order in ([first, middle, last], [last, first, middle], [middle, last, first]):
        assert handed(order) == [(3, DATA)]
    assert handed([first, first, middle, middle, last, last]) == [(5, DATA)]
    assert handed([first, last]) == []


def test_fragments_of_several_packets_at_once() -> None:
    more = cut(whole(b"x" * 100, number=8, sequence=1100))
    assert handed([PIECES[0], more[0], PIECES[1], more[1], PIECES[2], more[2]]) == [(5, DATA), (6, b"x" * 100)]


def test_a_fragment_that_is_missing_is_a_gap() -> None:
    before, behind = bytes(whole(b"a", sequence=999)), bytes(whole(b"b", sequence=1100))
    carriers = Carriers(CHOICE)
    packets = [before, PIECES[0], PIECES[2], behind]
    given = [
        one for n, data in enumerate(packets, 1) for one in carriers.of(Packet(n, EPOCH_NS, data, link_type=RAW_IP))
    ]
    given += carriers.finish()
    assert [(one.number, one.data, one.after_gap) for one in given] == [(1, b"a", False), (4, b"b", True)]


@pytest.mark.parametrize("start", [32, 48], ids=["before", "behind"])
def test_what_overlaps_is_refused_with_all_that_comes_of_it(start: int) -> None:
    """RFC 5722: the whole packet is dropped, for nobody knows which of the bytes are meant."""
    first, middle, last = PIECES
    other = bytearray(middle)
    other[6:8] = (0x2000 | start // 8).to_bytes(2)
    assert handed([first, bytes(other), middle, last]) == []
    changed = middle[:-1] + b"!"
    assert handed([first, middle, changed, last]) == []
    assert handed([first, last, cut(whole(DATA + b"more"))[3], middle]) == []  # two ends


def test_fragments_are_awaited_for_a_minute() -> None:
    assert handed(PIECES, every_ms=30_000) == [(3, DATA)]
    assert handed(PIECES, every_ms=30_001) == []


def test_a_fragment_that_the_snap_length_cut_off_is_missing() -> None:
    first, middle, last = PIECES
    assert handed([first, middle[:-1], last]) == []
    assert handed([first, middle[:-1], last, middle]) == [(4, DATA)]
    for length in range(len(middle)):
        assert handed([first, last, middle[:length]]) == []


def test_version_6() -> None:
    pieces = [bytes(piece) for piece in fragment6(whole_6(DATA * 30), 1280)]
    assert len(pieces) == 3
    assert handed([pieces[2], pieces[0], pieces[1]]) == [(3, DATA * 30)]
    assert handed(pieces[:2]) == []
    for length in range(0, len(pieces[1]), 7):
        assert handed([pieces[0], pieces[2], pieces[1][:length]]) == []
    assert handed([bytes(whole_6(DATA))]) == [(1, DATA)]  # a fragment that is the whole


@pytest.mark.parametrize(
    ("link_type", "below"),
    [(1, Ether()), (1, Ether() / Dot1Q(vlan=5)), (113, CookedLinux(proto=0x800)), (276, CookedLinuxV2(proto=0x800))],
    ids=["Ethernet", "VLAN", "cooked", "cooked 2"],
)
def test_the_layers_below(link_type: int, below: Layers) -> None:
    packets = [bytes(below / IP(piece)) + bytes(4) for piece in PIECES]  # with padding
    assert handed(packets, link_type=link_type) == [(3, DATA)]


def test_what_waits_is_bounded() -> None:
    """First fragments without end: the oldest are forgotten, by number and by bytes."""
    fragments = Fragments()

    def first(number: int, size: int) -> bytes:
        return cut(whole(bytes(2 * size), number=number), size)[0]

    assert fragments.whole(PIECES[0], 0) is None
    for number in range(100, 164):
        assert fragments.whole(first(number, 40), 0) is None
    assert [fragments.whole(piece, 0) for piece in PIECES[1:]] == [None, None]
    fragments = Fragments()
    assert fragments.whole(PIECES[0], 0) is None
    for number in range(100, 100 + MOST_BYTES // 32_000):
        assert fragments.whole(first(number, 32_000), 0) is None
    assert [fragments.whole(piece, 0) is None for piece in PIECES[1:]] == [True, False]
    for number in range(100, 101 + MOST_BYTES // 32_000):
        assert fragments.whole(PIECES[0], 0) is None
        assert fragments.whole(first(number, 32_000), 0) is None


FRAMES = [ANSWER, *(a5(1, 0x95, bytes((n, 0x0C, 0xE0 + n, 0x0C, 0xE4, 0x0C, 0xE8))) for n in range(1, 6))]
STREAM = b"".join(FRAMES)


@pytest.mark.parametrize("version", [4, 6])
@pytest.mark.parametrize(
    ("kept", "frames"),
    [([0, 1, 2], 7), ([2, 0, 1], 7), ([0, 0, 1, 1, 2, 2], 7), ([0, 2], 2)],
    ids=["in order", "not in order", "twice", "one is missing"],
)
def test_wireshark_puts_the_same_together(version: int, kept: list[int], frames: int, tmp_path: Path) -> None:
    """A request, six frames of which the first four come in fragments: those of a packet that is not whole are lost."""
    ask = IP(src="192.0.2.10", dst="192.0.2.20") / TCP(sport=50000, dport=8899, seq=7, ack=1000, flags="PA") / Raw(ASK)
    cut_off, size = STREAM[:65], 32  # 20 and 65 bytes: 0-32, 32-64, 64-85
    if version == 4:
        pieces = cut(whole(cut_off), size)
        rest = bytes(whole(STREAM[65:], sequence=1065))
    else:
        layers = whole_6(cut_off)
        pieces = pieces_6(bytes(layers), size)
        rest = bytes(whole_6(STREAM[65:], sequence=1065))
    assert len(pieces) == 3
    path = tmp_path / "fragments.pcapng"
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("eth0", "", RAW_IP))
        for number, data in enumerate([bytes(ask), *(pieces[at] for at in kept), rest], 1):
            writer.write_packet(EPOCH_NS + number * 1_000_000, data)
    path.chmod(0o644)
    with Tshark() as tshark:
        found = compare(tshark, path, wires=CHOICE)
    assert (found.differences, found.left_out, found.broken) == ([], [], "")
    assert found.kinds["frame"] == frames


def pieces_6(packet: bytes, size: int) -> list[bytes]:
    """Cut by hand, for scapy cuts none below 1280 bytes: 40 of header, 8 of the fragment's, the rest."""
    rest = packet[48:]
    return [
        packet[:4]
        + (8 + len(rest[at : at + size])).to_bytes(2)
        + packet[6:42]
        + (at | (at + size < len(rest))).to_bytes(2)
        + packet[44:48]
        + rest[at : at + size]
        for at in range(0, len(rest), size)
    ]
