# SPDX-License-Identifier: GPL-2.0-or-later
"""``tshark -q -z daly,stat``, ``daly,cells`` and ``daly,faults``: numbers counted by hand, and by the reference."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.dissector.can_frames import SOCKETCAN, hkms, keep_alive, reply, request
from tests.dissector.dissection import EPOCH_NS, P, a5
from tests.traffic import with_crc

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalyref.decoder import decode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.tshark import Tshark

SAMPLES = sorted(Path(__file__).resolve().parents[2].joinpath("pcap_samples").glob("*.pcap*"))
CHARACTER_S = 10 / 9600
FRAME_S = 13 * CHARACTER_S
ASK, ANSWER = a5(0x40, 0x90), a5(1, 0x90, "0215000075300200")


def crc(text: str) -> str:
    return with_crc(bytes.fromhex(text)).hex()


def capture(tshark: Tshark, packets: Sequence[P], buses: Sequence[str] = ("main",)) -> Path:
    path = tshark.home / "statistics.pcapng"
    with open_writer(path) as writer:
        for bus in buses:
            writer.add_interface(Interface("made", f"dalyshark bus={bus}"))
        for packet in packets:
            data = bytes.fromhex(packet.hex)
            writer.write_packet(EPOCH_NS + round(packet.at * 1e9), data, interface=packet.interface)
    path.chmod(0o644)
    return path


def ask(tshark: Tshark, path: Path, *reports: str, passes: Sequence[str] = ()) -> str:
    words = [word for report in reports for word in ("-z", report)]
    done = tshark.run(*passes, "-q", "-o", "daly.link_types:147,148,150-162", "-r", str(path), *words)
    assert done.returncode == 0, done.stderr
    assert b"Lua" not in done.stderr, done.stderr
    return done.stdout.decode()


def rows(text: str) -> dict[tuple[str, str], list[str]]:
    """The lines of daly,stat: (board, ID) -> columns behind the name."""
    found: dict[tuple[str, str], list[str]] = {}
    for line in text.splitlines():
        if line[6:8] == "0x":
            found[line[:5].strip(), line[6:10]] = line[30:].split()
    return found


SESSION = [
    P(ASK, 0),  # answered after 50 ms
    P(ANSWER, FRAME_S + 0.050),
    P(ASK, 1),  # echo
    P(ASK, 1.02),
    P(ASK, 1.5),  # again; answered after 100 ms
    P(ANSWER, 1.5 + FRAME_S + 0.1),
    P(a5(0x80, 0x93), 2),  # nobody answers
    P(ANSWER[:-2] + "00", 4),
    P("00ff", 5),
    P("", 6),
]


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")], ids=["one", "two", "two with a tree"])
def test_requests_and_replies(tshark: Tshark, passes: tuple[str, ...]) -> None:
    text = ask(tshark, capture(tshark, SESSION), "daly,stat", passes=passes)
    assert "10 records: 8 frames" not in text
    assert "10 records: 7 frames, 1 with a bad checksum, 1 junk, 1 events; 106 bytes in 6.000 s" in text
    assert "boards that answer: 1\n" in text
    #       requests replies no rep again echo damage min mean 95 % max
    assert rows(text) == {
        ("1", "0x90"): ["3", "2", "1", "1", "1", "1", "50.0", "75.0", "100.0", "100.0"],
        ("any", "0x93"): ["1", "0", "1", "0", "0", "0"],
    }


def test_unknown_ids_are_counted(tshark: Tshark) -> None:
    packets = [P(a5(0x40, 0xAB), 0), P(a5(1, 0xAB), 0.05), P(a5(1, 0x0F), 1), P(a5(1, 0x90), 2)]
    text = ask(tshark, capture(tshark, packets), "daly,stat")
    assert "\nframes with an unknown data ID: 0x0F (1), 0xAB (2)\n" in text


def modbus_rows(text: str) -> dict[tuple[str, str], list[str]]:
    """The lines of Modbus: (board, "dialect function word registers") -> columns behind the name."""
    lines = [line for line in text.splitlines() if line[6:9] in ("d2 ", "81 ")]
    return {(line[:5].strip(), line[6:29].strip()): line[30:].split() for line in lines}


def test_modbus(tshark: Tshark) -> None:
    """Answered after 40 ms, refused after 20 ms, unanswered; a reply to none; a write and its reply; board 2 of the
    other dialect."""
    asked, reply = crc("d20300000002"), crc("d20304000a000b")
    packets = [
        P(asked, 0),
        P(reply, 8 * CHARACTER_S + 0.040),
        P(asked, 2),
        P(crc("d28302"), 2 + 8 * CHARACTER_S + 0.020),
        P(asked, 4),
        P(crc("d203020001"), 6),
        P(crc("d20600a50001"), 8),
        P(crc("d20600a50001"), 8 + 8 * CHARACTER_S + 0.030),
        P(crc("820301000003"), 10),
        P(crc("520306000100020003"), 10 + 8 * CHARACTER_S + 0.010),
        P(crc("81100100000200010002"), 12),
        P(asked, 14),  # nothing is known of the last
    ]
    for passes in (), ("-2",):
        text = ask(tshark, capture(tshark, packets), "daly,stat", passes=passes)
        #              requests replies no rep refuse min mean 95 % max
        assert modbus_rows(text) == {
            ("D2", "d2 03 read 0000-0001"): ["4", "2", "1", "1", "20.0", "30.0", "40.0", "40.0"],
            ("D2", "d2 03 read ? (1)"): ["0", "1", "0", "0"],
            ("D2", "d2 06 write 00A5"): ["1", "1", "0", "0", "30.0", "30.0", "30.0", "30.0"],
            ("2", "81 03 read 0100-0102"): ["1", "1", "0", "0", "10.0", "10.0", "10.0", "10.0"],
            ("1", "81 10 write 0100-0101"): ["1", "0", "1", "0"],
        }
        assert "\nexception codes: 0x02 (1)\n" in text
        assert "boards that answer: 2\n" in text
        assert "data ID" not in text


def test_can(tshark: Tshark) -> None:
    """Classic frames as on a line; HKMS by register."""
    frames = [
        request(0x90),
        reply(0x90, "0215000075300230", at=0.025),
        keep_alive(1.0),
        hkms(0x0402, "0215753002300000", at=1.1),
        hkms(0x0402, "0215753002300000", at=1.2),
        hkms(0x0400, "010ce40ce50ce600", at=1.3),
    ]
    path = tshark.home / "statistics-can.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("made", "can0", SOCKETCAN))
        for frame in frames:
            writer.write_packet(EPOCH_NS + round(frame.at * 1e9), bytes.fromhex(frame.hex))
    path.chmod(0o644)
    text = ask(tshark, path, "daly,stat")
    assert "6 records: 6 frames; 48 bytes in 1.300 s" in text
    assert rows(text)["1", "0x90"] == ["1", "1", "0", "0", "0", "0", "25.0", "25.0", "25.0", "25.0"]
    said = [" ".join(line.split()) for line in text.splitlines()]
    at = said.index("board HKMS register frames")
    assert said[at + 1 : at + 4] == ["any keep-alive 1", "1 0x0400 Cell voltages 1", "1 0x0402 Pack 2"]


def test_a_filter_picks_packets(tshark: Tshark) -> None:
    text = ask(tshark, capture(tshark, SESSION), "daly,stat,daly.data_id == 0x93")
    assert rows(text) == {("any", "0x93"): ["1", "0", "1", "0", "0", "0"]}
    assert "filter: daly.data_id == 0x93" in text


@pytest.mark.parametrize(
    ("report", "reason"),
    [
        ("daly,stat,daly.nosuch == 1", "daly.nosuch"),
        ("daly,cells,daly.board ==", "daly.board =="),
        ("daly,faultsx", "it is daly,faults, or daly,faults,FILTER"),
    ],
)
def test_what_can_not_be_used_is_said(tshark: Tshark, report: str, reason: str) -> None:
    """As of Wireshark's own statistics: a line, and exit status 1."""
    done = tshark.run("-q", "-z", report, "-r", str(capture(tshark, SESSION)))
    said = [line for line in done.stderr.decode().splitlines() if line.startswith("-z ")]
    assert done.returncode == 1
    assert len(said) == 1
    assert reason in said[0]
    assert done.stdout == b""


