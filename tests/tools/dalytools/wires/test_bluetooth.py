# SPDX-License-Identifier: GPL-2.0-or-later
"""Daly's values in HCI captures (docs/wires.md, 3)."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, a5
from tests.tools.dalytools.wires.air import (
    ENHANCED,
    ENHANCED_2,
    HANDLE,
    PLAIN,
    RECEIVED,
    SENT,
    TOLD,
    Air,
    connected,
    data,
    long_form,
)

from dalyref.decoder import decode
from dalyref.packet import Packet
from dalytools.cli import main
from dalytools.problem import Problem
from dalytools.wires.bluetooth import HCI, HCI_WITH_DIRECTION, LINUX_MONITOR
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


@pytest.mark.parametrize("link_type", [HCI, HCI_WITH_DIRECTION, LINUX_MONITOR])
@pytest.mark.parametrize(
    "told",
    [
        TOLD,
        "0907" + "0e00040f0002ff" + "1000101100 01ff",
        "0915" + "0e00040f00" + long_form("fff2") + "1000101100" + long_form("fff1"),
        "0501" + "0f00f2ff" + "1100f1ff",
        "0502" + "0f00" + long_form("fff2") + "1100" + long_form("fff1"),
    ],
    ids=["fff1 and fff2", "ff01 and ff02", "long form", "find information", "find information, long form"],
)
def test_attributes_are_known_by_discovery(link_type: int, told: str) -> None:
    air = Air(link_type)
    air.put(RECEIVED, connected(), event=True)
    air.discover(told)
    air.speak()
    assert air.values() == [(4, "outbound", ASK), (5, "inbound", ANSWER)]


@pytest.mark.parametrize(
    "told",
    [
        "0907" + "0e00040f00192a" + "1000101100002a",  # other characteristics
        "0915" + "0e00040f00" + "f2ff" + "11" * 14 + "1000101100" + "f1ff" + "22" * 14,  # UUIDs of somebody's own
        "0915" + "0e00040f00" + "f2ff" + "00" * 14 + "1000101100" + "f1ff" + "00" * 14,  # and these have no short form
        "0502" + "0f00" + "f2ff" + "00" * 14 + "1100" + "f1ff" + "00" * 14,
    ],
)
def test_other_devices_are_left_alone(told: str) -> None:
    air = Air()
    air.speak()
    air.discover(told)
    air.speak()
    assert air.values() == []


def test_only_answers_about_characteristics_tell() -> None:
    air = Air()
    air.put(SENT, data("080100ffff002a"))  # reads device names
    air.put(RECEIVED, data(TOLD))
    air.speak()
    assert air.values() == []


@pytest.mark.parametrize(("asked", "known"), [("2803", True), ("2a00", False)])
def test_what_is_asked_for_may_stand_in_its_long_form(asked: str, known: bool) -> None:
    air = Air()
    air.put(SENT, data("080100ffff" + long_form(asked)))
    air.put(RECEIVED, data(TOLD))
    air.speak()
    assert air.values() == ([(3, "outbound", ASK), (4, "inbound", ANSWER)] if known else [])


def test_attributes_are_known_by_their_handles() -> None:
    air = Air()
    air.speak()
    air.put(SENT, data("120f00" + ASK.hex()))  # a write with answer
    air.put(RECEIVED, data("1d1100" + ANSWER.hex()))  # an indication
    air.put(RECEIVED, data("1b1200" + ANSWER.hex()))
    assert [number for number, _, _ in air.values("0x0f,17")] == [1, 2, 3, 4]
    assert [number for number, _, _ in air.values("17")] == [2, 4]


@pytest.mark.parametrize("link_type", [HCI, HCI_WITH_DIRECTION, LINUX_MONITOR])
def test_where_the_host_is_somebodys_device_itself_it_is_no_board(link_type: int) -> None:
    air = Air(link_type)
    air.put(RECEIVED, connected(), event=True)
    air.discover()
    air.put(RECEIVED, data("520f00" + ASK.hex()))
    air.put(SENT, data("1b1100" + ANSWER.hex()))
    assert air.values() == air.values("15,17") == []
    air.speak()
    assert air.values() == air.values("15,17") == [(6, "outbound", ASK), (7, "inbound", ANSWER)]


def test_where_no_direction_is_told_the_opcode_tells_it() -> None:
    air = Air(HCI)
    air.discover()
    air.speak()
    air.packets = [replace(packet, direction="") for packet in air.packets]
    assert air.values() == [(3, "outbound", ASK), (4, "inbound", ANSWER)]


@pytest.mark.parametrize("subevent", [PLAIN, ENHANCED, ENHANCED_2])
@pytest.mark.parametrize("link_type", [HCI, HCI_WITH_DIRECTION, LINUX_MONITOR])
def test_a_new_connection_forgets(link_type: int, subevent: int) -> None:
    air = Air(link_type)
    air.discover()
    air.put(RECEIVED, connected(0x41, subevent=subevent), event=True)
    air.put(RECEIVED, connected(subevent=subevent, status=0x3E), event=True)  # failed
    air.put(RECEIVED, connected(subevent=subevent)[:5], event=True)  # cut off in its handle
    air.speak()
    air.put(RECEIVED, connected(subevent=subevent), event=True)
    air.speak()
    assert [number for number, _, _ in air.values()] == [6, 7]


def test_a_new_connection_over_classic_bluetooth_forgets_too() -> None:
    air = Air()
    air.discover()
    failed, begun = (bytes((0x03, 11, status, HANDLE, 0)) + bytes(8) for status in (0x04, 0))
    air.put(RECEIVED, failed, event=True)
    air.speak()
    air.put(RECEIVED, begun, event=True)
    air.speak()
    assert [number for number, _, _ in air.values()] == [4, 5]


def test_adapters_are_apart() -> None:
    air = Air(LINUX_MONITOR)
    air.discover(adapter=1)
    air.speak(adapter=0)
    air.speak(adapter=1)
    assert [number for number, _, _ in air.values()] == [5, 6]


def test_data_packets_are_put_together() -> None:
    air = Air()
    pdu = "1b1100" + ANSWER.hex()
    air.put(RECEIVED, data(pdu[:10], whole=16))
    air.put(SENT, data("520f00" + ASK.hex()))
    air.put(RECEIVED, data(pdu[10:20], first=False))
    air.put(RECEIVED, data(pdu[20:], first=False))
    air.put(RECEIVED, data(pdu[20:], first=False))  # nothing was begun
    air.put(RECEIVED, data(pdu[:10], whole=16))
    air.put(RECEIVED, data(pdu))  # begins anew
    assert air.values("15,17") == [(2, "outbound", ASK), (4, "inbound", ANSWER), (7, "inbound", ANSWER)]


def test_a_frame_over_several_notifications_and_several_in_one() -> None:
    air = Air()
    air.discover()
    cells = a5(1, 0x95, bytes.fromhex("010ce40ce50ce6")) + a5(1, 0x95, bytes.fromhex("020ce70ce80ce9"))
    counts = a5(1, 0x94, b"\x06\x02")
    stream = counts + cells
    air.put(SENT, data("520f00" + (a5(0x40, 0x94) + a5(0x40, 0x95)).hex()), at_ms=100)
    air.put(RECEIVED, data("1b1100" + stream[:20].hex()), at_ms=150)
    air.put(RECEIVED, data("1b1100" + stream[20:].hex()), at_ms=2000)  # silence divides nothing
    carriers = Carriers()
    records = list(decode(one for each in air.packets for one in carriers.of(each)))
    assert [(record.number, record.kind.value) for record in records] == [
        (number, "frame") for number in (3, 3, 4, 5, 5)
    ]
    assert records[2].fields["daly.response_time"] == pytest.approx(0.05)
    assert records[4].fields["daly.cells.voltage"] == [3300, 3301, 3302, 3303, 3304, 3305]
    assert [record.fields["daly.transport"] for record in records] == ["ble"] * 5


def test_the_modules_own_text_is_named() -> None:
    air = Air()
    air.discover()
    air.speak()
    air.put(SENT, data("520f00" + b"AT+VER=?\r\n".hex()))
    air.put(RECEIVED, data("1b1100" + b"+VER:1.0\r\n".hex()))
    carriers = Carriers()
    records = list(decode(one for each in air.packets for one in carriers.of(each)))
    assert [record.fields["daly.foreign"] for record in records[2:]] == ["Bluetooth module"] * 2


def test_cut_off_and_damaged_packets_are_no_error() -> None:
    air = Air()
    air.put(RECEIVED, connected(), event=True)
    air.discover()
    air.speak()
    whole: Sequence[Packet] = air.packets
    for each in whole:
        for cut in range(len(each.data)):
            for flipped in (0x00, 0xFF):
                piece = each.data[:cut] + bytes((flipped,)) + each.data[cut + 1 :]
                carriers = Carriers()
                for one in (*whole, Packet(number=9, time_ns=0, data=piece, link_type=each.link_type), *whole):
                    carriers.of(one)
                carriers.of(Packet(number=9, time_ns=0, data=each.data[:cut], link_type=each.link_type))


@pytest.mark.parametrize("told", ["050111", "05010f00f2", "05020f00f2", "0904", "0907" + "0e", "0902" + "0e000f"])
def test_discoveries_that_end_in_a_part_of_an_entry_are_no_error(told: str) -> None:
    air = Air()
    air.discover(told)
    air.discover()
    air.speak()
    assert air.values() == [(5, "outbound", ASK), (6, "inbound", ANSWER)]


def test_a_part_of_an_entry_hides_no_whole_one() -> None:
    air = Air()
    air.discover("0501" + "0f00f2ff" + "1100f1ff" + "1200f1")
    air.speak()
    assert air.values() == [(3, "outbound", ASK), (4, "inbound", ANSWER)]


def test_without_scapy_it_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "scapy.layers.bluetooth", None)
    monkeypatch.setitem(sys.modules, "scapy.layers", None)
    air = Air()
    air.discover()
    with pytest.raises(
        Problem, match=r"^Bluetooth is read with the package scapy: type .* -m pip install .*\[scapy\]'$"
    ):
        air.values()


def test_the_simulators_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "ble.pcapng")
    assert main(["simulate", "clean-ble", "-w", path, "--duration", "5"]) == 0
    capsys.readouterr()
    assert main(["decode", path]) == 0
    shown = capsys.readouterr().out
    assert "= 16 cells" in shown
    assert "unanswered" not in shown
    assert main(["check", "--no-dissector", path]) == 0
