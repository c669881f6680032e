# SPDX-License-Identifier: GPL-2.0-or-later
"""Which places a person wants to see, as options of a command."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalytools.survey.findings import HALF_KNOWN, UNKNOWN
from dalytools.survey.place import A5, ECHO, REPLY, REQUEST

if TYPE_CHECKING:
    from dalytools.survey.findings import Finding
    from dalytools.survey.place import Place

_ANY: Final = "any"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What was asked for; nothing: all."""

    boards: frozenset[int] = frozenset()
    ids: tuple[range, ...] = ()
    registers: tuple[range, ...] = ()
    direction: str = _ANY
    unknown: bool = False

    @staticmethod
    def add_arguments(parser: argparse.ArgumentParser) -> None:
        """Declare the options; ``read`` gives them."""
        group = parser.add_argument_group("which places are shown (all; each option may be given more than once)")
        group.add_argument("--board", type=_board, action="append", default=[], metavar="N", help="of this board")
        group.add_argument(
            "--id", type=_numbers, action="append", default=[], metavar="ID", help="data ID in hex, 90 or 50-6A"
        )
        group.add_argument(
            "--register",
            type=_numbers,
            action="append",
            default=[],
            metavar="R",
            help="register (Modbus, HKMS) in hex, 28 or 28-3F; of other CAN frames the identifier",
        )
        group.add_argument("--direction", choices=(REQUEST, REPLY, ECHO), default=_ANY, help="one direction only")
        group.add_argument("--unknown", action="store_true", help="only what is not known, or in part")

    @classmethod
    def read(cls, args: argparse.Namespace) -> Wanted:
        """Return what the command line asks for."""
        return cls(frozenset(args.board), tuple(args.id), tuple(args.register), args.direction, args.unknown)

    def place(self, place: Place) -> bool:
        """Tell whether a place is wanted, by where it is."""
        if self.boards and place.board not in self.boards:
            return False
        if self.direction not in (_ANY, place.direction):
            return False
        if not self.ids and not self.registers:
            return True
        if place.dialect == A5:
            return any(place.number in some for some in self.ids)
        return any(place.number in some for some in self.registers)

    def finding(self, finding: Finding) -> bool:
        """Tell whether a place is wanted, by what is known of it."""
        return not self.unknown or finding.group in (UNKNOWN, HALF_KNOWN)


def _board(text: str) -> int:
    if text.isascii() and text.isdecimal() and 1 <= int(text[:3]) <= 16:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is no board; they are 1 to 16")


def _numbers(text: str) -> range:
    first, dash, last = text.partition("-")
    low, high = _hex(first), _hex(last) if dash else _hex(first)
    if low < 0 or high < low:
        raise argparse.ArgumentTypeError(f"{text!r} is no number in hex; 9A or 0x9A is one, 50-6A several")
    return range(low, high + 1)


def _hex(text: str) -> int:
    try:
        value = int(text, 16)
    except ValueError:
        return -1
    return value if 0 <= value < 1 << 29 else -1
