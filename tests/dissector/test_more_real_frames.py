# SPDX-License-Identifier: GPL-2.0-or-later
"""More real bytes of real devices, with what their sources and the papers say: pcap_samples/more-real-frames.jsonl.

Every row stands on an interface, and so on a bus, of its own, behind what it needs to be known: the request that it
answers; on CAN a frame of the same dialect.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import pytest
from tests.dissector.can_frames import SOCKETCAN, can
from tests.dissector.dissection import Dissect, P, Row, kinds, numbers

FILE = Path(__file__).resolve().parents[2] / "pcap_samples" / "more-real-frames.jsonl"
ROWS: dict[str, dict[str, Any]] = {row["id"]: row for row in map(json.loads, FILE.read_text("utf-8").splitlines())}
ON_CAN = [key for key, row in ROWS.items() if row["transport"] == "can"]
ON_A_LINE = [key for key in ROWS if key not in ON_CAN]


def of_can(key: str, bus: int) -> list[P]:
    """The frame, behind one that tells its dialect: the host's call of HKMS, or a reply of the classic one."""
    identifier: str = ROWS[key]["can_id"]
    known_by = 0x0400FF80 if len(identifier) == 8 and identifier.startswith("04") else 0x18984001
    flags = "extended" if len(identifier) == 8 else ""
    frame = can(int(identifier, 16), ROWS[key]["hex"], flags=flags, at=bus + 0.5, interface=bus)
    return [can(known_by, "00" * 8, at=bus, interface=bus), frame]


def of_a_line(key: str, bus: int) -> list[P]:
    texts = [text for text in (ROWS[key].get("request"), ROWS[key]["hex"]) if text]
    return [P(text, at=bus + 0.2 * n, interface=bus) for n, text in enumerate(texts)]


@pytest.fixture(scope="module")
def seen(dissect: Dissect) -> dict[str, Row]:
    """What is in the packet of each row; two runs of tshark."""
    found: dict[str, Row] = {}
    for keys, made, link_type, name in ((ON_A_LINE, of_a_line, 147, "dalyshark"), (ON_CAN, of_can, SOCKETCAN, "can")):
        packets = [(key, packet) for bus, key in enumerate(keys) for packet in made(key, bus)]
        rows = dissect([packet for _, packet in packets], link_type=link_type, descriptions=[name] * len(keys))
        found |= {key: row for (key, _), row in zip(packets, rows, strict=True)}  # the last one of each
    return found


@pytest.mark.parametrize("key", ROWS)
def test_values_are_those_of_the_source(seen: dict[str, Row], key: str) -> None:
    row, real = seen[key], ROWS[key]
    if real.get("kind", "frame") == "frame":
        assert kinds([row]) == ["frame"]
    for name, value in real["expect"].items():
        wanted = cast("list[Any]", value if isinstance(value, list) else [value])
        if isinstance(wanted[0], str):
            assert row.get(f"daly.{name}") == wanted, name
        else:
            assert numbers(row, name) == pytest.approx(wanted, abs=1e-9), name
    if real.get("kind") == "foreign":
        assert not {"daly.address", "daly.data_id", "daly.dialect"} & row.keys()
