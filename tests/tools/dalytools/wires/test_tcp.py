# SPDX-License-Identifier: GPL-2.0-or-later
"""TCP segments in order, whatever order they come in; packets are built by scapy (docs/wires.md, 4)."""

# scapy's functions have no types.
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import struct
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import pytest
from scapy.layers.inet import ICMP, IP, TCP
from scapy.layers.inet6 import IPv6, IPv6ExtHdrDestOpt
from scapy.layers.l2 import CookedLinux, CookedLinuxV2, Dot1Q, Ether, Loopback
from scapy.packet import Packet as Layers
from scapy.packet import Raw
from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, a5

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalyref.packet import Packet
from dalytools.cli import main
from dalytools.comparison import compare
from dalytools.tshark import Tshark
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers
from dalytools.wires.left_out import LeftOut

if TYPE_CHECKING:
    from collections.abc import Sequence

CHOICE = Choice(tcp_ports=numbers("8899"))
ETHERNET, RAW_IP, USER0 = 1, 101, 147
CLIENT, SERVER = 0, 1

Handed = tuple[int, bytes, bool]
"""Number of the packet it counts to, bytes, whether bytes before it are lost."""


def tcp(side: int, sequence: int, data: bytes, flags: str = "PA", acknowledged: int = 0) -> Layers:
    ports = (50000, 8899) if side == CLIENT else (8899, 50000)
    numbers = (sequence & 0xFFFFFFFF, acknowledged & 0xFFFFFFFF)
    return TCP(sport=ports[0], dport=ports[1], seq=numbers[0], ack=numbers[1], flags=flags) / Raw(data)


def ip(side: int, sequence: int, data: bytes, flags: str = "PA", acknowledged: int = 0) -> bytes:
    ends = ("192.0.2.10", "192.0.2.20") if side == CLIENT else ("192.0.2.20", "192.0.2.10")
    return bytes(IP(src=ends[0], dst=ends[1]) / tcp(side, sequence, data, flags, acknowledged))


def packet(number: int, data: bytes, *, ms: float | None = None, link_type: int = RAW_IP) -> Packet:
    at = EPOCH_NS + round((10 * number if ms is None else ms) * 1e6)
    return Packet(number=number, time_ns=at, data=data, link_type=link_type)


def handed(packets: Sequence[Packet]) -> list[Handed]:
    carriers = Carriers(CHOICE)
    given = [one for each in packets for one in carriers.of(each)]
    return [(one.number, one.data, one.after_gap) for one in (*given, *carriers.finish())]


def of(*segments: tuple[int, bytes]) -> list[Packet]:
    return [packet(number, ip(SERVER, *segment)) for number, segment in enumerate(segments, 1)]


@pytest.mark.parametrize("start", [1000, (1 << 32) - 7], ids=["plain", "sequence numbers begin anew"])
def test_what_comes_late_is_put_in_order_and_what_comes_again_is_dropped(start: int) -> None:
    found = handed(
        of((start, b"abcd"), (start + 8, b"ijkl"), (start + 12, b"mnop"), (start + 8, b"ijkl"), (start + 4, b"efgh"))
    )
    assert found == [(1, b"abcd", False), (5, b"efghijklmnop", False)]
    assert handed(of((start, b"abcd"), (start, b"abcd"), (start + 2, b"cdef"))) == [
        (1, b"abcd", False),
        (3, b"ef", False),
    ]
    assert handed(of((start, b"abcd"), (start + 3, b"x"), (start + 4, b"e")))[-1] == (3, b"e", False)  # keep-alive


def test_a_gap_that_stays_divides() -> None:
    assert handed(of((1000, b"abcd"), (1008, b"ijkl"), (1012, b"m"))) == [
        (1, b"abcd", False),
        (2, b"ijkl", True),
        (3, b"m", False),
    ]


