# SPDX-License-Identifier: GPL-2.0-or-later
"""Other ways in than a user link type: RTAC serial captures, TCP serial servers; and what preferences do to them."""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest
from scapy.layers.inet import IP, TCP
from scapy.layers.l2 import Ether
from scapy.packet import Packet, Raw
from scapy.utils import wrpcap
from tests.dissector.dissection import Dissect, P, a5, in_a_row, kinds, numbers
from tests.dissector.test_views import Sharkd
from tests.tools.dalytools.made import dissector

import dalytools.tshark
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

EPOCH = 1_700_000_000
REQUEST, REPLY = a5(0x40, 0x90), a5(1, 0x90, "0215000075300200")

SENT, RECEIVED, STATUS = 1, 2, 0  # RTAC event types

Rows = list[list[str]]


def ask(tshark: Tshark, path: Path, *words: str, names: Sequence[str]) -> Rows:
    path.chmod(0o644)
    wanted = [word for name in names for word in ("-e", name)]
    done = tshark.run(*words, "-r", str(path), "-T", "fields", *wanted, "-e", "_ws.lua.error")
    assert done.returncode == 0, done.stderr
    rows = [line.split("\t") for line in done.stdout.decode().splitlines()]
    assert not any(row[-1] for row in rows), rows
    return [row[:-1] for row in rows]


