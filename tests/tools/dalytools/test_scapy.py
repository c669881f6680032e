# SPDX-License-Identifier: GPL-2.0-or-later
"""The scapy layers: the papers' examples byte for byte, real frames, captures read back, replies told from others'."""

# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportMissingTypeStubs=false, reportAttributeAccessIssue=false

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from scapy.layers.can import CAN, CANFD
from scapy.packet import Packet, Raw, fuzz
from scapy.utils import rdpcap, wrpcap

from dalytools.scapy import DalyCan, DalyFrame, DalyModbus

ROOT = Path(__file__).parents[3]
REAL = [json.loads(line) for line in (ROOT / "pcap_samples/real-frames.jsonl").read_text().splitlines()]


@pytest.mark.parametrize(
    ("built", "expected"),
    [
        (DalyFrame(address=0x40, data_id=0x90), "a540900800000000000000007d"),  # V1.2, 2.3
        (DalyModbus.read(0xD2, 0x000C, 1), "d203000c000157aa"),  # the article's
        (DalyModbus.reply(0xD2, 1), "d203020001fc56"),
        (DalyModbus.write(0xD2, 0x000C, 1), "d206000c00019baa"),
        (DalyCan(data_id=0x10, destination=1, source=0x40), "9810014008000000" + "00" * 8),
        (DalyCan(data_id=0x95, destination=1, source=0x40, data=b""), "9895014000000000"),
    ],
)
def test_built_as_the_papers_have_it(built: DalyFrame | DalyModbus | DalyCan, expected: str) -> None:
    assert bytes(built).hex() == expected


@pytest.mark.parametrize("row", [row for row in REAL if row["id"] in ("tano-90-1", "cpy-91", "cpy-98", "tano-d8-1")])
def test_real_frames_come_apart_and_together(row: dict[str, str]) -> None:
    data = bytes.fromhex(row["hex"])
    frame = DalyFrame(data)
    assert (frame.start, frame.address, frame.data_id, frame.length) == tuple(data[:4])
    assert frame.data == data[4:12]
    frame.checksum = None
    assert bytes(frame) == data


def test_several_frames_in_one_packet() -> None:
    (row,) = [row for row in REAL if row["id"] == "tano-95-seq"]
    packet, numbers = DalyFrame(bytes.fromhex(row["hex"])), list[int]()
    while isinstance(packet, DalyFrame):
        numbers.append(packet.data[0])
        packet = packet.payload
    assert numbers == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("row", [row for row in REAL if row["id"].startswith(("ess-", "sys-62", "doc-"))])
def test_real_modbus_frames(row: dict[str, str]) -> None:
    data = bytes.fromhex(row["hex"])
    frame = DalyModbus(data)
    assert (frame.address, frame.function) == tuple(data[:2])
    assert frame.body == data[2:-2]
    frame.crc = None
    assert bytes(frame) == data


def test_captures_are_read_back_as_layers(tmp_path: Path) -> None:
    serial, can = str(tmp_path / "serial.pcap"), str(tmp_path / "can.pcap")
    wrpcap(serial, [DalyFrame(), DalyModbus.read(0x81, 0, 64)], linktype=147)
    wrpcap(can, [DalyCan(), CAN(identifier=0x18DAF110, flags="extended", length=1, data=b"\x00")], linktype=227)
    assert [type(packet) for packet in rdpcap(serial)] == [DalyFrame, DalyModbus]
    assert [type(packet) for packet in rdpcap(can)] == [DalyCan, CAN]


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        ("98900140", DalyCan),
        ("98904010", DalyCan),
        ("98988020", CAN),  # two hosts
        ("98902001", DalyCan),
        ("98980a80", DalyCan),
        ("98904f01", DalyCan),
        ("98905001", CAN),  # 50 is no host, nor are FF, 1F, 21 and 81
        ("9890ff01", CAN),
        ("98901f01", CAN),
        ("98902101", CAN),
        ("98900181", CAN),
        ("98904000", CAN),  # 00, 11 and 1F are no boards
        ("98904011", CAN),
        ("9890401f", CAN),
        ("98900102", CAN),  # two boards
        ("988f0140", CAN),
        ("98990140", CAN),
        ("18900140", CAN),  # not extended
        ("d8900140", CAN),  # asks for a frame (remote)
    ],
)
def test_can_identifiers(head: str, kind: type[Packet], tmp_path: Path) -> None:
    """docs/wires.md 2, first row: a board (01 to 10) and a host (20, 40 to 4F, 80), in either place."""
    capture = str(tmp_path / "can.pcap")
    wrpcap(capture, [Raw(bytes.fromhex(head + "08000000") + bytes(8))], linktype=227)
    assert [type(packet) for packet in rdpcap(capture)] == [kind]


