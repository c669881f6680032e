# SPDX-License-Identifier: GPL-2.0-or-later
"""Which frames of a CAN bus are Daly's, and what they mean (docs/wires.md, 2).

| identifier                                        | is               | when                                      |
|---------------------------------------------------|------------------|-------------------------------------------|
| 18, 90..98, a board and a host                    | classic          | always                                    |
| 18, any other ID, a board and a host              | classic          | a frame of the first row was seen         |
| 0400FF80, eight bytes of 0                        | HKMS keep-alive  | always                                    |
| register 0400..040E, a board sends                | HKMS             | a keep-alive was seen                     |
| register 182A 182C 161E 181E, host to board       | HKMS write       | a keep-alive was seen, before the classic |
| register 161E, host to board                      | HKMS write       | also a frame of the first row was seen    |
| register 0400..040E, a board sends, no keep-alive | HKMS or Deye     | a frame of the first row was seen         |
| other makers' (can_foreign)                       | foreign          | a first row or a keep-alive was seen      |
"""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING

from dalyref import can_classic, can_foreign, can_hkms
from dalyref.bus import Bus
from dalyref.can_hkms import Hkms
from dalyref.kinds import Kind

if TYPE_CHECKING:
    from dalyref.options import Options
    from dalyref.packet import CanFrame
    from dalyref.slate import Slate
    from dalyref.streams import Located
    from dalyref.values import Fields

MOST_BYTES = 8
"""Of a classic CAN frame; CAN FD is not Daly's."""


class Meaning(Enum):
    """What a frame is."""

    CLASSIC = auto()
    HKMS = auto()
    FOREIGN = auto()


class CanBus:
    """One interface."""

    def __init__(self, options: Options) -> None:
        self._classic = Bus(options, echoes=False)
        self._hkms = Hkms(options)
        self._paper_seen = False  # a frame with one of the paper's IDs
        self._kept_alive = False

    def recognise(self, frame: CanFrame) -> tuple[Meaning, str] | None:
        """Say what a frame is, and whose when it is foreign; None: not ours. Frames come in the order of the file."""
        identifier = frame.identifier
        if len(frame.data) > MOST_BYTES:
            return None
        if frame.extended:
            if can_classic.fits(identifier) and can_classic.data_id(identifier) in can_classic.PAPER:
                self._paper_seen = True
                return Meaning.CLASSIC, ""
            if identifier == can_hkms.KEEP_ALIVE and frame.data == bytes(8):
                self._kept_alive = True
                return Meaning.HKMS, ""
            if can_hkms.is_write(identifier) and (
                self._kept_alive or (self._paper_seen and can_hkms.register(identifier) == can_hkms.SOC_POWER)
            ):
                return Meaning.HKMS, ""
            if can_hkms.is_streamed(identifier):
                if self._kept_alive:
                    return Meaning.HKMS, ""
                return (Meaning.FOREIGN, can_foreign.AMBIGUOUS) if self._paper_seen else None
            if self._paper_seen and can_classic.fits(identifier):
                return Meaning.CLASSIC, ""
        elif frame.remote:
            return None
        if self._paper_seen or self._kept_alive:
            name = can_foreign.name(identifier, extended=frame.extended)
            if name:
                return Meaning.FOREIGN, name
        return None

    def take(self, located: Located, frame: CanFrame, meaning: Meaning, fields: Fields) -> Slate | None:
        """Add what a recognised frame means to its `fields`, and to those of records before it."""
        self._classic.now_ns = self._hkms.now_ns = max(self._classic.now_ns, located.start_ns)
        identifier = frame.identifier
        if frame.extended:
            fields["daly.can.priority"] = identifier >> 24
            fields["daly.can.destination"] = identifier >> 8 & 0xFF
            fields["daly.can.source"] = identifier & 0xFF
            if frame.remote:
                fields["daly.can.remote"] = True
        if meaning is Meaning.FOREIGN:
            if frame.data:
                fields["daly.undecoded"] = frame.data.hex()
            return None
        if frame.data:
            fields["daly.data"] = frame.data.hex()
        if meaning is Meaning.HKMS:
            fields["daly.dialect"] = "hkms"
            fields["daly.can.register"] = can_hkms.register(identifier)
            return self._hkms.frame(located, frame, fields)
        message = can_classic.message(frame)
        fields["daly.dialect"] = "a5"
        fields["daly.data_id"] = message.data_id
        return self._classic.frame(located, message, fields)

    @staticmethod
    def kind(meaning: Meaning) -> Kind:
        """Return the kind of its record."""
        return Kind.FOREIGN if meaning is Meaning.FOREIGN else Kind.FRAME
