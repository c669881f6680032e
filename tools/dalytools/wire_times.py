# SPDX-License-Identifier: GPL-2.0-or-later
"""The constants of both readings (docs/records.md) as options of a command, and as preferences of the dissector."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from dalyref.options import Options
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping

_TIMES = ("quiet", "echo", "reply", "burst", "late", "age")
_TOLERANCES = (
    ("cell_tolerance", "mV", "0x91 and the cells of 0x95 may differ by so much"),
    ("temperature_tolerance", "C", "0x92 and the sensors of 0x96 may differ by so much"),
    ("sum_tolerance", "%%", "the pack voltage and the sum of the cells may differ by so much"),
    ("soc_tolerance", "%%", "the SOC over A5 and over Modbus may differ by so much"),
)


def add_arguments(parser: argparse.ArgumentParser, *, quiet: str = "--quiet") -> None:
    """Declare one option a constant; ``read`` gives them. quiet: another name, where --quiet means something else."""
    defaults = Options()
    parser.add_argument(
        "--baud", type=_baud, default=argparse.SUPPRESS, metavar="N", help=f"for times on the wire ({defaults.baud})"
    )
    for name, option, text in (
        ("quiet", quiet, "give an incomplete frame up after so long a silence"),
        ("echo", "--echo", "a request repeated within this is an echo"),
        ("reply", "--reply", "a request waits so long for its reply"),
        ("burst", "--burst", "an answer in several frames ends after so long a silence"),
        ("late", "--late", "a reply later than its request waits, but within this, is late"),
        ("age", "--age", "records further apart do not contradict each other"),
    ):
        default: float = getattr(defaults, name)
        parser.add_argument(
            option,
            dest=f"{name}_s",
            type=_seconds,
            default=argparse.SUPPRESS,
            metavar="S",
            help=f"{text} (seconds, default {default:g})",
        )
    for name, unit, text in _TOLERANCES:
        tolerance: float = getattr(defaults, name)
        parser.add_argument(
            f"--{name.replace('_', '-')}",
            type=_whole,
            default=argparse.SUPPRESS,
            metavar="N",
            help=f"{text} ({unit}, default {tolerance:g})",
        )


def read(args: argparse.Namespace, base: Options | None = None) -> Options:
    """Return the constants that the command line asks for; those that it does not name are those of `base`."""
    given: dict[str, object] = vars(args)
    names = {"baud": "baud", **{name: f"{name}_s" for name in _TIMES}, **{name: name for name, _, _ in _TOLERANCES}}
    asked = {name: given[there] for name, there in names.items() if there in given}
    return replace(base or Options(), **asked)  # pyright: ignore[reportArgumentType]


def checked(values: Mapping[str, float], said: str) -> Options:
    """Return constants from a file's words for them. said: what to begin a complaint with. Raises Problem."""
    made: dict[str, float] = {}
    for name, value in values.items():
        try:
            made[name] = (
                _baud(str(value)) if name == "baud" else _seconds(str(value)) if name in _TIMES else _whole(str(value))
            )
        except argparse.ArgumentTypeError as error:
            raise Problem(f"{said}{name}: {error}") from None
    return replace(Options(), **made)  # pyright: ignore[reportArgumentType]


def preferences(options: Options) -> list[str]:
    """Return the words that tell tshark's dissector the same (its times are whole milliseconds)."""
    words = ["-o", f"daly.baud:{options.baud}"]
    for name in _TIMES:
        words += ["-o", f"daly.{name}:{round(getattr(options, name) * 1000)}"]
    for name, _, _ in _TOLERANCES:
        words += ["-o", f"daly.{name}:{round(getattr(options, name))}"]
    return words


def _whole(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or len(text) > 6:
        raise argparse.ArgumentTypeError(f"{text!r} is no tolerance; 20 is one")
    return int(text)


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
