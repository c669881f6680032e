# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark import``: a log of another tool becomes a capture."""

from __future__ import annotations

import argparse
import datetime as dt
import io
import os
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from dalycapture.create import new_capture
from dalycapture.errors import CaptureError, reason
from dalycapture.output import CAPTURE_MAGICS
from dalycapture.reframe import Reframer
from dalytools import __version__, wire_times
from dalytools.logs.importer import Importer
from dalytools.logs.kinds import KINDS, RAW, RAW_ABOUT, guess
from dalytools.logs.text_lines import PIECE, is_text, text_lines
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    from dalycapture.reframe import Reframed
    from dalytools.logs.importer import Tally

_LINES_FOR_A_GUESS = 400
_SHOWN_AT_MOST = 1000
_SHOWN_CHARACTERS = 200


def _date(text: str) -> int:
    try:
        date = dt.date.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no date: write 2026-01-31") from None
    days = (date - dt.date(1970, 1, 1)).days
    if days < 0:
        raise argparse.ArgumentTypeError(f"{text!r}: dates before 1970 have no place in a capture")
    return days * 86400 * 10**9


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 1 <= rate <= 1e12:
        raise argparse.ArgumentTypeError(f"{text!r}: must be samples a second, such as 1e6")
    return rate


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    kinds = "\n".join(f"  {name:<14} {made().about}" for name, made in KINDS.items())
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.description = (
        "Make a capture of a log that another tool wrote: its bytes, times, directions and line errors, one packet a\n"
        "record. The kind of log is guessed, and said; lines that are not understood are counted."
    )
    parser.epilog = f"kinds of log:\n{kinds}\n  {RAW:<14} {RAW_ABOUT}"
    parser.add_argument("input", metavar="LOG", help="the log; - is standard input")
    parser.add_argument("-w", dest="output", metavar="OUT", required=True, help="capture file; - is standard output")
    parser.add_argument(
        "--kind", choices=[*KINDS, RAW], metavar="KIND", help="the kind of log, where the guess is wrong"
    )
    parser.add_argument(
        "--date", type=_date, default=0, metavar="DAY", help="of a log with times of day alone (1970-01-01)"
    )
    parser.add_argument(
        "--samplerate", type=_rate, default=0.0, metavar="HZ", help="of a sigrok log with sample numbers"
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="show every line that is not understood")
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Import; say what was guessed, what came of it, and what was not understood."""
    with ExitStack() as stack:
        stream, name = _opened(args.input, stack)
        try:
            return _imported(args, stream, name)
        except CaptureError as error:
            raise Problem(str(error)) from None


def _opened(path: str, stack: ExitStack) -> tuple[BinaryIO, str]:
    if path == "-":
        return sys.stdin.buffer, "standard input"
    try:
        return stack.enter_context(Path(path).open("rb")), Path(path).name
    except OSError as error:
        raise Problem(f"{path}: can not be read: {reason(error)}") from None


def _imported(args: argparse.Namespace, stream: BinaryIO, name: str) -> int:
    start = stream.read(PIECE)
    kind = _kind(args, start, name)
    if args.output not in {"-", args.input} and args.input != "-" and Path(args.output).exists():
        same = os.path.samefile(args.input, args.output)  # noqa: PTH121 - they are words of the user
    else:
        same = args.output == args.input != "-"
    if same:
        raise Problem("LOG and OUT are the same file; the log is evidence, give another name with -w")
    shown = 0

    def lost(number: int, line: str) -> None:
        nonlocal shown
        shown += 1
        if shown <= _SHOWN_AT_MOST:
            _say(f"line {number}: {line[:_SHOWN_CHARACTERS]}")

    with new_capture(args.output, application=f"dalyshark {__version__} import") as writer:
        writer.origin = f"imported from {name}, kind {kind}"
        reframer = Reframer(writer, wire_times.read(args))
        importer = Importer(
            name, kind, wire_times.read(args), reframer.told, date_ns=args.date, samplerate=args.samplerate
        )
        with progress_bar("import") as advance:
            for packet in importer.packets(stream, start, lost=lost if args.verbose else None):
                reframer.feed(packet)
                if packet.number % 1024 == 0:
                    advance(packet.number)
        if not importer.tally.bytes:
            raise CaptureError(f"{name}: no bytes were found in it as {kind}; --help lists the other kinds")
        result = reframer.finish()
    if shown > _SHOWN_AT_MOST:
        _say(f"and {shown - _SHOWN_AT_MOST} more lines")
    for sentence in summary(importer.tally, result, kind, args):
        _say(sentence)
    return 0


def _kind(args: argparse.Namespace, start: bytes, name: str) -> str:
    """Take the kind from the command line, or guess it and say so."""
    if not start:
        raise Problem(f"{name}: is empty")
    if start[:4] in CAPTURE_MAGICS:
        raise Problem(f"{name}: is a capture already; dalyshark reframe cuts it into records again")
    if args.kind:
        return args.kind
    if not is_text(start):
        _say(f"{name}: guessed {RAW} ({RAW_ABOUT}); --kind says otherwise")
        return RAW
    lines: list[str] = []
    for line in text_lines(io.BytesIO(), start):
        if line.strip():
            lines.append(line)
        if len(lines) == _LINES_FOR_A_GUESS:
            break
    if len(start) == PIECE and len(lines) > 1 and len(lines) < _LINES_FOR_A_GUESS:
        lines.pop()  # cut off by the end of what was looked at
    found = guess(lines)
    if found is None:
        raise Problem(f"{name}: is a text without bytes that are known; say what it is with --kind, --help lists them")
    about = KINDS[found.name]().about
    _say(f"{name}: guessed {found.name} ({about}): {found.fit} of the first {counted(found.lines, 'line')} fit")
    return found.name


def summary(tally: Tally, result: Reframed, kind: str, args: argparse.Namespace) -> list[str]:
    """Say what came of it, and what its times are worth."""
    where = "standard output" if args.output == "-" else args.output
    kinds = ", ".join(f"{count} {name}" for name, count in result.kinds.most_common())
    read = "" if kind == RAW else f"{counted(tally.with_bytes, 'line')} with bytes of {tally.lines}, "
    text = f"{where}: {read}{counted(tally.bytes, 'byte')}; {counted(result.records, 'record')}"
    text += f" ({kinds})" if kinds else ""
    text += f", {counted(result.others, 'CAN frame')}" if result.others else ""
    said = [text]
    if tally.not_understood:
        more = "" if args.verbose else "; -v shows them"
        verb = "was" if tally.not_understood == 1 else "were"
        said.append(f"{counted(tally.not_understood, 'line')} {verb} not understood{more}")
    if not tally.timed:
        said.append("the log has no times: bytes are laid out from 1970 on, and times between them mean nothing")
        return said
    if tally.day_unknown and not args.date:
        said.append("the log has times of day alone: taken as of 1970-01-01; --date gives the day")
    if tally.coarsest_ns >= 10**8:
        said.append(f"its times are to {tally.coarsest_ns / 1e9:g} s: response times mean nothing")
    return said


def _say(text: str) -> None:
    print(f"dalyshark import: {plain(text)}", file=sys.stderr)  # noqa: T201