def rtac(folder: Path, *events: tuple[int, str, float]) -> Path:
    """A capture of link type 250: (event type, bytes as hex, time s)."""
    data = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 250)
    for kind, text, at in events:
        payload = bytes.fromhex(text)
        us = round(at * 1e6)
        header = struct.pack(">IIBBH", EPOCH, us, kind, 0, 0)
        data += struct.pack("<IIII", EPOCH + us // 1_000_000, us % 1_000_000, 12 + len(payload), 12 + len(payload))
        data += header + payload
    path = folder / "rtac.pcap"
    path.write_bytes(data)
    return path


RTAC = ("-d", "rtacser.data,daly")


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")], ids=["one", "two", "two with a tree"])
def test_rtac_serial_by_decode_as(tshark: Tshark, open_folder: Path, passes: tuple[str, ...]) -> None:
    capture = rtac(open_folder, (SENT, REQUEST, 0), (STATUS, "", 0.04), (RECEIVED, REPLY, 0.05))
    rows = ask(tshark, capture, *RTAC, *passes, names=["daly.direction", "daly.pack.voltage", "daly.request_in"])
    assert rows == [["1", "", ""], ["", "", ""], ["2", "53.3", "1"]]


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")], ids=["one", "two", "two with a tree"])
def test_rtac_directions_are_two_streams(tshark: Tshark, open_folder: Path, passes: tuple[str, ...]) -> None:
    """A reply in two pieces with a request of the other side between them: one stream would damage both."""
    capture = rtac(
        open_folder,
        (SENT, REQUEST, 0),
        (RECEIVED, REPLY[:10], 0.05),
        (SENT, a5(0x40, 0x93), 0.06),
        (RECEIVED, REPLY[10:], 0.061),
    )
    rows = ask(tshark, capture, *RTAC, *passes, names=["daly.kind", "daly.data_id", "daly.continued_in"])
    # What is held is known to be continued when it has been: in a second pass with a tree in the first.
    known = passes == ("-2", "-Y", "frame")
    assert rows[1] == (["", "", "4"] if known else ["short", "", ""])
    assert rows[:1] + rows[2:] == [["frame", "0x90", ""], ["frame", "0x93", ""], ["frame", "0x90", ""]]


def test_rtac_without_decode_as_is_left_alone(tshark: Tshark, open_folder: Path) -> None:
    assert ask(tshark, rtac(open_folder, (SENT, REQUEST, 0)), names=["daly.kind"]) == [[""]]


@dataclass
class Connection:
    """Makes the packets of a TCP connection from the client (0) and the serial server (1)."""

    folder: Path

    def __post_init__(self) -> None:
        self.packets: list[Packet] = []
        self.next = [1000, 5000]

    def send(self, side: int, text: str, *, at: int | None = None) -> int:
        """One segment; `at`: sequence number, of one that is out of order or sent again. Returns its number."""
        data = bytes.fromhex(text)
        sequence = self.next[side] if at is None else at
        ends = ("10.0.0.2", 51234), ("10.0.0.9", 4001)
        (src, sport), (dst, dport) = ends[side], ends[1 - side]
        packet = (
            Ether(src="02:00:00:00:00:01", dst="02:00:00:00:00:02")
            / IP(src=src, dst=dst)
            / TCP(sport=sport, dport=dport, seq=sequence, ack=self.next[1 - side], flags="PA")
            / Raw(data)
        )
        packet.time = EPOCH + 0.01 * len(self.packets)
        self.packets.append(packet)
        if at is None:
            self.next[side] += len(data)
        return sequence

    def save(self) -> Path:
        path = self.folder / "tcp.pcap"
        wrpcap(str(path), self.packets)
        return path


@pytest.fixture(scope="module", params=["as this Wireshark needs it", "as 4.6 needs it"])
def on_tcp(request: pytest.FixtureRequest, tshark: Tshark) -> Iterator[Tshark]:
    """The dissector as it is, and keeping bytes itself, which it does where Wireshark forgets them (from 4.6 on)."""
    if "4.6" not in request.param:
        yield tshark
        return
    keeping = r"local forgets = .*", "local forgets = true"
    with dissector(keeping) as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        with Tshark() as started:
            yield started


PORTS = ("-o", "daly.tcp_ports:4001")
WAYS = {
    "preference": PORTS,
    "range": ("-o", "daly.tcp_ports:23,4000-4010"),
    "decode as": ("-d", "tcp.port==4001,daly"),
    "heuristic": ("-o", "daly.heuristic:TRUE"),
}


@pytest.mark.parametrize("way", WAYS)
def test_tcp_serial_server(tshark: Tshark, open_folder: Path, way: str) -> None:
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    connection.send(1, REPLY)
    names = [
        "daly.transport",
        "daly.direction",
        "daly.pack.voltage",
        "daly.request_in",
        "daly.reply_in",
        "daly.response_time",
    ]
    rows = ask(tshark, connection.save(), "-2", *WAYS[way], names=names)
    assert rows == [["tcp", "1", "", "", "2", ""], ["tcp", "2", "53.3", "1", "", "0.01"]]


def test_tcp_is_left_alone_by_default(tshark: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    assert ask(tshark, connection.save(), names=["daly.kind"]) == [[""]]


@pytest.mark.parametrize(
    "other",
    ["", "474554202f20485454502f312e310d0a", REQUEST[:24], "a5" * 40, a5(0x40, 0x90)[:-2] + "00", REQUEST + "00"],
)
def test_the_heuristic_keeps_its_hands_off(tshark: Tshark, open_folder: Path, other: str) -> None:
    connection = Connection(open_folder)
    connection.send(0, other or "00")
    assert ask(tshark, connection.save(), "-o", "daly.heuristic:TRUE", names=["daly.kind"]) == [[""]]


@pytest.mark.parametrize("size", [1, 5, 12, 14, 40])
def test_tcp_frames_cut_anywhere(on_tcp: Tshark, open_folder: Path, size: int) -> None:
    connection = Connection(open_folder)
    connection.send(0, a5(0x40, 0x94) + a5(0x40, 0x95))
    answer = a5(1, 0x94, "0602") + a5(1, 0x95, "010ce40ce50ce6") + a5(1, 0x95, "020ce70ce80ce9")
    for start in range(0, len(answer), 2 * size):
        connection.send(1, answer[start : start + 2 * size])
    for passes in (), ("-2",):
        rows = ask(
            on_tcp, connection.save(), *passes, *PORTS, names=["daly.data_id", "daly.cells.voltage", "daly.kind"]
        )
        assert ",".join(row[0] for row in rows if row[0]) == "0x94,0x95,0x94,0x95,0x95"
        assert [row[1] for row in rows if row[1]] == ["3300,3301,3302,3303,3304,3305"]
        assert {kind for row in rows for kind in row[2].split(",") if kind} == {"frame"}


def test_tcp_segments_sent_again_count_once(on_tcp: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    connection.send(1, REPLY[:12])
    again = connection.send(1, REPLY[12:])
    connection.send(1, REPLY[12:], at=again)
    rows = ask(on_tcp, connection.save(), *PORTS, names=["daly.kind"])
    assert rows == [["frame"], [""], ["frame"], [""]]


@pytest.mark.parametrize("passes", [(), ("-2", "-Y", "frame")])
@pytest.mark.parametrize("cuts", [(1,), (1, 2), (1, 2, 7)])
def test_tcp_a_segment_of_one_byte_sent_again_is_not_lost(
    on_tcp: Tshark, open_folder: Path, passes: tuple[str, ...], cuts: tuple[int, ...]
) -> None:
    """Wireshark takes it for a keep-alive; 4.6 forgets the first one then (told by a first pass with a tree)."""
    connection = Connection(open_folder)
    connection.send(0, REQUEST)  # at 0
    again = connection.send(1, REPLY[:2])  # at 10 ms
    connection.send(1, REPLY[:2], at=again)
    bounds = [*(2 * cut for cut in cuts), len(REPLY)]
    for first, last in itertools.pairwise(bounds):
        connection.send(1, REPLY[first:last] + ("a540" if last == bounds[-1] else ""))
    connection.send(1, "00" + REPLY)
    names = ["daly.kind", "daly.undecoded", "daly.response_time", "daly.data"]
    rows = ask(on_tcp, connection.save(), *passes, *PORTS, names=names)
    data = REPLY[8:24]
    waiting = [["", "", "", ""] for _ in cuts]
    assert rows == [
        ["frame", "", "", "0" * 16],
        *waiting,
        ["", "", "", ""],
        ["frame", "", "0.01", data],
        ["junk,frame", "a54000", "", data],
    ]


@pytest.mark.parametrize("passes", [(), ("-2", "-Y", "frame")])
@pytest.mark.parametrize("before", [("",), (REPLY,), (REPLY[:12], REPLY[12:])])
def test_tcp_segments_are_in_order_after_a_keep_alive(
    on_tcp: Tshark, open_folder: Path, passes: tuple[str, ...], before: tuple[str, ...]
) -> None:
    """It tells the last byte again, with which we began to wait: Wireshark 4.6 forgets then what its order is."""
    connection = Connection(open_folder)
    for piece in before[:-1]:
        connection.send(1, piece)
    connection.send(1, before[-1] + REPLY[:2])
    connection.send(1, REPLY[:2], at=connection.next[1] - 1)
    connection.send(1, REPLY[2:])
    first = connection.next[1]
    connection.next[1] += 13
    connection.send(1, REPLY + REPLY[:2])
    connection.send(1, REQUEST, at=first)
    connection.send(1, REPLY[2:])
    words = (*passes, *PORTS, "-o", "tcp.reassemble_out_of_order:TRUE")
    rows = ask(on_tcp, connection.save(), *words, names=["daly.kind"])
    assert rows[len(before) :] == [[""], ["frame"], [""], ["frame,frame"], ["frame"]]


def test_tcp_what_stands_before_lost_bytes_is_not_put_before_others(on_tcp: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(1, REPLY[:2])
    connection.next[1] += 5
    connection.send(1, REPLY[12:])
    connection.send(1, REPLY)
    rows = ask(on_tcp, connection.save(), *PORTS, names=["daly.undecoded"])
    assert rows == [[""], [REPLY[12:]], [""]]


def test_tcp_segments_out_of_order(on_tcp: Tshark, open_folder: Path) -> None:
    """Wireshark puts them in order where its own preference says so."""
    connection = Connection(open_folder)
    first = connection.send(1, REPLY)
    connection.next[1] += 7
    connection.send(1, REPLY[14:])
    connection.send(1, REPLY[:14], at=first + 13)
    words = ("-2", *PORTS, "-o", "tcp.reassemble_out_of_order:TRUE")
    rows = ask(on_tcp, connection.save(), *words, names=["daly.kind", "daly.pack.voltage"])
    assert rows == [["frame", "53.3"], ["", ""], ["frame", "53.3"]]


def test_tcp_junk_between_frames_is_kept(tshark: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(1, "00ff" + REPLY + "1122" + REPLY + "33")
    rows = ask(tshark, connection.save(), *PORTS, names=["daly.kind", "daly.undecoded"])
    assert rows == [["junk,frame,junk,frame,junk", "00ff,1122,33"]]


def test_two_connections_are_two_buses(tshark: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    connection.send(1, REPLY)
    other = connection.packets[1].copy()
    other[TCP].dport = 51235
    other.time = EPOCH + 0.02
    connection.packets.append(other)
    rows = ask(tshark, connection.save(), "-2", *PORTS, names=["daly.request_in"])
    assert rows == [[""], ["1"], [""]]


def test_the_same_ends_connected_again_are_another_bus(tshark: Tshark, open_folder: Path) -> None:
    """A reply after a new SYN belongs to no request of the connection before (told by a first pass with a tree)."""
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    connection.send(0, "", at=77777)
    connection.packets[-1][TCP].flags = "S"
    connection.send(1, REPLY)
    words = ("-2", "-Y", "frame", *PORTS)
    rows = ask(tshark, connection.save(), *words, names=["daly.kind", "daly.request_in"])
    assert rows == [["frame", ""], ["", ""], ["frame", ""]]


def test_a_reply_in_pieces_began_with_its_first(on_tcp: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(0, REQUEST)  # at 0
    for start in (0, 6, 24):  # at 10, 20 and 30 ms
        connection.send(1, REPLY[start : {0: 6, 6: 24, 24: 26}[start]])
    rows = ask(on_tcp, connection.save(), "-2", *PORTS, names=["daly.response_time"])
    assert rows == [[""], [""], [""], ["0.01"]]


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")])
@pytest.mark.parametrize(("pieces", "more"), [((6,), ""), ((6, 9), ""), ((6,), a5(1, 0x91)), ((12,), ""), ((1, 3), "")])
def test_a_reply_sent_again_as_a_whole_began_with_its_first_piece(
    on_tcp: Tshark, open_folder: Path, pieces: tuple[int, ...], more: str, passes: tuple[str, ...]
) -> None:
    """A sender that waited in vain puts what it sent in pieces, and what came since, into one segment."""
    connection = Connection(open_folder)
    connection.send(0, REQUEST)  # at 0
    first = connection.next[1]
    for start, end in itertools.pairwise((0, *pieces)):  # the first at 10 ms
        connection.send(1, REPLY[2 * start : 2 * end])
    connection.send(1, REPLY + more, at=first)
    connection.next[1] = first + len(REPLY + more) // 2
    connection.send(0, REQUEST)
    connection.send(1, REPLY)
    names = ["daly.data_id", "daly.request_in", "daly.response_time"]
    words = (*passes, *PORTS, "-o", "tcp.reassemble_out_of_order:TRUE")  # else Wireshark leaves the second one out
    rows = ask(on_tcp, connection.save(), *words, names=names)
    waiting = [["", "", ""]] * len(pieces)
    again = len(pieces) + 3
    assert rows == [
        ["0x90", "", ""],
        *waiting,
        ["0x90,0x91" if more else "0x90", "1", "0.01"],
        ["0x90", "", ""],
        ["0x90", str(again), "0.01"],
    ]


def test_what_looks_like_what_is_held_but_stands_elsewhere_is_not_it(on_tcp: Tshark, open_folder: Path) -> None:
    """Half a reply, bytes that are lost, and a whole one: that began with its own packet."""
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    connection.send(1, REPLY[:12])
    connection.next[1] += 7
    connection.send(1, REPLY)
    rows = ask(on_tcp, connection.save(), "-2", "-Y", "frame", *PORTS, names=["daly.response_time"])
    assert rows[2] == ["0.02"]


def test_a_damaged_frame_whose_end_may_begin_another_is_one_piece(tshark: Tshark, open_folder: Path) -> None:
    connection = Connection(open_folder)
    connection.send(1, REPLY[:24] + "d2")  # D2 may be the first byte of a Modbus frame
    connection.send(1, REPLY)
    rows = ask(tshark, connection.save(), "-2", *PORTS, names=["daly.kind"])
    assert rows == [[""], ["bad_checksum,frame"]]


def test_a_good_frame_does_not_wait_for_its_neighbour(tshark: Tshark, open_folder: Path) -> None:
    """A frame inside which another could begin; and behind it the beginning of one that the next segment completes."""
    odd = a5(1, 0x90, "02a5010890300200")
    connection = Connection(open_folder)
    connection.send(1, odd)
    connection.send(1, odd + REPLY[:8])
    connection.send(1, REPLY[8:])
    rows = ask(tshark, connection.save(), "-2", *PORTS, names=["daly.kind"])
    assert rows == [["frame"], ["frame"], ["frame"]]


D2_READ = "d203000c000157aa"


def test_modbus_can_be_switched_off(dissect: Dissect) -> None:
    assert kinds(dissect([P(D2_READ)])) == ["frame"]
    assert kinds(dissect([P(D2_READ)], options=["daly.modbus:FALSE"])) == ["junk"]
    packets = in_a_row(REQUEST + D2_READ + REQUEST)
    assert kinds(dissect(packets, options=["daly.modbus:FALSE"])) == ["frame+junk+frame"]


def test_the_echo_time_is_a_preference(dissect: Dissect) -> None:
    packets = [P(REQUEST), P(REQUEST, 0.0542)]
    assert numbers(dissect(packets)[1], "direction") == [3]
    assert numbers(dissect(packets, options=["daly.echo:30"])[1], "direction") == [1]


def test_a_preference_changes_a_loaded_file(tshark: Tshark, open_folder: Path) -> None:
    """The file is open, the preference changes, the file is read anew: the door opens, and closes again."""
    connection = Connection(open_folder)
    connection.send(0, REQUEST)
    path = connection.save()
    path.chmod(0o644)
    server = Sharkd(tshark, path)
    try:
        assert "Daly BMS" not in str(server.tree(1))
        server.ask("setconf", name="daly.tcp_ports", value="4001")
        server.ask("load", file=str(path))
        assert "Daly BMS" in str(server.tree(1))
        server.ask("setconf", name="daly.tcp_ports", value="4002")
        server.ask("load", file=str(path))
        assert "Daly BMS" not in str(server.tree(1))
    finally:
        server.close()


def test_limits_change_on_a_loaded_file(tshark: Tshark, open_folder: Path) -> None:
    path = open_folder / "echo.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("made", "dalyshark bus=main"))
        for at in (0, 54_200_000):
            writer.write_packet(EPOCH * 1_000_000_000 + at, bytes.fromhex(REQUEST))
    path.chmod(0o644)
    server = Sharkd(tshark, path)
    try:
        assert "Direction: Echo" in str(server.tree(2))
        server.ask("setconf", name="daly.echo", value="30")
        server.ask("load", file=str(path))
        assert "Direction: Request" in str(server.tree(2))
    finally:
        server.close()
