# SPDX-License-Identifier: GPL-2.0-or-later
"""Where bytes stand in the traffic: whose, on which wire, under which ID or register."""

from __future__ import annotations

from dataclasses import dataclass, replace

REQUEST, REPLY, ECHO = "request", "reply", "echo"
A5, HKMS, D2, P81, CAN = "a5", "hkms", "d2", "81", "can"
MODBUS = (D2, P81)


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Where some bytes stand. Equal places are one series of payloads."""

    bus: str
    """Its name, the number of its interface, or the name of a TCP or Bluetooth connection."""
    board: int
    """0: the traffic does not say."""
    dialect: str
    """a5, hkms, d2, 81; ``can`` for CAN frames that are not Daly's, or not known to be."""
    direction: str
    number: int
    """Data ID, register, or CAN identifier."""
    page: int = -1
    """Frame number, of what is sent in several frames (data byte 0)."""
    size: int = 8
    """Bytes."""
    read: int = 0
    """Of a Modbus read request: how many registers it asks for."""
    extended: bool = True
    """Of a CAN identifier: 29 bits, else 11."""

    @property
    def what(self) -> str:
        """Name the ID or register, as people write it."""
        if self.dialect == A5:
            name = f"0x{self.number:02X}"
        elif self.dialect == CAN:
            name = f"CAN {self.number:08X}" if self.extended else f"CAN {self.number:03X}"
        else:
            name = f"register {self.number:04X}"
        if self.read:
            name += f", read of {self.read}"
        if self.page >= 0:
            name += f" frame {self.page}"
        return name

    @property
    def who(self) -> str:
        """Name the board and the direction."""
        board = f"board {self.board}" if self.board else self.dialect.upper() if self.dialect in MODBUS else ""
        return " ".join(word for word in (board, self.direction) if word)

    @property
    def name(self) -> str:
        """Name all of it but the bus."""
        odd = f" ({self.size} bytes)" if self.dialect in (A5, HKMS) and self.size != 8 else ""
        dialect = f" {self.dialect}" if self.dialect in MODBUS and self.board else ""
        return f"{self.who}{dialect} {self.what}{odd}".strip()

    def off_bus(self) -> Place:
        """Return the same place on a bus without a name: of one bus in two captures."""
        return replace(self, bus="")

    def bytes_name(self, first: int, last: int) -> str:
        """Name some of its bytes: ``d2`` or ``d2-3``; of a register without need."""
        if self.dialect in MODBUS and first == 0 and last == self.size - 1:
            return "all"
        return f"d{first}" if first == last else f"d{first}-{last}"
