# SPDX-License-Identifier: GPL-2.0-or-later
"""How the files of a capture are kept, as options of a command: dumpcap's ``-b``, and our own."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from dalycapture.disk import SYNC_S
from dalycapture.rotation import Keeping, Rotation
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

_CONDITIONS: Final = "duration:SECONDS, interval:SECONDS, filesize:KB, packets:N, files:N or printname:FILE"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives them."""
    group = parser.add_argument_group("files")
    group.add_argument(
        "-b",
        dest="rotation",
        metavar="CONDITION",
        action="append",
        default=[],
        type=_condition,
        help=f"go on in a new file after {_CONDITIONS}; KB are 1000 bytes; files:N keeps the newest N; "
        "printname: a file (- is standard output) that is told each closed file's name; may be given more than once",
    )
    group.add_argument("--append", action="store_true", help="go on in the file that is there; a torn end is cut off")
    group.add_argument("--sha256", action="store_true", help="leave FILE.sha256 beside each closed file")
    group.add_argument(
        "--when-full",
        choices=["stop", "wait"],
        default="stop",
        help="when the disk is full: stop, or count what is lost and go on when there is space (default: %(default)s)",
    )
    group.add_argument(
        "--sync",
        type=_sync,
        default=SYNC_S,
        metavar="S",
        help="have the disk store it every S seconds, and at each event; 0: never (default: %(default)g)",
    )


def read(args: argparse.Namespace, *, stop_after: int | None = None) -> Keeping:
    """Return what the command line asks for; stop_after: files. Raises Problem."""
    rotation = Rotation(stop_after=stop_after)
    conditions: Sequence[tuple[str, float | int | str]] = args.rotation
    for name, value in conditions:
        rotation = replace(rotation, **{name: value})
    if stop_after is not None and not rotation.asked:
        raise Problem("-a files:N ends after so many files; say with -b when each next one begins, as -b duration:3600")
    return Keeping(
        append=args.append,
        checksum=args.sha256,
        wait_when_full=args.when_full == "wait",
        sync_s=args.sync,
        rotation=rotation,
    )


def _condition(text: str) -> tuple[str, float | int | str]:
    """Read one of dumpcap's conditions: (field of Rotation, value)."""
    name, colon, value = text.partition(":")
    if colon and name == "printname" and value:
        return name, value
    if colon and name == "duration":
        seconds = _number(value)
        if 0 < seconds < 1e9:
            return name, seconds
    if colon and name in {"interval", "packets", "files", "filesize"} and value.isascii() and value.isdecimal():
        number = int(value[:19])
        if 0 < number < 10**18:
            return name, number * 1000 if name == "filesize" else number
    message = f"{text!r} is not a condition for a new file; use {_CONDITIONS}"
    raise argparse.ArgumentTypeError(message)


def _sync(text: str) -> float:
    seconds = _number(text)
    if 0 <= seconds < 1e6:
        return seconds
    message = f"{text!r} is not a number of seconds from 0 up"
    raise argparse.ArgumentTypeError(message)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return -1.0