@pytest.mark.parametrize("start", [1000, (1 << 32) - 7], ids=["plain", "sequence numbers begin anew"])
def test_how_long_a_gap_may_be_closed(start: int) -> None:
    """A minute, for a sender may take that long; a second, where the other side says that it has the bytes."""
    before = [*of((start, b"abcd"), (start + 8, b"ijkl"))]  # the latter at 20 ms
    late = [(1, b"abcd", False), (2, b"ijkl", True)]

    def fill(ms: float) -> Packet:
        return packet(4, ip(SERVER, start + 4, b"efgh", "A"), ms=ms)

    def has(until: int, ms: float = 500) -> Packet:
        return packet(3, ip(CLIENT, 50, b"", "A", start + until), ms=ms)

    assert handed([*before, fill(60_020)]) == [(1, b"abcd", False), (4, b"efghijkl", False)]
    assert handed([*before, packet(3, b"", ms=60_021), fill(60_022)])[:2] == late
    assert handed([*before, has(8), fill(1500)]) == [(1, b"abcd", False), (4, b"efghijkl", False)]
    assert handed([*before, has(8), fill(1501)])[:2] == late
    assert handed([*before, has(7), fill(1501)])[-1] == (4, b"efghijkl", False)  # one byte is asked for again
    earlier = [before[0], packet(2, ip(CLIENT, 50, b"", "A", start + 8)), packet(3, before[1].data, ms=30)]
    assert handed([*earlier, fill(1030)])[-1] == (4, b"efghijkl", False)
    assert handed([*earlier, fill(1031)])[1] == (3, b"ijkl", True)


def test_what_comes_after_its_gap_was_given_up_is_shown() -> None:
    """No byte that is in the capture is passed over: it was never handed over before."""
    given_up = [*of((1000, b"abcd"), (1008, b"ijkl")), packet(3, b"", ms=61_000)]
    then = [(1003, b"defghi"), (1012, b"m"), (1004, b"efgh"), (1013, b"n")]
    packets = [packet(number, ip(SERVER, *one), ms=61_000) for number, one in enumerate(then, 4)]
    assert handed([*given_up, *packets]) == [
        (1, b"abcd", False),
        (2, b"ijkl", True),
        (4, b"efgh", True),
        (5, b"m", True),  # stood behind "ijkl"
        (7, b"n", False),
    ]


def test_a_capture_may_begin_with_segments_in_the_wrong_order() -> None:
    assert handed(of((1004, b"efgh"), (1000, b"abcd"), (1008, b"ijkl"))) == [
        (1, b"efgh", False),
        (2, b"abcd", True),
        (3, b"ijkl", True),
    ]
    assert handed(of((1004, b""), (1003, b"x"), (1004, b"e"))) == [(3, b"e", False)]  # a keep-alive
    opened = [packet(1, ip(SERVER, 1003, b"", "S")), *of((0, b""), (1002, b"cdef"))[1:]]
    assert handed(opened) == [(2, b"ef", False)]  # nothing comes before a SYN


def test_of_bytes_that_come_twice_the_first_are_taken() -> None:
    segments = [(1000, b"abcd"), (1008, b"ijkl"), (1006, b"XXXXXXmn"), (1002, b"YYef"), (1006, b"gh")]
    assert handed(of(*segments)) == [(1, b"abcd", False), (4, b"efXXijklmn", False)]


def test_a_segment_without_bytes_tells_of_a_gap() -> None:
    """As many as come: they take no place of those that wait."""
    empty = [(1008, b"")] * 2000
    assert handed(of((1000, b"abcd"), *empty, (1004, b"efgh"), (1008, b"i"))) == [
        (1, b"abcd", False),
        (2002, b"efgh", False),
        (2003, b"i", False),
    ]
    assert handed(of((1000, b"abcd"), (1008, b""), (1008, b"i"))) == [(1, b"abcd", False), (3, b"i", True)]


