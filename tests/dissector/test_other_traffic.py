# SPDX-License-Identifier: GPL-2.0-or-later
"""Traffic that is not Daly's shows no field of ours, on any wire: made by scapy and by hand, many links in a file."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from scapy.contrib.isotp import ISOTP
from scapy.contrib.modbus import ModbusADURequest, ModbusPDU03ReadHoldingRegistersRequest
from scapy.layers.dns import DNS, DNSQR, DNSRR
from scapy.layers.http import HTTP, HTTPRequest
from scapy.layers.inet import IP, TCP, UDP
from scapy.layers.l2 import ARP, Ether
from scapy.layers.ntp import NTP
from scapy.packet import Packet, Raw
from tests.dissector.can_frames import SOCKETCAN, can, canfd
from tests.dissector.dissection import EPOCH_NS, P, a5
from tests.dissector.hci_frames import H4, H4_DIRECTION, MONITOR, Radio
from tests.dissector.test_doors import ask

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from pathlib import Path

    from dalytools.tshark import Tshark

ETHERNET = 1
OURS = a5(0x40, 0x90)


def ethernet() -> list[P]:
    """DNS, HTTP, NTP, Modbus TCP to unit D2, and frames of ours where no bus is: behind other bytes, and in UDP."""
    there, back = IP(src="10.0.0.2", dst="10.0.0.9"), IP(src="10.0.0.9", dst="10.0.0.2")
    asked = DNSQR(qname="bms.example")
    read = ModbusADURequest(unitId=0xD2) / ModbusPDU03ReadHoldingRegistersRequest(startAddr=0, quantity=62)
    packets: list[Packet] = [
        ARP(pdst="10.0.0.9"),
        there / UDP(sport=5353, dport=53) / DNS(qd=asked),
        back / UDP(sport=53, dport=5353) / DNS(qr=1, qd=asked, an=DNSRR(rrname="bms.example", rdata="10.0.0.9")),
        there / UDP(sport=123, dport=123) / NTP(),
        there / TCP(sport=40000, dport=80, seq=1, flags="PA") / HTTP() / HTTPRequest(Host="bms.example"),
        there / TCP(sport=40001, dport=502, seq=1, flags="PA") / read,
        there / TCP(sport=40002, dport=4001, seq=1, flags="PA") / Raw(b"\x16\x03" + bytes.fromhex(OURS)),
        there / TCP(sport=40003, dport=23, seq=1, flags="PA") / Raw(bytes.fromhex(OURS) + b"login:"),
        there / UDP(sport=40004, dport=4001) / Raw(bytes.fromhex(OURS)),
    ]
    return [P(bytes(Ether(src="02:00:00:00:00:01", dst="02:00:00:00:00:02") / packet).hex()) for packet in packets]


def can_buses() -> list[P]:
    """CANopen, J1939, NMEA 2000, UDS in both addressings, inverters, and chance, where no frame of Daly's is."""
    frames = [
        can(0x000, "8105", flags=""),  # CANopen: reset node, heartbeat, SDO, PDO
        can(0x705, "05", flags=""),
        can(0x605, "4000100000000000", flags=""),
        can(0x585, "4300100091010f00", flags=""),
        can(0x185, "a501900802150000", flags=""),
        can(0x0CF00400, "f07d7d0000fff07d"),  # J1939: engine speed, vehicle speed, request, transport protocol
        can(0x18FEF100, "f7ffff0300ff00ff"),
        can(0x18EAFFF9, "ebfe00"),
        can(0x18ECFF00, "2014000300cafe00"),
        can(0x18EBFF00, "0100ff00ff00ff00"),
        can(0x09F80102, "ffffffffffffffff"),  # NMEA 2000
        can(0x7DF, "0201050000000000", flags=""),  # OBD, UDS, ISO-TP
        can(0x18DAF110, "0462f190ffffffff"),
        can(0x18DB33F1, "02010c0000000000"),
        can(0x18F00180, "0011223344556677"),  # inverters: Deye, Pylontech, Victron
        can(0x04000180, "0ce40ce50ce60ce7"),
        can(0x351, "4002f401f4010000", flags=""),
        can(0x00004210, "0112233445566778"),
        can(0x18904001, "00" * 8, flags="extended+error"),
        canfd(0x18900140, "00" * 16),
    ]
    frames += [can(0x7E8, bytes(part.data).hex(), flags="") for part in ISOTP(b"\x62\xf1\x90" + bytes(17)).fragment()]
    chance = random.Random(4)
    for _ in range(300):
        priority = chance.choice((0x00, 0x04, 0x0C, 0x10, 0x14, 0x1C))
        frames.append(can(priority << 24 | chance.randrange(0x400, 0xFFFFFF), chance.randbytes(8).hex()))
        frames.append(can(chance.randrange(0x800), chance.randbytes(chance.randrange(9)).hex(), flags=""))
    return frames


