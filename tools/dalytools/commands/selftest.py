# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark selftest --hardware PORT``: one adapter and a jumper. The only command that transmits; it asks first."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from dalytools import hardware_test
from dalytools.problem import Problem
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    import argparse

_WARNING = """\
This TRANSMITS on {port}: test bytes, a break, RTS and DTR up and down.
Take the adapter off every bus first. Then join its output to its input:
  UART / TTL adapter    TX to RX
  RS-485 adapter        most can't hear themselves: A and B joined to a second adapter tell nothing; use a UART one
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Try what can not be proven without hardware, on one adapter whose output is joined to its input: bytes, "
        "latency, error counters, breaks, RTS and DTR. This is the only command that transmits; it asks first."
    )
    parser.epilog = "Exit status: 0 all as it should be or not known, 1 something is not, 2 could not run."
    parser.add_argument("--hardware", metavar="PORT", required=True, help="device to send on, such as /dev/ttyUSB0")
    parser.add_argument("--baud", type=int, default=9600, help="bits per second (default: %(default)s)")
    parser.add_argument(
        "--yes", action="store_true", help="do not ask: the adapter is on no bus, the jumper is in place"
    )


def run(args: argparse.Namespace) -> int:
    """Ask, try, tell."""
    port: str = args.hardware
    if not 50 <= args.baud <= 4_000_000:
        raise Problem(f"--baud {args.baud} is no speed; 9600 is one")
    if not args.yes:
        _ask(port)
    from dalytools.loop_port import LoopPort

    loop = LoopPort(port, args.baud)
    wrong = False
    try:
        for check in hardware_test.run(loop):
            wrong |= check.verdict == hardware_test.WRONG
            print(f"{check.verdict:<10} {check.what:<32} {check.found}  (expected: {check.expected})")  # noqa: T201
    finally:
        loop.close()
    return 1 if wrong else 0


def _ask(port: str) -> None:
    """Let nobody transmit by mistake."""
    sys.stderr.write(_WARNING.format(port=plain(port)))
    if not sys.stdin.isatty():
        raise Problem("this transmits, so it asks on a terminal first; --yes answers it")
    sys.stderr.write("Type  yes  to go on: ")
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() != "yes":
        raise Problem("nothing was sent")
