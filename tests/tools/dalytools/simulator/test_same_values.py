# SPDX-License-Identifier: GPL-2.0-or-later
"""One exchange gives the same values on RS-485 and on CAN, in both readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalytools.cli import main
from dalytools.comparison import compare
from dalytools.tshark import Tshark
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    from pathlib import Path

    from dalyref.values import Fields

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


def said(path: Path) -> list[Fields]:
    decoder, carriers = Decoder(), Carriers()
    records = [record for packet in read_capture(path) for one in carriers.of(packet) for record in decoder.feed(one)]
    return [
        {name: value for name, value in record.fields.items() if not name.startswith(WIRES_OWN)}
        for record in (*records, *decoder.finish())
    ]


@pytest.mark.parametrize("scenario", ["clean-16s", "clean-settings", "faults"])
def test_uart_and_can_say_the_same(scenario: str, tmp_path: Path) -> None:
    told: dict[str, list[Fields]] = {}
    for wire in ("uart", "can"):
        path = tmp_path / f"{wire}.pcapng"
        assert main(["simulate", scenario, "-w", str(path), "--wire", wire, "--duration", "8"]) == 0
        told[wire] = said(path)
        with Tshark() as tshark:
            assert compare(tshark, path).found == 0
    assert len(told["uart"]) > 50
    assert told["uart"] == told["can"]
    assert any("daly.cells.voltage" in fields for fields in told["can"]) or scenario != "clean-16s"
