# SPDX-License-Identifier: GPL-2.0-or-later
"""One exchange on every wire, read back by scapy, which knows nothing of ours."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from dalycapture.reader import read_capture
from dalyref.records import Kind, Splitter
from dalytools.problem import Problem
from dalytools.simulator.bus import Bus
from dalytools.simulator.capture_file import heard, write_capture
from dalytools.simulator.scenario_file import parsed, read_scenario

if TYPE_CHECKING:
    from pathlib import Path

    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent

SCENARIO = "seed = 5\n[[board]]\n[[board]]\nnumber = 2\ncells = 8\n[[host]]\nname = 'app'\n"
SECONDS = 8.0


def spoken(scenario: Scenario, seconds: float = SECONDS) -> list[Sent]:
    return list(heard(Bus(scenario), int(seconds * 1e9)))


def packets(path: Path) -> list[bytes]:
    return [packet.data for packet in read_capture(path)]


def test_uart_is_one_packet_a_record_at_its_time(tmp_path: Path) -> None:
    scenario = parsed(SCENARIO, "x")
    written = write_capture(scenario, tmp_path / "x.pcapng", seconds=SECONDS)
    sent = spoken(scenario)
    found = list(read_capture(tmp_path / "x.pcapng"))
    assert written.packets == len(found)
    assert [packet.data for packet in found] == [piece.data for piece in sent]
    for packet, piece in zip(found, sent, strict=True):
        assert abs(packet.time_ns - scenario.start_ns - piece.time_ns) <= 2
    assert found[0].link_type == 147
    assert "bus=main 9600 8N1" in found[0].description
    assert write_capture(scenario, tmp_path / "y.pcapng", seconds=SECONDS).packets == len(found)
    assert (tmp_path / "x.pcapng").read_bytes() == (tmp_path / "y.pcapng").read_bytes()


def test_damaged_frames_are_marked_and_no_byte_is_lost(tmp_path: Path) -> None:
    scenario = read_scenario("noisy-bus")
    write_capture(scenario, tmp_path / "x.pcapng", seconds=30)
    assert b"".join(packets(tmp_path / "x.pcapng")) == b"".join(piece.data for piece in spoken(scenario, 30))


def test_can_carries_the_same_payloads(tmp_path: Path) -> None:
    from scapy.layers.can import CAN

    scenario = parsed(SCENARIO, "x")
    write_capture(scenario, tmp_path / "x.pcapng", wire="can", seconds=SECONDS)
    expected: list[tuple[int, bytes]] = []
    for piece in spoken(scenario):
        address, data_id = piece.data[1], piece.data[2]
        board = address - 0x3F if address >= 0x40 else address
        parties = (board, 0x40) if address >= 0x40 else (0x40, board)
        expected.append((0x18 << 24 | data_id << 16 | parties[0] << 8 | parties[1], piece.data[4:12]))
    assert 0x18900140 in {identifier for identifier, _ in expected}  # article: request and reply
    assert 0x18904001 in {identifier for identifier, _ in expected}
    found = [CAN(data) for data in packets(tmp_path / "x.pcapng")]
    assert [(frame.identifier, bytes(frame.data)) for frame in found] == expected
    assert {str(frame.flags) for frame in found} == {"extended"}


def test_can_has_error_frames_for_damage_no_echoes_and_foreign_frames(tmp_path: Path) -> None:
    from scapy.layers.can import CAN

    write_capture(read_scenario("noisy-bus"), tmp_path / "x.pcapng", wire="can", seconds=30)
    flags = [str(CAN(data).flags) for data in packets(tmp_path / "x.pcapng")]
    assert flags.count("error") > 5
    write_capture(parsed("[[board]]\nasleep = 'echo'", "x"), tmp_path / "x.pcapng", wire="can", seconds=5)
    assert {CAN(data).identifier & 0xFFFF for data in packets(tmp_path / "x.pcapng")} == {0x0140}
    write_capture(read_scenario("can-not-polled"), tmp_path / "x.pcapng", seconds=5)
    found = [CAN(data) for data in packets(tmp_path / "x.pcapng")]
    standard = [frame for frame in found if "extended" not in str(frame.flags)]
    assert {frame.identifier for frame in standard} == {0x351, 0x355, 0x356, 0x35E}
    assert bytes(next(frame.data for frame in standard if frame.identifier == 0x35E)) == b"LValiey\0"


def test_bluetooth_carries_the_same_bytes(tmp_path: Path) -> None:
    from scapy.layers.bluetooth import (
        ATT_Handle_Value_Notification,
        ATT_Read_By_Type_Response,
        ATT_Write_Command,
        HCI_PHDR_Hdr,
    )

    scenario = read_scenario("clean-ble")
    write_capture(scenario, tmp_path / "x.pcapng", seconds=SECONDS)
    found = [HCI_PHDR_Hdr(data) for data in packets(tmp_path / "x.pcapng")]
    (discovery,) = [packet for packet in found if ATT_Read_By_Type_Response in packet]
    assert bytes(discovery)[-14:].hex() == "0e00040f00f2ff" + "100010" + "1100f1ff"
    writes = [packet for packet in found if ATT_Write_Command in packet]
    values = [packet for packet in found if ATT_Handle_Value_Notification in packet]
    assert {(p.fields["direction"], p[ATT_Write_Command].gatt_handle) for p in writes} == {(0, 0x0F)}
    assert {(p.fields["direction"], p[ATT_Handle_Value_Notification].gatt_handle) for p in values} == {(1, 0x11)}
    sent = spoken(scenario)
    asked = [piece.data for piece in sent if not piece.sender.startswith("board")]
    assert [bytes(p[ATT_Write_Command].data) for p in writes] == asked
    chunks = [bytes(p[ATT_Handle_Value_Notification])[2:] for p in values]
    assert b"".join(chunks) == b"".join(piece.data for piece in sent if piece.sender.startswith("board"))
    assert max(map(len, chunks)) == 20


def test_tcp_carries_the_same_bytes(tmp_path: Path) -> None:
    from scapy.layers.inet import IP, TCP
    from scapy.layers.l2 import Ether

    scenario = parsed(SCENARIO, "x")
    write_capture(scenario, tmp_path / "x.pcapng", wire="tcp", seconds=SECONDS)
    found = [Ether(data) for data in packets(tmp_path / "x.pcapng")]
    assert [str(packet[TCP].flags) for packet in found[:3]] == ["S", "SA", "A"]
    assert "F" in str(found[-2][TCP].flags)
    streams = {50000: b"", 8899: b""}
    following = {50000: 1001, 8899: 5001}
    for packet in found:
        again = packet.copy()
        del again[IP].chksum, again[TCP].chksum
        assert bytes(Ether(bytes(again))) == bytes(packet)  # scapy's checksums are ours
        data = bytes(packet[TCP].payload)
        if data:
            assert packet[TCP].seq == following[packet.sport]
            following[packet.sport] += len(data)
            streams[packet.sport] += data
    sent = spoken(scenario)
    assert streams[50000] == b"".join(piece.data for piece in sent if piece.sender == "app")
    assert streams[8899] == b"".join(piece.data for piece in sent if piece.sender != "app")


def test_modbus_does_not_go_on_can(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="speaks d2, which CAN does not carry"):
        write_capture(read_scenario("clean-all-dialects"), tmp_path / "x.pcapng", wire="can")


def test_the_truth_file(tmp_path: Path) -> None:
    write_capture(read_scenario("sleeping"), tmp_path / "x.pcapng", truth=tmp_path / "x.json")
    truth = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    assert truth["story"] == "g.5"
    assert truth["counts"]["zero_reply"] == 10
    assert truth["counts"]["unanswered"] == sum(note["what"] == "unanswered" for note in truth["notes"])
    times = [note["time"] for note in truth["notes"]]
    assert times == sorted(times)
    cut = tmp_path / "cut.json"
    write_capture(read_scenario("sleeping"), tmp_path / "x.pcapng", seconds=30, truth=cut)
    lost = [note for note in json.loads(cut.read_text(encoding="utf-8"))["notes"] if note["what"] == "unanswered"]
    assert lost[-1]["open"]
    assert "open" not in lost[0]


def test_what_truth_calls_damaged_is_no_good_frame(tmp_path: Path) -> None:
    write_capture(read_scenario("noisy-bus"), tmp_path / "x.pcapng", truth=tmp_path / "x.json")
    truth = json.loads((tmp_path / "x.json").read_text(encoding="utf-8"))
    splitter = Splitter()
    records = [record for data in packets(tmp_path / "x.pcapng") for record in splitter.feed(data)] + splitter.flush()
    frames = sum(record.kind is Kind.FRAME for record in records)
    notes = [note for note in truth["notes"] if note["what"] == "damaged"]
    assert all(note["sent"] != note["heard"] for note in notes)
    inside = sum(note["sent"] in note["heard"] for note in notes)  # noise before a whole frame
    total = len(list(spoken(read_scenario("noisy-bus"), 60)))
    assert frames == total - len(notes) + inside