def test_what_waits_behind_a_gap_is_bounded() -> None:
    carriers = Carriers(CHOICE)
    carriers.of(packet(1, ip(SERVER, 1000, b"a")))
    sizes = [
        sum(len(one.data) for one in carriers.of(packet(number, ip(SERVER, 2000 + 1000 * number, bytes(1000)), ms=5)))
        for number in range(2, 69)
    ]
    assert sizes == [0] * 65 + [66_000, 1000]  # 64 KiB is less than 66 segments of 1000


def test_bytes_that_the_snap_length_cut_off_are_lost() -> None:
    whole = ip(SERVER, 1004, b"efgh")
    packets = [packet(1, ip(SERVER, 1000, b"abcd")), packet(2, whole[:-2]), packet(3, ip(SERVER, 1008, b"ijkl"))]
    assert handed(packets) == [(1, b"abcd", False), (2, b"ef", False), (3, b"ijkl", True)]


def test_a_syn_with_another_number_begins_a_connection() -> None:
    carriers = Carriers(CHOICE)
    segments = [
        (CLIENT, 99, b"", "S"),
        (SERVER, 499, b"", "SA"),
        (CLIENT, 100, b"ask", "PA"),
        (CLIENT, 99, b"", "S"),  # sent again
        (SERVER, 500, b"answer", "PA"),
        (CLIENT, 7777, b"", "S"),
        (SERVER, 12, b"", "SA"),
        (SERVER, 13, b"new", "PA"),
        (CLIENT, 7778, b"", "R"),
    ]
    given = [one for number, segment in enumerate(segments, 1) for one in carriers.of(packet(number, ip(*segment)))]
    assert [(one.data, one.connection, one.direction) for one in given] == [
        (b"ask", "tcp 1", "outbound"),
        (b"answer", "tcp 1", "inbound"),
        (b"new", "tcp 2", "inbound"),
    ]


def names(packets: Sequence[bytes]) -> list[tuple[bytes, str]]:
    carriers = Carriers(CHOICE)
    given = [one for number, data in enumerate(packets, 1) for one in carriers.of(packet(number, data))]
    return [(one.data, one.connection) for one in (*given, *carriers.finish())]


def test_a_connection_begins_without_all_of_its_handshake() -> None:
    old = [ip(SERVER, 500_000, b"old")]
    assert names([*old, ip(SERVER, 12, b"", "SA"), ip(SERVER, 13, b"new")])[-1] == (b"new", "tcp 2")
    assert names([*old, ip(CLIENT, 12, b"", "S"), ip(SERVER, 99, b"", "SA"), ip(SERVER, 100, b"new")])[-1][1] == "tcp 2"
    assert names([ip(SERVER, 99, b"", "SA"), ip(CLIENT, 7, b"", "S"), ip(CLIENT, 8, b"x")]) == [(b"x", "tcp 1")]
    assert names([*old, ip(SERVER, 500_003 - 65536, b"back")])[-1] == (b"back", "tcp 1")
    assert names([*old, ip(SERVER, 500_003 - 65537, b"new")])[-1] == (b"new", "tcp 2")
    assert names([*old, ip(SERVER, 1, b"refused", "RA")]) == [(b"old", "tcp 1")]


def test_many_short_connections_do_not_end_a_long_one() -> None:
    """Who connects for each reading makes a thousand connections in a night."""
    packets = [ip(SERVER, 1000, b"a")]
    for client in range(1500):
        packets.append(bytes(IP(src="192.0.2.30") / TCP(sport=1024 + client, dport=8899, flags="S")))
        packets.append(ip(SERVER, 1001 + client, b"b"))
    assert {name for _, name in names(packets)} == {"tcp 1"}


