# SPDX-License-Identifier: GPL-2.0-or-later
"""The packet list without a tree: frames that come again are shown a shorter way, which must say the same."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from tests.dissector import can_frames
from tests.dissector.dissection import DESTINATION, EPOCH_NS, INFO, SOURCE, P, a5

from bench import soak
from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from dalytools.tshark import Tshark

COLUMNS = 'gui.column.format:"Source","%s","Destination","%d","Info","%i"'
PACK = "0213000074b4030f"  # 53.1 V, -12.4 A, 78.3 %
FIELDS = (
    "-T",
    "fields",
    "-E",
    "separator=/t",
    *(w for n in (SOURCE, DESTINATION, INFO, "daly.kind") for w in ("-e", n)),
)


def serial() -> list[P]:
    request, reply = a5(0x40, 0x90), a5(1, 0x90, PACK)
    state, idle = a5(0x40, 0x93), a5(1, 0x93, "00")
    charging, fault = a5(1, 0x93, "01"), a5(1, 0x98, "01")
    return [
        *(P(frame, at + 2 * turn) for turn in range(3) for frame, at in ((request, 0.0), (reply, 0.1))),
        P(request, 6.0), P(reply, 6.7),  # slow
        P(request, 8.0), P(request, 8.3), P(reply, 8.4),  # a retry
        P(reply, 9.9),  # nobody asked
        P(state, 10.0), P(idle, 10.1), P(request, 10.2), P(reply, 10.3),  # says the state, too
        P(state, 11.0), P(charging, 11.1), P(request, 11.2), P(reply, 11.3),
        P(fault, 12.0), P(fault, 12.2),
    ]  # fmt: skip


def can() -> list[P]:
    request, reply = can_frames.request, can_frames.reply
    return [
        *(frame for turn in range(3) for frame in (request(0x90, at=2.0 * turn), reply(0x90, PACK, at=2 * turn + 0.1))),
        request(0x90, at=6.0), reply(0x90, PACK, at=6.7),
        request(0x90, at=8.0), request(0x90, at=8.3), reply(0x90, PACK, at=8.4),
        reply(0x90, PACK, at=9.9),
        reply(0x93, "00" * 8, at=10.0), request(0x90, at=10.2), reply(0x90, PACK, at=10.3),
        reply(0x93, "01" + "00" * 7, at=11.0), request(0x90, at=11.2), reply(0x90, PACK, at=11.3),
    ]  # fmt: skip


def write(tshark: Tshark, packets: list[P], link_type: int) -> Path:
    path = tshark.home / f"list-{link_type}.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("made", "dalyshark bus=main", link_type))
        for packet in packets:
            writer.write_packet(EPOCH_NS + round(packet.at * 1e9), bytes.fromhex(packet.hex))
    path.chmod(0o644)
    return path


def listed(tshark: Tshark, path: Path) -> list[list[str]]:
    """Source, destination and Info without a tree."""
    rows = tshark.run("-r", str(path), "-T", "tabs", "-o", COLUMNS).stdout.decode().splitlines()
    return [[cell.strip() for cell in (row[0], row[-2], row[-1])] for row in (line.split("\t") for line in rows)]


def with_tree(tshark: Tshark, path: Path) -> list[list[str]]:
    """The same where fields are asked for."""
    rows = tshark.run("-r", str(path), "-o", COLUMNS, *FIELDS).stdout.decode().splitlines()
    # From 4.6 on, this way of printing doubles backslashes.
    return [[cell.strip().replace("\\\\", "\\") for cell in line.split("\t")[:3]] for line in rows]


def notes(tshark: Tshark, path: Path, *words: str) -> str:
    return tshark.run("-q", "-r", str(path), *words, "-z", "expert").stdout.decode()


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_the_list_says_what_is_said_with_a_tree(tshark: Tshark, wire: str) -> None:
    path = write(tshark, serial(), 147) if wire == "serial" else write(tshark, can(), can_frames.SOCKETCAN)
    rows = listed(tshark, path)
    infos = [row[-1] for row in rows]
    assert rows == with_tree(tshark, path)
    reply = "Reply board 1  0x90 Pack: 53.1 V  -12.4 A"
    assert infos[1] == infos[3] == infos[5] == infos[7] == infos[10] == infos[11] == f"{reply}  SOC 78.3 %"
    assert infos[9] == "Request board 1  0x90 Pack  [retry]"
    assert [info for info in infos if "(" in info] == [
        f"{reply} (stationary)  SOC 78.3 %",
        f"{reply} (charging)  SOC 78.3 %",
    ]


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_notes_are_counted_without_a_tree(tshark: Tshark, wire: str) -> None:
    path = write(tshark, serial(), 147) if wire == "serial" else write(tshark, can(), can_frames.SOCKETCAN)
    bare = notes(tshark, path)
    assert bare == notes(tshark, path, "-Y", "daly")
    assert "The reply came 0." in bare


@pytest.mark.parametrize("make", ["trouble", "likely_bus", "can"])
def test_trouble_says_the_same_in_the_list(tshark: Tshark, make: str) -> None:
    path = tshark.home / f"list-{make}.pcapng"
    if make == "can":
        link_type, made = soak.KINDS["can"](105)
        soak.write(path, itertools.islice(made, 4000), link_type)
    else:
        soak.write(path, itertools.islice(getattr(soak, make)(105), 4000))
    path.chmod(0o644)
    rows = listed(tshark, path)
    assert rows == with_tree(tshark, path)
    assert sum("Reply board" in row[-1] for row in rows) > 500
    assert notes(tshark, path) == notes(tshark, path, "-Y", "daly || !daly")


def values(wire: str, replies: Iterable[tuple[int, str]]) -> list[P]:
    """Requests and replies in turn, a second apart."""
    made: list[P] = []
    for number, (data_id, data) in enumerate(replies):
        asked, answered = (
            (P(a5(0x40, data_id), number), P(a5(1, data_id, data), number + 0.1))
            if wire == "serial"
            else (can_frames.request(data_id, at=number), can_frames.reply(data_id, data, at=number + 0.1))
        )
        made += [asked, answered]
    return made


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_frame_with_other_values_says_them(tshark: Tshark, wire: str) -> None:
    """What is remembered of a kind of frame is its beginning alone; 0x98 is looked at closer where it changes."""
    packets = values(
        wire,
        [
            (0x94, "0401000000000000"),
            (0x90, PACK),
            (0x90, "0214000074b40310"),
            (0x98, "00" * 8),
            (0x98, "00" * 8),
            (0x98, "0200000000000000"),  # severe, which is noted each time
            (0x98, "0200000000000000"),
            (0x95, "010ce40ce50ce600"),
            (0x95, "010ce70ce80ce900"),
            (0xAB, "0100000000000000"),
            (0xAB, "0200000000000000"),
        ],
    )
    path = write(tshark, packets, 147 if wire == "serial" else can_frames.SOCKETCAN)
    rows = listed(tshark, path)
    assert rows == with_tree(tshark, path)
    said = [row[-1].split(" board 1  ")[1] for row in rows][1::2]
    assert said == [
        "0x94 Status: 4 cells  1 sensors  charger disconnected  load disconnected  0 cycles",
        "0x90 Pack: 53.1 V  -12.4 A  SOC 78.3 %",
        "0x90 Pack: 53.2 V  -12.4 A  SOC 78.4 %",
        "0x98 Faults: none",
        "0x98 Faults: none",
        "0x98 Faults: cell_volt_high_level_2  raised: cell_volt_high_level_2",
        "0x98 Faults: cell_volt_high_level_2",
        "0x95 Cell voltages: frame 1  cells 1-3: 3300 3301 3302 mV",
        "0x95 Cell voltages: frame 1  cells 1-3: 3303 3304 3305 mV",
        "0xAB unknown ID  01 00 00 00 00 00 00 00",
        "0xAB unknown ID  02 00 00 00 00 00 00 00",
    ]
    assert notes(tshark, path) == notes(tshark, path, "-Y", "daly")


def test_a_short_frame_of_a_known_kind_says_no_values(tshark: Tshark) -> None:
    """On CAN: after whole ones, whose words are remembered."""
    request, reply = can_frames.request, can_frames.reply
    packets = [
        request(0x90, at=0), reply(0x90, PACK, at=0.1),
        request(0x90, at=1), reply(0x90, PACK[:10], at=1.1),
        request(0x90, at=2), reply(0x90, PACK, at=2.1),
        request(0x95, at=3), reply(0x95, "01", at=3.1),
        request(0x95, at=4), reply(0x95, "", at=4.1),
    ]  # fmt: skip
    path = write(tshark, packets, can_frames.SOCKETCAN)
    rows = listed(tshark, path)
    assert rows == with_tree(tshark, path)
    assert [row[-1].split(" board 1  ")[1] for row in rows][1::2] == [
        "0x90 Pack: 53.1 V  -12.4 A  SOC 78.3 %",
        "0x90 Pack: 02 13 00 00 74",
        "0x90 Pack: 53.1 V  -12.4 A  SOC 78.3 %",
        "0x95 Cell voltages: 01",
        "0x95 Cell voltages:",
    ]
