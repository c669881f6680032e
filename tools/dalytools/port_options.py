# SPDX-License-Identifier: GPL-2.0-or-later
"""Options of a serial port, the same in every command that listens to one."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.settings import DEFAULT_BAUD, Settings, line_format

if TYPE_CHECKING:
    from collections.abc import Callable

PORT_HELP = "device, socket://HOST:PORT or rfc2217://HOST:PORT"


def add_port_options(parser: argparse.ArgumentParser) -> None:
    """Declare them."""
    group = parser.add_argument_group("the port")
    group.add_argument("--baud", type=_baud, default=DEFAULT_BAUD, help="bits per second (default: %(default)s)")
    group.add_argument(
        "--format",
        dest="line_format",
        type=checked(line_format),
        default="8N1",
        metavar="8N1",
        help="data bits, parity N, E or O, stop bits (default: %(default)s)",
    )
    group.add_argument(
        "--modem-lines",
        choices=["leave", "drop"],
        default="leave",
        help="RTS and DTR, which the kernel raises when a port is opened: leave them (default), or drop both at once, "
        "for adapters that drive the bus by RTS",
    )
    group.add_argument(
        "--low-latency", action="store_true", help="ask the driver to hand bytes over at once (FTDI: timer of 1 ms)"
    )
    group.add_argument(
        "--latency",
        dest="latency_ms",
        type=_milliseconds,
        metavar="MS",
        help="for how long the adapter holds bytes back (default: its latency timer, else 16 ms is assumed)",
    )
    group.add_argument(
        "--error-marks",
        choices=["auto", "on", "off"],
        default="auto",
        help="mark bytes with line errors (default: where the driver counts them)",
    )


def settings_of(args: argparse.Namespace) -> Settings:
    """Read what was asked."""
    return Settings(
        baud=args.baud,
        line_format=args.line_format,
        modem_lines=args.modem_lines,
        low_latency=args.low_latency,
        latency_ms=args.latency_ms,
        error_marks=args.error_marks,
    )


def checked(check: Callable[[str], str]) -> Callable[[str], str]:
    """Make an argument type of a check that raises CaptureError."""

    def argument(text: str) -> str:
        try:
            return check(text)
        except CaptureError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return argument


def _baud(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or not 0 < int(text[:9]) <= 10**8:
        message = f"{text!r} is not a baud rate, such as 9600"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def _milliseconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 10_000:
        message = f"{text!r} is not a number of milliseconds, 0 to 10000"
        raise argparse.ArgumentTypeError(message)
    return value