SEGMENT = tcp(SERVER, 1, ASK)
V4, V6 = IP(src="192.0.2.20", dst="192.0.2.10"), IPv6(src="2001:db8::20", dst="2001:db8::10")
CARRIED: dict[str, tuple[int, Layers]] = {
    "Ethernet": (1, Ether() / V4 / SEGMENT),
    "Ethernet, padded": (1, Ether() / V4 / SEGMENT / Raw(b"")),
    "VLAN": (1, Ether() / Dot1Q(vlan=5) / V4 / SEGMENT),
    "IPv6": (1, Ether() / V6 / SEGMENT),
    "IPv6 with options": (1, Ether() / V6 / IPv6ExtHdrDestOpt() / SEGMENT),
    "raw IP": (101, V4 / SEGMENT),
    "raw IPv6": (101, V6 / SEGMENT),
    "loopback": (0, Loopback(type=2) / V4 / SEGMENT),
    "cooked": (113, CookedLinux(proto=0x800) / V4 / SEGMENT),
    "cooked 2": (276, CookedLinuxV2(proto=0x800) / V4 / SEGMENT),
}


@pytest.mark.parametrize("way", CARRIED)
def test_the_layers_below(way: str) -> None:
    link_type, layers = CARRIED[way]
    data = bytes(layers) + (bytes(6) if "padded" in way else b"")
    assert handed([packet(1, data, link_type=link_type)]) == [(1, ASK, False)]
    for cut in range(0, len(data), 3):  # cut off anywhere: less, never an error
        handed([packet(1, data[:cut], link_type=link_type)])


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize(
    ("family", "carries"),
    [(2, V4), (24, V6), (28, V6), (30, V6), (10, V6), (7, V4)],
    ids=["IPv4", "NetBSD", "FreeBSD", "macOS", "Linux's is none", "OSI"],
)
def test_families_of_a_loopback_interface(family: int, carries: Layers, order: Literal["little", "big"]) -> None:
    """LINKTYPE_NULL: 2 IPv4, 24, 28 and 30 IPv6, in the byte order of the machine that captured."""
    right = family in {2, 24, 28, 30}
    data = family.to_bytes(4, order) + bytes(carries / SEGMENT)
    assert handed([packet(1, data, link_type=0)]) == ([(1, ASK, False)] if right else [])
    for cut in range(len(data)):
        handed([packet(1, data[:cut], link_type=0)])


def test_other_traffic_is_left_alone() -> None:
    other = bytes(V4 / TCP(sport=8898, dport=50000, flags="PA") / Raw(ASK + (8899).to_bytes(2, "big")))
    refused = bytes(IP(src="192.0.2.1", dst="192.0.2.20") / ICMP(type=3, code=4)) + bytes(V4 / SEGMENT)  # quotes ours
    assert handed([packet(number, data) for number, data in enumerate([other, refused, b""], 1)]) == []
    assert Carriers().reads(RAW_IP) is False
    assert Carriers().of(packet(1, ip(SERVER, 1, ASK))) == ()


def test_the_order_of_the_file_is_kept() -> None:
    """A serial packet that comes while a gap is open waits for it too."""
    packets = [
        packet(1, ip(SERVER, 1000, b"abcd")),
        packet(2, ip(SERVER, 1008, b"ijkl")),
        packet(3, b"serial", link_type=USER0),
        packet(4, ip(CLIENT, 50, b"ask")),
        packet(5, ip(SERVER, 1004, b"efgh")),
        packet(6, b"more", link_type=USER0),
    ]
    assert [number for number, _, _ in handed(packets)] == [1, 3, 4, 5, 6]
    assert [number for number, _, _ in handed(packets[:4])] == [1, 2, 3, 4]
    waits = [*packets[:2], packet(3, b"serial", ms=60_021, link_type=USER0)]
    waits.append(packet(4, b"x", ms=60_022, link_type=USER0))
    carriers = Carriers(CHOICE)
    assert [[one.number for one in carriers.of(each)] for each in waits] == [[1], [], [2, 3], [4]]