def test_the_time_is_from_the_earliest_to_the_latest(tshark: Tshark) -> None:
    packets = [P(ASK, 5), P(ANSWER, 5.1), P(ASK, 1), P(ANSWER, 1.1)]
    assert "52 bytes in 4.100 s" in ask(tshark, capture(tshark, packets), "daly,stat")


def test_boards_of_two_buses_have_their_own_faults(tshark: Tshark) -> None:
    """Both are board 1; that of the one has a fault until its third reply, the other never."""
    packets = [
        P(a5(1, 0x98, "01" if bus == 0 and poll < 2 else "00"), poll + bus / 2, bus)
        for poll in range(4)
        for bus in (0, 1)
    ]
    text = ask(tshark, capture(tshark, packets, ("one", "two")), "daly,faults")
    told = [line.split() for line in text.splitlines() if "cell_volt" in line]
    assert [(words[1], words[3]) for words in told] == [("1", "already"), ("5", "cleared")]
    assert "after 2.000 s" in text
    assert text.count("Board 1, after 4 replies to 0x98: none") == 2
    assert "2 buses" in text
    assert "buses" not in ask(tshark, capture(tshark, packets, ("one", "one")), "daly,faults")


def test_several_at_once(tshark: Tshark) -> None:
    path = capture(tshark, SESSION)
    both = ask(tshark, path, "daly,stat", "daly,faults", "daly,stat,daly.retry")
    assert both.count("10 records") == 1
    assert "No 0x98 was seen." in both
    assert "1 records: 1 frames" in both


