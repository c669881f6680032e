# SPDX-License-Identifier: GPL-2.0-or-later
"""The packet list without a tree: frames that come again are shown a shorter way, which must say the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.dissector import can_frames
from tests.dissector.dissection import DESTINATION, EPOCH_NS, INFO, SOURCE, P, a5

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
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


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_the_list_says_what_is_said_with_a_tree(tshark: Tshark, wire: str) -> None:
    path = write(tshark, serial(), 147) if wire == "serial" else write(tshark, can(), can_frames.SOCKETCAN)
    listed = tshark.run("-r", str(path), "-T", "tabs", "-o", COLUMNS)
    with_tree = tshark.run("-r", str(path), "-o", COLUMNS, *FIELDS)
    rows = [[cell.strip() for cell in line.split("\t")] for line in listed.stdout.decode().splitlines()]
    infos = [row[-1] for row in rows]
    assert [[row[0], row[-2], row[-1]] for row in rows] == [
        line.split("\t")[:3] for line in with_tree.stdout.decode().splitlines()
    ]
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
    bare = tshark.run("-q", "-r", str(path), "-z", "expert").stdout.decode()
    assert bare == tshark.run("-q", "-r", str(path), "-Y", "daly", "-z", "expert").stdout.decode()
    assert "The reply came 0." in bare
