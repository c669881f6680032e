# SPDX-License-Identifier: GPL-2.0-or-later
"""Run packets through tshark and the dissector, and read every field of ours."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.field_names import FIELD_NAMES, VIEW_NAMES
from dalytools.tshark import Tshark, lua_complaint

BETWEEN = "\x1f"  # several values of a field: a text of the bus can hold any character but this kind

EXPERT = "_ws.expert.message"
LUA_ERROR = "_ws.lua.error"
INFO = "_ws.col.Info"
SOURCE = "_ws.col.Source"
DESTINATION = "_ws.col.Destination"

EPOCH_NS = 1_700_000_000_000_000_000
FRAME_S = 13 * 10 / 9600


@dataclass(frozen=True)
class P:
    """A packet: bytes as hex, when it began (s), where it was heard (direction: 0 none, 1 inbound, 2 outbound)."""

    hex: str
    at: float = 0.0
    interface: int = 0
    direction: int = 0
    comment: str = ""


Row = dict[str, list[str]]
"""What is in a packet: field name -> its values, in order; absent fields are not there."""

Dissect = Callable[..., list[Row]]

_numbers = itertools.count()


def a5(address: int, data_id: int, data: str = "") -> str:
    """Build an A5 frame, as hex; data is hex, filled up with zeros."""
    head = bytes((0xA5, address, data_id, 8)) + bytes.fromhex(data).ljust(8, b"\0")
    return (head + bytes((sum(head) & 0xFF,))).hex()


def in_a_row(*frames: str, start: float = 0.0, gap: float = 0.001) -> list[P]:
    """Packets one behind the other, each when the one before has ended, and a gap."""
    packets: list[P] = []
    at = start
    for frame in frames:
        packets.append(P(frame, at))
        at += len(frame) / 2 * 10 / 9600 + gap
    return packets


def dissect_with(tshark: Tshark) -> Dissect:
    def dissect(
        packets: Sequence[P],
        *,
        two_pass: bool = True,
        descriptions: Sequence[str] = ("dalyshark bus=main",),
        link_type: int = 147,
        options: Sequence[str] = (),
        fields: Sequence[str] = FIELD_NAMES,
        tree: bool = True,
        file_format: str = "pcapng",
    ) -> list[Row]:
        path = tshark.home / f"packets-{next(_numbers)}.{file_format}"
        with open_writer(path, "pcap" if file_format == "pcap" else "pcapng") as writer:
            for description in descriptions:
                writer.add_interface(Interface("made", description, link_type))
            for packet in packets:
                writer.write_packet(
                    EPOCH_NS + round(packet.at * 1e9),
                    bytes.fromhex(packet.hex),
                    interface=packet.interface,
                    flags=packet.direction,
                    comment=packet.comment,
                )
        path.chmod(0o644)
        names = [*fields, *VIEW_NAMES, EXPERT, LUA_ERROR, INFO, SOURCE, DESTINATION]
        words = ["-2"] if two_pass else []
        words += ["-Y", "frame"] if two_pass and tree else []
        words += [word for option in options for word in ("-o", option)]
        words += ["-r", str(path), "-T", "fields", "-E", "separator=/t", "-E", f"aggregator={BETWEEN}"]
        words += [word for name in names for word in ("-e", name)]
        done = tshark.run(*words)
        messages = done.stderr.decode()
        assert done.returncode == 0, messages
        assert lua_complaint(messages) is None, messages
        rows: list[Row] = []
        for line in done.stdout.decode().splitlines():
            values = line.split("\t")
            rows.append(
                {
                    name: [value] if name in (INFO, EXPERT) else value.split(BETWEEN)
                    for name, value in zip(names, values, strict=True)
                    if value
                }
            )
        assert len(rows) == len(packets)
        assert not any(LUA_ERROR in row for row in rows), rows
        return rows

    return dissect


def numbers(row: Row, name: str) -> list[float]:
    """Values of a field as numbers, whatever way this tshark prints them."""
    truth = {"True": 1.0, "False": 0.0}
    return [
        truth[value] if value in truth else float(int(value, 0)) if "." not in value else float(value)
        for value in row.get(f"daly.{name}", [])
    ]


def number(row: Row, name: str) -> float | None:
    """The one value of a field, None where it is absent."""
    values = numbers(row, name)
    assert len(values) <= 1, f"{name}: {values}"
    return values[0] if values else None


def kinds(rows: Sequence[Row]) -> list[str]:
    """Kinds of all records, packet by packet; the packets of one text are joined by +."""
    return ["+".join(row.get("daly.kind", [])) for row in rows]


def expert(row: Row) -> str:
    return row.get(EXPERT, [""])[0]


def info(row: Row) -> str:
    return row.get(INFO, [""])[0]
