# SPDX-License-Identifier: GPL-2.0-or-later
"""One exchange gives the same values on every wire that carries it, in both readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import pytest

from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalytools.cli import main
from dalytools.comparison import compare
from dalytools.tshark import Tshark
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers

if TYPE_CHECKING:
    from pathlib import Path

WIRES_OWN = (
    "daly.transport",
    "daly.start",
    "daly.address",
    "daly.length",
    "daly.checksum",
    "daly.response_time",
    "daly.can.",
)
"""What belongs to a wire, not to what was said over it."""


WIRES = Choice(tcp_ports=numbers("8899"))


LINKS = ("daly.request_in", "daly.reply_in", "daly.reassembled_in", "daly.changed_from", "daly.contradicts")
"""Packet numbers."""


def said(path: Path) -> list[dict[str, object]]:
    """Return the fields of all records; links as the places of the records that the packet they name holds."""
    decoder, carriers = Decoder(), Carriers(WIRES)
    given = [one for packet in read_capture(path) for one in carriers.of(packet)]
    records = [record for one in (*given, *carriers.finish()) for record in decoder.feed(one)]
    records += decoder.finish()
    places: dict[object, list[int]] = {}
    for place, record in enumerate(records):
        places.setdefault(record.number, []).append(place)
    return [
        {
            name: [place for number in _several(value) for place in places[number]] if name in LINKS else value
            for name, value in record.fields.items()
            if not name.startswith(WIRES_OWN)
        }
        for record in records
    ]


def _several(value: object) -> list[object]:
    return cast("list[object]", value) if isinstance(value, list) else [value]


def same(told: object, expected: object, name: str) -> bool:
    """Compare a value with the one of RS-485, where each record has a packet for itself."""
    if name in LINKS and isinstance(told, list) and isinstance(expected, list):
        return set(cast("list[int]", expected)).issubset(cast("list[int]", told))
    return told == expected


@pytest.mark.parametrize(
    ("scenario", "wires"),
    [
        ("clean-16s", ("uart", "can", "ble", "tcp")),
        ("clean-settings", ("uart", "can", "ble", "tcp")),
        ("faults", ("uart", "can", "ble", "tcp")),
        ("clean-all-dialects", ("uart", "ble", "tcp")),
    ],
)
def test_every_wire_says_the_same(scenario: str, wires: tuple[str, ...], tmp_path: Path) -> None:
    told: dict[str, list[dict[str, object]]] = {}
    for wire in wires:
        path = tmp_path / f"{wire}.pcapng"
        assert main(["simulate", scenario, "-w", str(path), "--wire", wire, "--duration", "8"]) == 0
        told[wire] = said(path)
        with Tshark() as tshark:
            assert compare(tshark, path, wires=WIRES).found == 0
    assert len(told["uart"]) > 50
    assert any("daly.cells.voltage" in fields for fields in told["uart"]) or scenario in {"clean-settings", "faults"}
    for wire in wires[1:]:
        assert len(told[wire]) == len(told["uart"])
        for fields, expected in zip(told[wire], told["uart"], strict=True):
            assert fields.keys() == expected.keys()
            assert [name for name, value in fields.items() if not same(value, expected[name], name)] == []
