# SPDX-License-Identifier: GPL-2.0-or-later
"""A state that has heard frames, at times that a test chooses."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.made import FRAME_S, a5, write

from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalytools.dashboard.state import State

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

STATUS = a5(1, 0x94, bytes((4, 2)))
"""Four cells, two sensors."""
CELLS = (
    a5(1, 0x95, bytes.fromhex("01 0ce4 0cee 0cda 00")),  # 3300 3310 3290 mV
    a5(1, 0x95, bytes.fromhex("02 0cd0 0000 0000 00")),  # 3280 mV
)
SENSORS = a5(1, 0x96, bytes((1, 40 + 21, 40 + 19)))
"""21 and 19 C: 40 is taken away (the vendor's paper V1.2, 0x96)."""
PACK = a5(1, 0x90, bytes.fromhex("0084 0000 7496 0271"))
"""13.2 V; 29846 - 30000 = -154, that is -15.4 A; 625 of 1000, 62.5 %."""
MOS = a5(1, 0x93, bytes((1, 1, 0, 7)) + (156_250).to_bytes(4))
"""Charging; charge MOS on, discharge MOS off; 156250 mAh."""
BALANCE = a5(1, 0x97, bytes((0b0101,)))
"""Cells 1 and 3."""
FAULTS = a5(1, 0x98, bytes((0b11, 0, 0, 0, 0, 0, 0b100)))
"""Cell voltage high, both levels; short circuit."""
ALL = (STATUS, *CELLS, SENSORS, MOS, PACK, BALANCE, FAULTS)
SWITCH_OFF = a5(0x40, 0xD9, b"\0")
"""A write: discharge MOS off."""


def heard(folder: Path, frames: Sequence[tuple[float, bytes]], *, comment: str = "") -> State:
    """Return what a screen knows after these frames, each with when it came (s); the last is still open."""
    path = write(folder / "heard.pcapng", [(at + number * FRAME_S, data) for number, (at, data) in enumerate(frames)],
                 comment=comment)  # fmt: skip
    state, now = State(), 0.0
    decoder = Decoder(early=lambda record: state.early(record, now))
    for (at, _), packet in zip(frames, read_capture(path), strict=True):
        now = at
        for record in decoder.feed(packet):
            state.final(record)
    return state
