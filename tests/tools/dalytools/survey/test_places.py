# SPDX-License-Identifier: GPL-2.0-or-later
"""Places on every wire: Modbus registers, HKMS registers, CAN frames that nobody knows, answers in several frames."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest
from tests.tools.dalytools.made import EPOCH_NS, a5, write

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalyref.decoder import Decoder
from dalyref.packet import Packet
from dalytools.cli import main
from dalytools.survey.survey import Survey

if TYPE_CHECKING:
    from pathlib import Path


def surveyed(capture: Path, folder: Path) -> dict[str, dict[str, Any]]:
    out = folder / "survey.json"
    assert main(["survey", str(capture), "--json", str(out)]) == 0
    return {place["name"]: place for place in json.loads(out.read_text("utf-8"))["places"]}


def crc(data: bytes) -> bytes:
    """Add the CRC of Modbus RTU: polynomial A001 (reversed), from FFFF, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return data + value.to_bytes(2, "little")


def test_each_modbus_register(tmp_path: Path) -> None:
    packets: list[tuple[float, bytes]] = []
    for poll in range(40):
        packets.append((poll, crc(bytes.fromhex("d203 0028 0003"))))
        words = (530 + poll % 7, 30000, poll)
        packets.append((poll + 0.1, crc(bytes.fromhex("d203 06") + b"".join(word.to_bytes(2) for word in words))))
    places = surveyed(write(tmp_path / "modbus.pcapng", packets), tmp_path)
    assert places["D2 request register 0028, read of 3"]["count"] == 40
    assert places["D2 reply register 0028"]["bytes"][1]["names"] == ["pack.voltage"]
    assert places["D2 reply register 0029"]["bytes"][0]["changed"] == 0
    (claim,) = places["D2 reply register 002A"]["claims"]
    assert (claim["kind"], claim["first"]) == ("counter", 1)


def test_a_text_over_registers(tmp_path: Path) -> None:
    packets: list[tuple[float, bytes]] = []
    for poll in range(3):
        packets.append((poll, crc(bytes.fromhex("d203 00e0 0005"))))
        packets.append((poll + 0.1, crc(bytes.fromhex("d203 0a") + b"K00T_3210\0")))
    (claim,) = surveyed(write(tmp_path / "text.pcapng", packets), tmp_path)["D2 reply register 00E0"]["claims"]
    assert claim["text"] == "registers 00E0 to 00E3: text: 'K00T_321'"


def can_capture(path: Path, frames: list[tuple[float, int, bytes]]) -> Path:
    """Write SocketCAN frames (time in s, 29-bit identifier, data): identifier with its top bit set, length, data."""
    with open_writer(path) as writer:
        writer.add_interface(Interface("can0", "can0", 227))
        for seconds, identifier, data in frames:
            head = (identifier | 0x80000000).to_bytes(4) + bytes((len(data), 0, 0, 0))
            writer.write_packet(EPOCH_NS + round(seconds * 1e9), head + data)
    return path


def test_can_frames_that_nobody_knows(tmp_path: Path) -> None:
    frames: list[tuple[float, int, bytes]] = []
    for poll in range(50):
        frames.append((poll, 0x18904001, bytes.fromhex("0212000075300271")))
        frames.append((poll + 0.2, 0x18FF50E5, bytes((poll, 1, 2))))
        frames.append((poll + 0.4, 0x0400FF80, bytes(8)))
        frames.append((poll + 0.5, 0x040C8001, bytes((0, poll, 0, 0, 0, 0, 0, 0))))
    places = surveyed(can_capture(tmp_path / "can.pcapng", frames), tmp_path)
    assert places["board 1 reply 0x90"]["count"] == 50
    unknown = places["CAN 18FF50E5"]
    assert (unknown["group"], unknown["count"], unknown["size"]) == ("unknown", 50, 3)
    assert [claim["kind"] for claim in unknown["claims"]] == ["counter"]
    hkms = places["board 1 reply register 040C"]
    assert (hkms["dialect"], hkms["group"], hkms["count"]) == ("hkms", "unknown", 50)


def test_a_bus_on_which_nothing_is_dalys(tmp_path: Path) -> None:
    frames = [(poll / 10, 0x18FF50E5, bytes((poll, 0))) for poll in range(30)]
    places = surveyed(can_capture(tmp_path / "other.pcapng", frames), tmp_path)
    assert {name: place["count"] for name, place in places.items()} == {"CAN 18FF50E5": 30}


@pytest.mark.parametrize("polls", [1, 20])
def test_an_unknown_id_in_several_frames(tmp_path: Path, polls: int) -> None:
    packets: list[tuple[float, bytes]] = []
    for poll in range(polls):
        packets.append((poll, a5(0x40, 0xE5)))
        packets += [(poll + 0.04 + 0.014 * page, a5(1, 0xE5, bytes((page + 1, 16 * page, 7)))) for page in range(3)]
    places = surveyed(write(tmp_path / "frames.pcapng", packets), tmp_path)
    replies = {name: place["count"] for name, place in places.items() if "reply" in name}
    assert replies == {f"board 1 reply 0xE5 frame {page}": polls for page in (1, 2, 3)}


def test_a_counter_in_byte_0_is_no_frame_number(tmp_path: Path) -> None:
    packets: list[tuple[float, bytes]] = []
    for poll in range(30):
        packets += [(poll / 20, a5(0x40, 0xE5)), (poll / 20 + 0.02, a5(1, 0xE5, bytes((poll,))))]
    places = surveyed(write(tmp_path / "fast.pcapng", packets), tmp_path)
    assert places["board 1 reply 0xE5"]["count"] == 30


def test_two_connections_are_two_buses() -> None:
    """Board 1 of the one serial server is not board 1 of the other."""
    decoder, survey = Decoder(), Survey()
    for number in range(20):
        site = number % 2 + 1
        packet = Packet(
            number + 1,
            number * 10**9,
            a5(1, 0xE0, bytes((number // 2 * site,))),
            transport="tcp",
            connection=f"tcp {site}",
            direction="inbound",
        )
        for record in decoder.feed(packet):
            survey.add(record)
    for record in decoder.finish():
        survey.add(record)
    survey.finish()
    assert {place.bus: dict(stream.moves.stepped(0)) for place, stream in survey.streams.items()} == {
        "tcp 1": {1: 9},
        "tcp 2": {2: 9},
    }


def test_places_are_bounded(tmp_path: Path) -> None:
    from dalytools.survey.survey import MOST_PLACES

    frames = [(number / 1000, 0x10000000 + number, bytes(8)) for number in range(MOST_PLACES + 50)]
    out = tmp_path / "survey.json"
    capture = can_capture(tmp_path / "many.pcapng", frames)
    assert main(["survey", str(capture), "--json", str(out)]) == 0
    document = json.loads(out.read_text("utf-8"))
    assert (len(document["places"]), document["left_out"]) == (MOST_PLACES, 50)
