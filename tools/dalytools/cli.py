# SPDX-License-Identifier: GPL-2.0-or-later
"""The ``dalyshark`` command: one subcommand a module of ``dalytools.commands``, loaded only when it is called."""

from __future__ import annotations

import argparse
import importlib
import os
import signal
import sys
from typing import TYPE_CHECKING, NoReturn

from dalytools import __version__
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

COMMANDS = {
    "watch": "sniff a bus, write the capture file, show every record decoded as it comes",
    "capture": "sniff a bus to a file or a pipe",
    "decode": "show what the reference decoder reads in a capture",
    "check": "hold the Wireshark dissector against the reference decoder",
    "simulate": "a bus with boards and a host on pseudo-terminals",
}

EXIT_PROBLEM = 2


class _Parser(argparse.ArgumentParser):
    """argparse, but an unusable command line is one line of what is wrong and one of what to do."""

    def error(self, message: str) -> NoReturn:
        self.exit(EXIT_PROBLEM, f"{self.prog}: {message}\nTry: {self.prog} --help\n")


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
    module = importlib.import_module(f"dalytools.commands.{command}")
    parser = _Parser(prog=f"dalyshark {command}", allow_abbrev=False)
    add_arguments: Callable[[argparse.ArgumentParser], None] = module.add_arguments
    run: Callable[[argparse.Namespace], int] = module.run
    add_arguments(parser)
    try:
        return run(parser.parse_args(words[1:]))
    except Problem as problem:
        print(f"dalyshark {command}: {problem}", file=sys.stderr)  # noqa: T201
        return EXIT_PROBLEM
    except BrokenPipeError:  # the reader of our standard output went away: `dalyshark decode ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        return 128 + signal.SIGINT


def entry() -> NoReturn:
    """Console script."""
    sys.exit(main())