def test_a_can_frame_of_more_than_eight_bytes_is_not_ours(tmp_path: Path) -> None:
    capture = str(tmp_path / "can.pcap")
    wrpcap(capture, [Raw(bytes.fromhex("989001400c000000") + bytes(12))], linktype=227)  # CAN FD
    assert [type(packet) for packet in rdpcap(capture)] == [CANFD]


@pytest.mark.parametrize(("layer", "largest"), [(DalyCan, 16), (DalyFrame, 13), (DalyModbus, 257)])
def test_fuzzed_layers_can_be_built(layer: type[Packet], largest: int) -> None:
    random.seed(1)
    sizes = {len(bytes(fuzz(layer()))) for _ in range(300)}
    assert max(sizes) <= largest


def test_a_read_reply_has_room_for_126_registers() -> None:
    """A byte count of 252 is the largest that both readings take (docs/records.md 2)."""
    assert len(bytes(DalyModbus.reply(0xD2, *range(126)))) == 257
    for count in (127, 128):
        with pytest.raises(ValueError, match=rf"^a reply has room for 126 registers, not {count}$"):
            DalyModbus.reply(0xD2, *range(count))


def test_what_is_no_frame_stays_raw() -> None:
    assert isinstance(DalyFrame(bytes(DalyFrame()) + b"\x11\x22").payload, Raw)


WRITE_MANY = DalyModbus(address=0xD2, function=0x10, body=bytes.fromhex("0080000102000c"))
WRITE_MANY_REPLY = DalyModbus(address=0xD2, function=0x10, body=bytes.fromhex("00800001"))
REFUSED = DalyModbus(address=0xD2, function=0x83, body=b"\x02")


@pytest.mark.parametrize(
    ("reply", "request_", "is_one"),
    [
        (DalyFrame(address=1, data_id=0x90), DalyFrame(address=0x40, data_id=0x90), True),
        (DalyFrame(address=1, data_id=0x91), DalyFrame(address=0x40, data_id=0x90), False),
        (DalyFrame(address=1, data_id=0x90), DalyFrame(address=0x41, data_id=0x90), False),  # 41 asks board 2
        (DalyFrame(address=0x40, data_id=0x90), DalyFrame(address=0x40, data_id=0x90), False),  # an echo
        (DalyModbus.reply(0x51, 7), DalyModbus.read(0x81, 0, 1), True),
        (DalyModbus.reply(0x52, 7), DalyModbus.read(0x81, 0, 1), False),
        (DalyModbus.reply(0x51, 7), DalyModbus.reply(0x51, 7), False),
        (DalyModbus.reply(0xD2, 7), DalyModbus.read(0xD2, 0, 1), True),
        (DalyModbus.read(0xD2, 0, 1), DalyModbus.read(0xD2, 0, 1), False),  # asked again
        (DalyModbus.read(0xD2, 0, 1), DalyModbus.reply(0xD2, 7), False),
        (DalyModbus.reply(0xD2, 7), DalyModbus.reply(0xD2, 7), False),
        (DalyModbus.write(0xD2, 0xA6, 1), DalyModbus.write(0xD2, 0xA6, 1), True),  # the reply is the same frame
        (WRITE_MANY_REPLY, WRITE_MANY, True),
        (WRITE_MANY, WRITE_MANY, False),
        (WRITE_MANY, WRITE_MANY_REPLY, False),
        (REFUSED, DalyModbus.read(0xD2, 0, 1), True),
        (REFUSED, REFUSED, False),
        (REFUSED, DalyModbus.write(0xD2, 0xA6, 1), False),  # of another function
        (DalyCan(destination=0x40, source=1), DalyCan(destination=1, source=0x40), True),
        (DalyCan(destination=0x40, source=2), DalyCan(destination=1, source=0x40), False),
    ],
)
def test_replies(reply: Packet, request_: Packet, is_one: bool) -> None:
    assert bool(reply.answers(request_)) is is_one
    if is_one:
        assert reply.hashret() == request_.hashret()
