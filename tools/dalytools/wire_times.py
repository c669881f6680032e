# SPDX-License-Identifier: GPL-2.0-or-later
"""The constants of both readings (docs/records.md) as options of a command, and as preferences of the dissector."""

from __future__ import annotations

import argparse
import math

from dalyref.options import Options


def add_arguments(parser: argparse.ArgumentParser, *, quiet: str = "--quiet") -> None:
    """Declare one option a constant; ``read`` gives them. quiet: another name, where --quiet means something else."""
    defaults = Options()
    parser.add_argument("--baud", type=_baud, default=defaults.baud, metavar="N", help="for times on the wire")
    for name, option, text in (
        ("quiet", quiet, "give an incomplete frame up after so long a silence"),
        ("echo", "--echo", "a request repeated within this is an echo"),
        ("reply", "--reply", "a request waits so long for its reply"),
        ("burst", "--burst", "an answer in several frames ends after so long a silence"),
    ):
        default: float = getattr(defaults, name)
        parser.add_argument(
            option,
            dest=f"{name}_s",
            type=_seconds,
            default=default,
            metavar="S",
            help=f"{text} (seconds, default {default:g})",
        )


def read(args: argparse.Namespace) -> Options:
    """Return the constants that the command line asks for."""
    return Options(args.baud, args.quiet_s, args.echo_s, args.reply_s, args.burst_s)


def preferences(options: Options) -> list[str]:
    """Return the words that tell tshark's dissector the same (its times are whole milliseconds)."""
    words = ["-o", f"daly.baud:{options.baud}"]
    for name in ("quiet", "echo", "reply", "burst"):
        words += ["-o", f"daly.{name}:{round(getattr(options, name) * 1000)}"]
    return words


def _baud(text: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value <= 100_000_000:
        raise argparse.ArgumentTypeError(f"{text!r} is no baud rate; 9600 is one")
    return value


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"{text!r} is no time in seconds; 0.25 is one")
    return value