def save(path: Path, segments: Sequence[bytes]) -> Path:
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("eth0", "", RAW_IP))
        for number, data in enumerate(segments, 1):
            writer.write_packet(EPOCH_NS + number * 10_000_000, data)
    path.chmod(0o644)
    return path


CELLS = [a5(1, 0x95, bytes((n, 0x0C, 0xE0 + n, 0x0C, 0xE4, 0x0C, 0xE8))) for n in range(1, 6)]
STREAM = ANSWER + b"".join(CELLS)
CUTS = {
    "in order": [(0, 13), (13, 30), (30, 78)],
    "late": [(0, 13), (30, 50), (13, 30), (50, 78)],
    "sent again": [(0, 13), (13, 30), (13, 30), (0, 13), (30, 78)],
    "again with more": [(0, 13), (13, 20), (13, 40), (40, 78)],
    "lost": [(0, 13), (13, 30), (40, 60), (60, 78)],
    "incomplete at the end": [(0, 13), (13, 30)],
    "a damaged one, and the beginning of one behind it": [(0, 13), (13, 26), (100, 114), (114, 126)],
}


@pytest.mark.parametrize("way", CUTS)
def test_both_readings_agree(way: str, tmp_path: Path) -> None:
    bad = bytearray(CELLS[0])
    bad[12] ^= 1
    stream = STREAM + bytes(22) + bytes(bad) + CELLS[1]  # the bad frame is 100 to 112
    segments = [ip(CLIENT, 7, ASK)]
    shift = 74 if way.startswith("a damaged") else 0
    segments += [ip(SERVER, 1000 + (a - shift if a >= 100 else a), stream[a:b]) for a, b in CUTS[way]]
    path = save(tmp_path / "tcp.pcapng", segments)
    with Tshark() as tshark:
        found = compare(tshark, path, wires=CHOICE)
    held = [LeftOut("tcp_records", 1)] if way in {"lost", "incomplete at the end"} else []  # bytes 26 to 29
    assert (found.differences, found.left_out, found.broken) == ([], held, "")
    frames = {"lost": 5, "incomplete at the end": 3}.get(way, 4 if shift else 7)
    assert found.kinds.get("frame") == frames
    assert found.kinds.get("bad_checksum", 0) == (1 if shift else 0)


SNAPPED = {
    # segments of the stream, with how many bytes are cut off; connections left out; frames
    "one frame": ([(0, 13, 4), (13, 26, 0)], 0, 1),
    "behind a whole one": ([(0, 26, 4), (26, 39, 0)], 0, 2),
    "all of its data": ([(0, 13, 13), (13, 26, 0)], 0, 1),
    "the last one": ([(0, 13, 0), (13, 26, 4)], 0, 1),
    "twice": ([(0, 13, 4), (13, 26, 4), (26, 78, 0)], 0, 4),
    "the second piece of a frame": ([(0, 5, 0), (5, 13, 4), (13, 26, 0)], 1, 0),
}


