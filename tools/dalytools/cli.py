# SPDX-License-Identifier: GPL-2.0-or-later
"""The ``dalyshark`` command: one subcommand a module of ``dalytools.commands``, loaded only when it is called."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import signal
import sys
from typing import TYPE_CHECKING, NoReturn

from dalytools import __version__
from dalytools.problem import Problem
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import FrameType

COMMANDS = {
    "watch": "sniff a bus, write the capture file, show every record decoded as it comes",
    "capture": "sniff a bus to a file or a pipe",
    "decode": "show what the reference decoder reads in a capture",
    "check": "hold the Wireshark dissector against the reference decoder",
    "report": "a page with plots and tables, in one file that opens offline",
    "survey": "which IDs and registers were seen, which bytes move, and with what",
    "redact": "a copy fit to be shown to others: codes, numbers, passwords, names and dates blanked",
    "reframe": "cut an old capture, or a raw log, into records again",
    "import": "a log of another tool becomes a capture",
    "install": "dissector, profile and capture tool into Wireshark's personal folders",
    "uninstall": "take them away again",
    "doctor": "what is there, what is missing, and how to get it",
    "selftest": "try one adapter with a jumper: the only command that transmits, and it asks",
    "simulate": "a bus with boards and a host on pseudo-terminals",
}

MODULES = {"import": "import_log"}
"""Those that can't be named as their command: Python has the word."""

EXIT_PROBLEM = 2


class _Parser(argparse.ArgumentParser):
    """argparse, but an unusable command line is one line of what is wrong and one of what to do."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_PROBLEM, f"{self.prog}: {plain(message)}\nTry: {self.prog} --help\n")


def _top_parser() -> _Parser:
    width = max(map(len, COMMANDS))
    listing = "\n".join(f"  {name:<{width}}  {text}" for name, text in COMMANDS.items())
    parser = _Parser(
        prog="dalyshark",
        description="See what a Daly battery management system says on its bus.",
        epilog=f"commands:\n{listing}\n\ndalyshark COMMAND --help tells more about one of them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"dalyshark {__version__}")
    parser.add_argument("command", metavar="COMMAND", choices=list(COMMANDS), help=argparse.SUPPRESS)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; return its exit status (0 fine, 1 findings, 2 could not run)."""
    words = list(sys.argv[1:] if argv is None else argv)
    top = _top_parser()
    if not words:
        top.print_help()
        return EXIT_PROBLEM
    command: str = top.parse_args(words[:1]).command
    module = importlib.import_module(f"dalytools.commands.{MODULES.get(command, command)}")
    parser = _Parser(prog=f"dalyshark {command}", allow_abbrev=False)
    add_arguments: Callable[[argparse.ArgumentParser], None] = module.add_arguments
    run: Callable[[argparse.Namespace], int] = module.run
    add_arguments(parser)
    try:
        status = run(parser.parse_args(words[1:]))
        sys.stdout.flush()
    except Problem as problem:
        _let_output_go()
        return _failed(command, str(problem))
    except BrokenPipeError:  # the reader of our standard output went away: `dalyshark decode ... | head`
        _let_output_go()
        return 0
    except OSError as error:  # what a command did not foresee, and a full disk behind `> file`
        _let_output_go()
        return _failed(command, f"{error.filename or 'standard output'}: {error.strerror or error}")
    except KeyboardInterrupt:
        _let_output_go()
        return 128 + signal.SIGINT
    return status


def _failed(command: str, why: str) -> int:
    print(f"dalyshark {command}: {plain(why)}", file=sys.stderr)  # noqa: T201
    return EXIT_PROBLEM


def _let_output_go() -> None:
    """Write what is left for standard output, to nowhere if it must be: nothing is to fail at the interpreter's end."""
    try:
        sys.stdout.flush()
    except OSError:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _stop(number: int, _frame: FrameType | None) -> NoReturn:
    """End in order: temporary folders are removed, children are waited for."""
    raise SystemExit(128 + number)


def _three_streams() -> None:
    """Make standard input, output and error be there (``>&-``), else the next file opened would take their number."""
    for fd in range(3):
        try:
            os.fstat(fd)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - open to the end
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115, PTH123 - open to the end


def entry() -> NoReturn:
    """Console script."""
    _three_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal that knows less than a comment holds
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _stop)
    sys.exit(main())
