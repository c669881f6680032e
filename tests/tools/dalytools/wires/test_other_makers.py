# SPDX-License-Identifier: GPL-2.0-or-later
"""Other makers' devices on Daly's UUIDs, and what comes before a board's first frame (docs/wires.md, 3)."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, a5
from tests.tools.dalytools.wires.air import RECEIVED, SENT, Air, connected, data
from tests.tools.dalytools.wires.each_command import every, run

from dalyref.decoder import decode
from dalytools.cli import main
from dalytools.wires.carriers import Carriers
from dalytools.wires.left_out import LeftOut

if TYPE_CHECKING:
    from pathlib import Path

    from dalyref.decoder import Decoded
    from dalyref.packet import Packet

ELM327 = [  # bytes of an adapter for cars: reset, speed
    (SENT, b"ATZ\r"),
    (RECEIVED, b"\r\rELM327 v1.5\r\r>"),
    (SENT, b"010C\r"),
    (RECEIVED, b"41 0C 1A F8 \r\r>"),
]
JBD = [  # another maker's board: basics, over two notifications
    (SENT, bytes.fromhex("dda50300fffd77")),
    (RECEIVED, bytes.fromhex("dd03001b1700000002d003e80000207800000000")),
    (RECEIVED, bytes.fromhex("00001048030f020b760b82fbff77")),
]
MODULE = [(SENT, b"AT+VER=?\r\n"), (RECEIVED, b"+VER:1.0\r\n")]
BOARD = [(SENT, ASK), (RECEIVED, ANSWER)]
CELLS = a5(1, 0x95, bytes.fromhex("010ce40ce50ce6"))


def air(*values: tuple[int, bytes]) -> Air:
    """A connection with discovery: three packets; then a packet a value."""
    made = Air()
    made.put(RECEIVED, connected(), event=True)
    made.discover()
    speak(made, *values)
    return made


def speak(made: Air, *values: tuple[int, bytes]) -> None:
    for received, value in values:
        made.put(received, data(("1b1100" if received else "520f00") + value.hex()))


def taken(made: Air, handles: str = "") -> list[int]:
    return [number for number, _, _ in made.values(handles)]


def carried(made: Air) -> list[Packet]:
    carriers = Carriers()
    return [one for each in made.packets for one in carriers.of(each)]


def records(made: Air) -> list[Decoded]:
    return list(decode(carried(made)))


@pytest.mark.parametrize("others", [ELM327, JBD], ids=["ELM327", "JBD"])
def test_another_makers_device_is_nobodys(others: list[tuple[int, bytes]]) -> None:
    assert taken(air(*others, *others)) == []


def test_a_board_that_begins_with_its_modules_text() -> None:
    made = air(*MODULE, *BOARD, *MODULE)
    assert [(one.number, one.kind.value) for one in records(made)] == [
        (6, "frame"),
        (7, "frame"),
        (8, "foreign"),
        (9, "foreign"),
    ]


def test_either_side_begins_for_both() -> None:
    made = air((SENT, b"\x00"), (RECEIVED, b"\x01"), (RECEIVED, ANSWER), (SENT, b"\x02"))
    assert taken(made) == [6, 7]


def test_a_first_frame_over_two_notifications() -> None:
    made = air((RECEIVED, b"\xff\xff"), (RECEIVED, CELLS[:5]), (RECEIVED, CELLS[5:]))
    assert [(one.number, one.kind.value, one.data) for one in records(made)] == [(6, "frame", CELLS)]
    reply = bytes.fromhex("d2037c" + 124 * "00")  # of 62 registers, by 20 bytes; no matter that its CRC is wrong
    made = air((RECEIVED, reply[:20]), (RECEIVED, reply[20:40]))
    assert taken(made) == [4, 5]


def test_a_frame_behind_the_rest_of_another() -> None:
    """The capture begins in the midst of a burst; the rest before it, in the same value, is taken too."""
    made = air((RECEIVED, CELLS[6:] + a5(1, 0x94)))
    assert [(one.number, one.kind.value) for one in records(made)] == [(4, "junk"), (4, "frame")]


def test_a_chosen_handle_is_dalys_from_its_first_value_on() -> None:
    made = air(*MODULE, *JBD)
    assert taken(made) == []
    assert taken(made, "15") == [4, 5, 6, 7, 8]
    assert taken(made, "17") == [5, 6, 7, 8]


def test_a_new_connection_begins_anew() -> None:
    made = air(*BOARD, *JBD)
    assert len(taken(made)) == 5
    made.put(RECEIVED, connected(), event=True)
    made.discover()
    speak(made, *JBD, *BOARD)
    assert taken(made) == [4, 5, 6, 7, 8, 15, 16]


def test_a_new_discovery_does_not_begin_anew() -> None:
    made = air(*BOARD)
    made.discover()
    speak(made, *MODULE)
    assert taken(made) == [4, 5, 8, 9]


def test_connections_begin_apart() -> None:
    made = air(*BOARD)
    for body in (b"\x01", ANSWER):
        made.put(RECEIVED, data("0501" + "1100f1ff", handle=0x41))
        made.put(RECEIVED, data("1b1100" + body.hex(), handle=0x41))
    assert taken(made) == [4, 5, 9]


def test_what_is_lost_before_divides_nothing() -> None:
    """Of the values before and behind the first a piece is missing."""
    made = air()
    made.put(RECEIVED, data("1b1100" + ANSWER[:6].hex(), whole=16))
    speak(made, (RECEIVED, CELLS[:5]), (RECEIVED, CELLS[5:]))
    made.put(RECEIVED, data("1b1100" + ANSWER[:6].hex(), whole=16))
    speak(made, (RECEIVED, ANSWER))
    assert [(one.number, one.after_gap) for one in carried(made)] == [(5, False), (6, False), (8, True)]


def test_incomplete_packets_are_counted_from_the_beginning_on() -> None:
    made = air()
    lost = data("1b1100" + ANSWER[:6].hex(), whole=16)
    made.put(RECEIVED, lost)
    speak(made, (RECEIVED, ANSWER))
    made.put(RECEIVED, lost)
    made.put(RECEIVED, lost)
    speak(made, (RECEIVED, ANSWER))
    carriers = Carriers()
    for packet in made.packets:
        carriers.of(packet)
    assert carriers.left_out == [LeftOut("ble_packets", 2)]
    assert str(carriers.left_out[0]).startswith("2 Bluetooth packets left out: ")


def test_a_value_without_bytes_begins_nothing() -> None:
    made = air((RECEIVED, b""), (SENT, b"\x00"))
    assert taken(made, "17") == []


@every
def test_how_many_were_left_out_is_said(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = air(*ELM327, *BOARD, *MODULE).save(tmp_path / "ble.pcapng")
    assert run(command, path, tmp_path) == 0
    assert (
        f"{path}: 4 Bluetooth values left out: no frame of Daly's had come by then (other makers use attributes fff1, "
        "fff2, ff01 and ff02 too; --ble-handles takes an attribute from its first value on)\n"
    ) in capsys.readouterr().err
    assert run(command, air(*BOARD, *MODULE).save(tmp_path / "daly.pcapng"), tmp_path) == 0
    assert "left out" not in capsys.readouterr().err


@every
def test_a_capture_without_a_board_is_no_clean_one(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = air(*JBD).save(tmp_path / "jbd.pcapng")
    assert run(command, path, tmp_path) == 2
    said = capsys.readouterr().err
    assert (
        f"{path}: no frame of Daly's in 3 values of Bluetooth attributes fff1, fff2, ff01 and ff02, which other makers "
        "use too; if one is Daly's, say which with --ble-handles, of 15, 17\n"
    ) in said


def test_check_tells_programs(tmp_path: Path) -> None:
    path = air(*ELM327, *BOARD).save(tmp_path / "ble.pcapng")
    told, suites = tmp_path / "out.json", tmp_path / "out.xml"
    assert main(["check", "--no-rules", path, "--json", str(told), "--junit", str(suites)]) == 0
    (left_out,) = json.loads(told.read_text("utf-8"))["files"][0]["left_out"]
    assert (left_out["what"], left_out["count"]) == ("ble_values", 4)
    assert left_out["text"].startswith("4 Bluetooth values left out: ")
    (suite,) = ET.parse(suites).getroot()  # our own file
    assert [one.attrib for one in suite.iter("property")] == [{"name": "left_out.ble_values", "value": "4"}]
    assert suite.findtext("system-err", "").startswith("4 Bluetooth values left out: ")