@pytest.mark.parametrize("way", SNAPPED)
def test_packets_that_the_snap_length_cut_off(way: str, tmp_path: Path) -> None:
    """Wireshark waits for nothing behind such a packet, so the dissector shows what is left of a frame."""
    cuts, left_out, frames = SNAPPED[way]
    path = tmp_path / "tcp.pcap"
    content = struct.pack("<IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 65535, RAW_IP)  # times in nanoseconds
    for number, (start, stop, cut) in enumerate(cuts):
        data = ip(SERVER, 1000 + start, STREAM[start:stop])
        kept = len(data) - cut
        content += struct.pack("<IIII", 1_700_000_000, number * 10_000_000, kept, len(data)) + data[:kept]
    path.write_bytes(content)
    path.chmod(0o644)
    with Tshark() as tshark:
        found = compare(tshark, path, wires=CHOICE)
    assert found.differences == []
    assert sum(one.count for one in found.left_out if one.what == "tcp_connections") == left_out
    assert found.kinds.get("frame", 0) == frames


def of_another_client(segment: bytes) -> bytes:
    """The same segment of a second connection."""
    layers = IP(segment)
    layers[TCP].sport, layers[TCP].dport = (port + 1 if port == 50000 else port for port in segment_ports(layers))
    del layers[IP].chksum, layers[TCP].chksum
    return bytes(layers)


def segment_ports(layers: Layers) -> tuple[int, int]:
    return layers[TCP].sport, layers[TCP].dport


def test_late_segments_beside_a_connection_that_lost_some_are_left_out(tmp_path: Path) -> None:
    """Wireshark has one setting for a file: with bytes lost in one place it can put segments in order in none."""
    lost = [ip(SERVER, 1000 + a, STREAM[a:b]) for a, b in CUTS["lost"]]
    late = [of_another_client(ip(SERVER, 1000 + a, STREAM[a:b])) for a, b in CUTS["late"]]
    path = save(tmp_path / "tcp.pcapng", [*lost, *late])
    with Tshark() as tshark:
        found = compare(tshark, path, wires=CHOICE)
    left_out = [LeftOut("tcp_connections", 1), LeftOut("tcp_records", 1)]  # bytes 26 to 29 of the first
    assert (found.differences, found.left_out) == ([], left_out)
    assert found.kinds["frame"] == 4  # of the first: two of its six are hit by the loss


def test_repeated_segments_beside_lost_ones(tmp_path: Path) -> None:
    """The piece of a frame comes twice: Wireshark 4.4 then shows the frame some packets late, 4.0 does not."""
    cuts = [(0, 13), (13, 30), (13, 30), (30, 39), (45, 60), (60, 78)]
    path = save(tmp_path / "tcp.pcapng", [ip(SERVER, 1000 + a, STREAM[a:b]) for a, b in cuts])
    with Tshark() as tshark:
        found = compare(tshark, path, wires=CHOICE)
        early = tshark.version.startswith("4.0.")
    assert (found.differences, found.left_out) == ([], [] if early else [LeftOut("tcp_connections", 1)])


def test_a_connection_with_late_and_lost_segments_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cuts = [(0, 13), (26, 39), (13, 26), (45, 78)]
    path = save(tmp_path / "tcp.pcapng", [ip(SERVER, 1000 + a, STREAM[a:b]) for a, b in cuts])
    assert main(["check", "--no-rules", "--tcp-ports", "8899", str(path)]) == 0
    assert "tcp.pcapng: 1 TCP connection not compared: where a capture has lost segments, " in capsys.readouterr().err
    assert main(["check", "--no-dissector", "--tcp-ports", "8880-8899", str(path)]) == 0
    assert main(["check", str(path)]) == 2
    assert "with --tcp-ports, TCP" in capsys.readouterr().err


@pytest.mark.parametrize("ports", ["", "0", "65536", "8899,", "9-8", "eighty"])
def test_ports_that_are_none(ports: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["decode", "x.pcapng", "--tcp-ports", ports])
    assert "is no list of numbers from 1 to 65535" in capsys.readouterr().err


def test_the_commands_of_the_page_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """docs/can-bluetooth.md: one exchange on three wires, and a check of them."""
    page = Path(__file__).parents[4] / "docs" / "can-bluetooth.md"
    commands = [
        line.split()[1:]
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith(("    dalyshark simulate", "    dalyshark check --tcp-ports"))
    ]
    monkeypatch.chdir(tmp_path)
    assert [main(command) for command in commands] == [0, 0, 0, 0]
    assert "3 files" in capsys.readouterr().out


def test_ports_and_handles() -> None:
    assert str(numbers("8899")) == "8899"
    assert str(numbers("4001, 0x10-0x1F")) == "4001,16-31"
    assert 31 in numbers("0x10-0x1f")
    assert 32 not in numbers("0x10-0x1f")
