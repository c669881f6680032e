# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture can't tell: TCP ports of serial servers, Bluetooth handles: as options and as preferences."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

_MOST = 0xFFFF


@dataclass(frozen=True, slots=True)
class Choice:
    """What the user said is Daly's."""

    tcp_ports: frozenset[int] = frozenset()
    ble_handles: frozenset[int] = frozenset()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives what was said."""
    nothing: frozenset[int] = frozenset()
    parser.add_argument(
        "--tcp-ports",
        type=_numbers("port", "4001,5000-5010"),
        default=nothing,
        metavar="PORTS",
        help="TCP ports of serial servers, such as 4001,5000-5010",
    )
    parser.add_argument(
        "--ble-handles",
        type=_numbers("handle", "15,17"),
        default=nothing,
        metavar="HANDLES",
        help="Bluetooth attribute handles of the serial data, where the capture holds no discovery, such as 15,17",
    )


def read(args: argparse.Namespace) -> Choice:
    """Return what the command line says."""
    return Choice(args.tcp_ports, args.ble_handles)


def preferences(choice: Choice) -> list[str]:
    """Return the words that tell tshark's dissector the same; none where nothing was said."""
    words: list[str] = []
    for name, numbers in (("tcp_ports", choice.tcp_ports), ("ble_handles", choice.ble_handles)):
        if numbers:
            words += ["-o", f"daly.{name}:{','.join(map(str, sorted(numbers)))}"]
    if choice.tcp_ports:
        words += ["-o", "tcp.reassemble_out_of_order:TRUE"]
    return words


def _numbers(what: str, example: str) -> Callable[[str], frozenset[int]]:
    """Return what reads numbers and ranges, decimal or with 0x."""

    def parse(text: str) -> frozenset[int]:
        found: set[int] = set()
        try:
            for word in text.split(","):
                first, dash, last = word.partition("-")
                low = int(first, 0)
                high = int(last, 0) if dash else low
                found.update(range(low, high + 1) if 1 <= low <= high <= _MOST else (0,))
        except ValueError:
            found.add(0)
        if 0 in found:
            raise argparse.ArgumentTypeError(f"{text!r} names no {what}; {example} does")
        return frozenset(found)

    return parse