@pytest.mark.parametrize("report", ["stat", "cells", "faults"])
def test_an_empty_capture_says_so(tshark: Tshark, report: str) -> None:
    assert "No " in ask(tshark, capture(tshark, []), f"daly,{report}")


def test_several_records_in_a_packet(tshark: Tshark) -> None:
    text = ask(tshark, capture(tshark, [P(ASK + ANSWER, 0), P(ASK + ANSWER, 1)]), "daly,stat")
    assert rows(text)["1", "0x90"][:2] == ["2", "2"]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.stem)
def test_the_reference_counts_the_same(tshark: Tshark, sample: Path) -> None:
    text = ask(tshark, tshark.readable(sample), "daly,stat")
    found = rows(text)
    requests, replies, missing, again, echoes, damaged = (Counter[tuple[str, str]]() for _ in range(6))
    modbus = {name: Counter[tuple[str, str]]() for name in ("request", "reply", "no reply", "refused")}
    for record in decode(read_capture(sample)):
        fields = record.fields
        if fields.get("daly.dialect") in ("d2", "81") and record.kind.value == "frame":
            key = str(fields.get("daly.board", "D2")), f"{int(str(fields['daly.modbus.function'])) & 0x7F:02X}"
            modbus["request"][key] += fields["daly.direction"] == 1
            modbus["reply"][key] += fields["daly.direction"] == 2
            modbus["no reply"][key] += "daly.unanswered" in fields
            modbus["refused"][key] += "daly.modbus.exception" in fields
        if fields.get("daly.dialect") != "a5" or record.kind.value not in ("frame", "bad_checksum"):
            continue
        address = int(str(fields["daly.address"]))
        board = address if 1 <= address <= 16 else address - 0x3F if 0x40 <= address <= 0x4F else 0
        key = str(board) if board else "any", f"0x{int(str(fields['daly.data_id'])):02X}"
        direction = fields.get("daly.direction")
        damaged[key] += direction is None
        requests[key] += direction == 1
        replies[key] += direction == 2
        echoes[key] += direction == 3
        again[key] += "daly.retry" in fields
        missing[key] += "daly.unanswered" in fields
    assert {key: [int(word) for word in words[:6]] for key, words in found.items()} == {
        key: [count[key] for count in (requests, replies, missing, again, echoes, damaged)] for key in requests
    }
    summed = {name: Counter[tuple[str, str]]() for name in modbus}
    for (board, name), columns in modbus_rows(text).items():
        for what, column in zip(summed, columns, strict=False):
            summed[what][board, name[3:5]] += int(column)
    assert summed == modbus