def bluetooth(link_type: int) -> list[P]:
    """A heart rate belt, a battery, and a serial service of another maker's that carries what could be ours."""
    made = Radio(link_type=link_type)
    made.complete()
    made.discover((0x0E, 0x2A37), (0x11, 0x2A19), (0x20, 0xFFE1))
    made.find_information((0x0F, 0x2902), (0x21, 0x2901))
    made.write(0x0F, "0100", opcode=0x12)
    for handle, value in (0x0E, "0048"), (0x11, "64"), (0x20, OURS), (0x20, b"AT+VER".hex()):
        made.notify(handle, value)
    made.write(0x20, OURS)
    made.connection += 1
    made.notify(0x11, OURS)  # a connection whose attributes nobody knows
    return made.packets


@pytest.fixture
def mixed(open_folder: Path) -> Path:
    links = [(ETHERNET, ethernet()), (SOCKETCAN, can_buses())]
    links += [(link_type, bluetooth(link_type)) for link_type in (H4_DIRECTION, H4, MONITOR)]
    path = open_folder / "mixed.pcapng"
    with open_writer(path) as writer:
        for number, (link_type, _) in enumerate(links):
            writer.add_interface(Interface(f"link{number}", "somebody's", link_type))
        at = EPOCH_NS
        for number, (_, packets) in enumerate(links):
            for packet in packets:
                writer.write_packet(at, bytes.fromhex(packet.hex), interface=number)
                at += 5_000_000
    return path


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")], ids=["one", "two", "two with a tree"])
def test_no_field_of_ours(tshark: Tshark, mixed: Path, passes: tuple[str, ...]) -> None:
    words = [*passes, "-o", "daly.heuristic:TRUE"]
    rows = ask(tshark, mixed, *words, names=["daly", "daly.kind", "frame.protocols", "frame.number"])
    assert [row[3] for row in rows if row[0] or row[1]] == []
    assert not any("daly:" in row[2] + ":" for row in rows)
    protocols = " ".join(row[2] for row in rows)
    # It is the traffic that it is meant to be.
    for name in "dns", "http", "ntp", "mbtcp", "can", "btatt", "bthci_evt":
        assert name in protocols, name


def test_the_same_with_our_traffic_in_it(tshark: Tshark, mixed: Path) -> None:
    """One interface of ours beside them changes nothing for them."""
    with open_writer(mixed.with_name("line.pcapng")) as writer:
        writer.add_interface(Interface("line", "dalyshark bus=main"))
        writer.write_packet(EPOCH_NS, bytes.fromhex(OURS))
    both = mixed.with_name("both.pcapng")
    both.write_bytes(mixed.with_name("line.pcapng").read_bytes() + mixed.read_bytes())
    rows = ask(tshark, both, "-2", names=["daly.kind", "daly.transport"])
    assert rows[0] == ["frame", "uart"]
    assert rows[1:] == [["", ""]] * (len(rows) - 1)
    assert len(rows) > 600
