# SPDX-License-Identifier: GPL-2.0-or-later
"""Where Daly's bytes are, where a capture can't tell: TCP ports, Bluetooth handles. As options, and for tshark."""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, cast

from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping

_LAST: Final = 0xFFFF
_ONE = re.compile(r"(0x[0-9a-fA-F]{1,4}|[0-9]{1,5})(?:-(0x[0-9a-fA-F]{1,4}|[0-9]{1,5}))?")
_MOST_RANGES: Final = 100


@dataclass(frozen=True, slots=True)
class Numbers:
    """Numbers from 1 to 65535, as ranges."""

    ranges: tuple[range, ...] = ()

    def __contains__(self, number: int) -> bool:
        return any(number in one for one in self.ranges)

    def __bool__(self) -> bool:
        return bool(self.ranges)

    def __len__(self) -> int:
        """Count the numbers; those in several ranges as often."""
        return sum(map(len, self.ranges))

    def each(self) -> list[int]:
        """Return the numbers, in order."""
        return sorted({number for one in self.ranges for number in one})

    def __str__(self) -> str:
        """Return them as Wireshark's preferences want them: ``4001,8890-8899``."""
        return ",".join(f"{one[0]}-{one[-1]}" if len(one) > 1 else str(one[0]) for one in self.ranges)


@dataclass(frozen=True, slots=True)
class Choice:
    """What a person says of the wires of a capture."""

    tcp_ports: Numbers = Numbers()
    """Of serial servers that carry the bytes of a bus."""
    ble_handles: Numbers = Numbers()
    """Of attributes that are Daly's, in captures without the discovery."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives them."""
    parser.add_argument(
        "--tcp-ports",
        type=ports,
        default=argparse.SUPPRESS,
        metavar="PORTS",
        help="ports of serial servers that carry the bytes of a bus, such as 8899 or 4001,8890-8899",
    )
    parser.add_argument(
        "--ble-handles",
        type=handles,
        default=argparse.SUPPRESS,
        metavar="HANDLES",
        help="handles of Daly's Bluetooth attributes, such as 0x0f,0x11, where the capture began after the discovery",
    )


def checked(values: Mapping[str, object], said: str) -> Choice:
    """Return what a file says: by `KEYS`, a number, a text as the options have it, or a list of these.

    said: what to begin a complaint with. Raises Problem.
    """
    chosen: dict[str, Numbers] = {}
    for key, value in values.items():
        name, read_text = KEYS[key]
        some = cast("list[object]", value) if isinstance(value, list) else [value]
        text = ",".join(str(one) if isinstance(one, (int, str)) else "?" for one in some)
        try:
            chosen[name] = read_text(text)
        except argparse.ArgumentTypeError as error:
            raise Problem(f"{said}{key}: {error}") from None
    return Choice(**chosen)


def read(args: argparse.Namespace, base: Choice | None = None) -> Choice:
    """Return what the command line says; what it does not is that of `base`."""
    base = base or Choice()
    given: dict[str, Numbers] = vars(args)
    return Choice(given.get("tcp_ports", base.tcp_ports), given.get("ble_handles", base.ble_handles))


def ports(text: str) -> Numbers:
    """Read TCP ports. Raises ArgumentTypeError, a line, where they are none."""
    return numbers(text, like="8899 and 4001,8890-8899")


def handles(text: str) -> Numbers:
    """Read Bluetooth handles, in the same way."""
    return numbers(text, like="17 and 0x0f,0x11")


def numbers(text: str, *, like: str = "7 and 1,3-5") -> Numbers:
    """Read numbers and ranges. Raises ArgumentTypeError, a line with examples, where they are none."""
    ranges: list[range] = []
    for part in text.split(","):
        found = _ONE.fullmatch(part.strip())
        first, last = (_number(found[1]), _number(found[2] or found[1])) if found else (0, 0)
        if not 1 <= first <= last <= _LAST:
            message = f"{text[:50]!r} is no list of numbers from 1 to {_LAST}; {like} are"
            raise argparse.ArgumentTypeError(message)
        ranges.append(range(first, last + 1))
    if len(ranges) > _MOST_RANGES:
        raise argparse.ArgumentTypeError(f"{len(ranges)} ranges are too many; {_MOST_RANGES} are the most")
    return Numbers(tuple(ranges))


KEYS: Final = {"tcp-ports": ("tcp_ports", ports), "ble-handles": ("ble_handles", handles)}
"""The same in a file of settings: what of `Choice` it is, and what reads it."""


def _number(text: str) -> int:
    return int(text, 16) if text.startswith("0x") else int(text)


def preferences(choice: Choice) -> list[str]:
    """Return the words that tell tshark's dissector the same."""
    return ["-o", f"daly.tcp_ports:{choice.tcp_ports}", "-o", f"daly.ble_handles:{choice.ble_handles}"]
