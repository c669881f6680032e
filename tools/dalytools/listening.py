# SPDX-License-Identifier: GPL-2.0-or-later
"""From a command line to sides that are listened to: one port, or the two of a two-port tap."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NamedTuple

from dalycapture.interface import tap_of
from dalycapture.opening import open_port
from dalycapture.side import DIRECTIONS, Side
from dalytools.port_options import PORT_HELP, add_port_options, settings_of
from dalytools.problem import Problem

if TYPE_CHECKING:
    from dalycapture.settings import Settings


class Tap(NamedTuple):
    """A port and whose wire it hears: host, bms, or empty."""

    side: str
    port: str


def add_listening_options(parser: argparse.ArgumentParser) -> None:
    """Declare PORT, --tap, --wait and the options of a port."""
    parser.add_argument("port", metavar="PORT", nargs="?", help=PORT_HELP)
    parser.add_argument(
        "--tap",
        dest="taps",
        metavar="SIDE=PORT",
        action="append",
        default=[],
        type=_tap,
        help="instead of PORT, for wires of their own: --tap host=PORT where the host speaks, --tap bms=PORT where the "
        "BMS does; both into one file, in the order of time, each with its direction",
    )
    parser.add_argument(
        "--wait",
        dest="wait_s",
        type=_wait,
        metavar="SECONDS",
        help="for how long to wait for a port that went away; 0 ends at once (default: until it is back)",
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="say at each packet how sure its time is")
    add_port_options(parser)


def taps_of(args: argparse.Namespace) -> list[Tap]:
    """Read which ports were asked for; none: an empty list. Raises Problem."""
    taps: list[Tap] = args.taps
    if args.port and taps:
        raise Problem("give one PORT, or --tap host=PORT and --tap bms=PORT, not both")
    if not taps:
        return [Tap("", args.port)] if args.port else []
    if sorted(tap.side for tap in taps) != sorted(DIRECTIONS):
        raise Problem("a two-port tap has one port for each side: --tap host=PORT --tap bms=PORT")
    if taps[0].port == taps[1].port:
        raise Problem(f"both sides are {taps[0].port}; each needs a port of its own")
    return taps


def open_sides(args: argparse.Namespace, taps: list[Tap], settings: Settings | None = None) -> list[Side]:
    """Open the ports. Raises PortError; then none stays open."""
    settings = settings or settings_of(args)
    link_type: int = getattr(args, "link_type", 147)
    sides: list[Side] = []
    try:
        for tap in taps:
            port = open_port(tap.port, settings)
            interface = tap_of(port, settings, bus=args.bus, side=tap.side, link_type=link_type)
            sides.append(Side(port, interface, settings=settings, name=tap.side, wait_s=args.wait_s))
    except BaseException:
        for side in sides:
            side.close()
        raise
    return sides


def named(taps: list[Tap]) -> str:
    """Name the ports for people: ``/dev/ttyUSB0``, ``/dev/ttyUSB0 (host) and /dev/ttyUSB1 (bms)``."""
    return " and ".join(f"{tap.port} ({tap.side})" if tap.side else tap.port for tap in taps)


def _tap(text: str) -> Tap:
    side, equals, port = text.partition("=")
    if not equals or side not in DIRECTIONS or not port:
        message = f"{text!r} is no tap; write host=PORT or bms=PORT"
        raise argparse.ArgumentTypeError(message)
    return Tap(side, port)


def _wait(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < 1e9:
        message = f"{text!r} is not a number of seconds from 0 up"
        raise argparse.ArgumentTypeError(message)
    return seconds