def test_cells_and_sensors(tshark: Tshark) -> None:
    def table(*mv: int) -> str:
        return a5(1, 0x95, "01" + "".join(f"{v:04x}" for v in mv))

    packets = [
        P(a5(1, 0x94, "0303"), 0),
        P(table(3300, 3310, 3320), 1),
        P(a5(1, 0x96, "013c00ff"), 2),  # 20 C, two that are not there
        P(table(3302, 3310, 3298), 3),
    ]
    text = ask(tshark, capture(tshark, packets), "daly,cells")
    lines = [line.split() for line in text.splitlines()]
    assert ["1", "2", "3300", "3301.0", "3302", "3302", "1", "x", "0", "x"] in lines
    assert ["2", "2", "3310", "3310.0", "3310", "3310", "0", "x", "1", "x"] in lines
    assert ["3", "2", "3298", "3309.0", "3320", "3298", "1", "x", "1", "x"] in lines
    assert ["spread", "2", "12", "16.0", "20", "12"] in lines
    assert ["1", "1", "20", "20.0", "20", "20", "1", "x", "1", "x"] in lines


def test_cells_of_modbus(tshark: Tshark) -> None:
    """Two reads of 64 registers: four cells and one sensor, at 3C and 3D; the second time each cell 10 mV higher."""
    packets: list[P] = []
    for dialect, ask_to, reply_from, cells_at, sensors_at, counts_at in (
        ("81", "81", "51", 0x00, 0x30, 0x3C),
        ("d2", "d2", "d2", 0x00, 0x20, 0x31),
    ):
        for poll, higher in enumerate((0, 10)):
            values = [0] * 64
            values[cells_at : cells_at + 4] = [3301 + higher, 3302 + higher, 3303 + higher, 3304 + higher]
            values[sensors_at], values[counts_at : counts_at + 2] = 61, [4, 1]
            at = poll + (10 if dialect == "d2" else 0)
            packets.append(P(crc(f"{ask_to} 03 0000 0040"), at))
            packets.append(P(crc(f"{reply_from} 03 80" + "".join(f"{value:04x}" for value in values)), at + 0.1))
    text = ask(tshark, capture(tshark, packets), "daly,cells")
    one, d2 = text.split("D2 (names no board)")
    assert "Board 1" in one
    for part in (one, d2):
        lines = [line.split() for line in part.splitlines()]
        assert ["1", "2", "3301", "3306.0", "3311", "3311", "2", "x", "0", "x"] in lines
        assert ["4", "2", "3304", "3309.0", "3314", "3314", "0", "x", "2", "x"] in lines
        assert ["spread", "2", "3", "3.0", "3", "3"] in lines
        assert ["1", "2", "21", "21.0", "21", "21", "2", "x", "2", "x"] in lines
        assert "5" not in {line[0] for line in lines if line}


def test_faults_come_and_go(tshark: Tshark) -> None:
    packets = [P(a5(1, 0x98, "01"), 0), P(a5(1, 0x98, "02"), 2), P(a5(1, 0x98, "02"), 5), P(a5(2, 0x98), 6)]
    lines = ask(tshark, capture(tshark, packets), "daly,faults").splitlines()
    said = [" ".join(line.split()) for line in lines]
    assert "0.000000 1 1 already there cell_volt_high_level_1" in said
    assert "2.000000 2 1 raised cell_volt_high_level_2" in said
    assert "2.000000 2 1 cleared cell_volt_high_level_1, after 2.000 s" in said
    assert "Board 1, after 3 replies to 0x98: cell_volt_high_level_2 (for 3.000 s)" in said
    assert "Board 2, after 1 replies to 0x98: none" in said
