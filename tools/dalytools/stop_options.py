# SPDX-License-Identifier: GPL-2.0-or-later
"""When a capture ends by itself, as options of a command: dumpcap's ``-a`` and ``-c``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from dalycapture.sniffer import Limits

if TYPE_CHECKING:
    from collections.abc import Sequence


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives them."""
    parser.add_argument(
        "-a",
        dest="limits",
        metavar="CONDITION",
        action="append",
        default=[],
        type=_limit,
        help="stop after duration:SECONDS, packets:N, filesize:KB (1000 bytes) or, with -b, files:N; may be given more "
        "than once",
    )
    parser.add_argument("-c", dest="packets", metavar="N", type=positive, help="stop after N records")


def read(args: argparse.Namespace) -> tuple[Limits, int | None]:
    """Return what the command line asks for: limits, and after how many files to stop."""
    limits, files = Limits(), None
    conditions: Sequence[tuple[str, float | int]] = args.limits
    for name, value in conditions:
        if name == "files":
            files = int(value)
        else:
            limits = replace(limits, **{name: value})
    if args.packets is not None:
        limits = replace(limits, packets=args.packets)
    return limits, files


def positive(text: str) -> int:
    """Read a whole number from 1 up."""
    if not text.isascii() or not text.isdecimal() or not 0 < int(text[:19]) <= 10**18:
        message = f"{text!r} is not a whole number from 1 up"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def seconds(text: str) -> float:
    """Read a number of seconds above 0."""
    try:
        number = float(text)
    except ValueError:
        number = -1.0
    if not 0 < number < 1e9:
        message = f"{text!r} is not a number of seconds above 0"
        raise argparse.ArgumentTypeError(message)
    return number


def _limit(text: str) -> tuple[str, float | int]:
    """Read one of dumpcap's stop conditions: (field of Limits, value)."""
    name, colon, value = text.partition(":")
    if colon and name == "duration":
        return name, seconds(value)
    if colon and name in {"packets", "files"}:
        return name, positive(value)
    if colon and name == "filesize":
        return name, positive(value) * 1000
    message = f"{text!r} is not a stop condition; use duration:SECONDS, packets:N, filesize:KB or files:N"
    raise argparse.ArgumentTypeError(message)
