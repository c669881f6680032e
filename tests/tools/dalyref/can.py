# SPDX-License-Identifier: GPL-2.0-or-later
"""Small CAN captures written by hand: frames at given milliseconds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalyref.traffic import at

from dalyref.decoder import Decoded, Options, decode
from dalyref.packet import CanFrame

if TYPE_CHECKING:
    from dalyref.values import Fields


class CanCapture:
    """A capture in the making: one frame a call. Identifiers and data are hex; three digits are a standard frame."""

    def __init__(self) -> None:
        self.frames: list[CanFrame] = []

    def put(self, ms: float, identifier: str, data: str = "", *, interface: int = 0, remote: bool = False) -> int:
        """Add a frame at `ms`; return its packet's number."""
        number = len(self.frames) + 1
        self.frames.append(
            CanFrame(
                number=number,
                time_ns=at(ms),
                data=bytes.fromhex(data),
                interface=interface,
                identifier=int(identifier, 16),
                extended=len(identifier) == 8,
                remote=remote,
            )
        )
        return number

    def read(self, options: Options | None = None) -> list[Decoded]:
        return list(decode(self.frames, options))

    def fields(self) -> dict[int, Fields]:
        """Return the fields of each record, by packet."""
        return {record.number: record.fields for record in self.read()}

    def kinds(self) -> dict[int, str]:
        """Return what each record is, by packet: its dialect, or whose it is."""
        return {
            number: str(fields.get("daly.dialect", fields.get("daly.foreign")))
            for number, fields in self.fields().items()
        }
