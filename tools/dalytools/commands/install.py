# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark install``: dissector, profile and capture tool into this user's Wireshark folders.

Exit status: 0 all is in place, 1 a file was kept that you changed, 2 could not be done.
"""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING

from dalytools.extcap_wrapper import answers
from dalytools.installation import PROFILE, Done, Installation, Step
from dalytools.problem import Problem
from dalytools.terminal_text import plain
from dalytools.wireshark_folders import WiresharkFolders, wireshark_folders

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Put the dissector (one file), the profile and the capture tool into the personal folders of the Wireshark "
        "that is found, and see that all works. A file that you changed is overwritten only after you said yes."
    )
    parser.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")
    parser.add_argument("--force", action="store_true", help="overwrite without asking")


def run(args: argparse.Namespace) -> int:
    """Install; print a line a file, and how to go on."""
    folders = wireshark_folders()
    if not folders.lua:
        raise Problem(f"{folders.program} was built without Lua and can load no dissector; take another build")
    installation = Installation(folders, ask=asker(force=args.force), dry_run=args.dry_run)
    done = installation.install()
    say(done, dry_run=args.dry_run)
    for path in installation.others():
        print(f"note: {plain(str(path))} is a dissector of ours too; remove it, only one is loaded")  # noqa: T201
    if args.dry_run:
        return 0
    if any(each.step in (Step.KEEP, Step.LEAVE) for each in done):
        return 1
    prove(folders)
    well, said = answers(installation.tool)
    if not well:
        raise Problem(f"installed, but {said}")
    print(  # noqa: T201
        f"tshark {folders.version} loads it. In Wireshark choose the profile {PROFILE!r} "
        "(4.4 and later choose it by themselves). Its list of interfaces has 'Daly BMS', to capture from."
    )
    return 0


def asker(*, force: bool) -> Callable[[str], bool]:
    """Return who answers questions: always yes, the terminal, or (no terminal) always no."""

    def ask(question: str) -> bool:
        if force:
            return True
        if not sys.stdin.isatty():
            return False
        print(f"{plain(question)} [y/N] ", end="", flush=True)  # noqa: T201
        return sys.stdin.readline().strip().lower() in {"y", "yes"}

    return ask


def say(done: list[Done], *, dry_run: bool) -> None:
    """Print what was done, a line a file."""
    for each in done:
        print(f"{'would ' if dry_run and each.step in _ACTIONS else ''}{each.step}: {plain(str(each.path))}")  # noqa: T201


_ACTIONS = (Step.WRITE, Step.REPLACE, Step.REMOVE)


def prove(folders: WiresharkFolders) -> None:
    """See that tshark has our protocol. Raises Problem where it has not, with what is known of why."""
    done = subprocess.run(  # noqa: S603 - our words, no shell
        [folders.program, "-G", "protocols"], capture_output=True, timeout=60, check=False, stdin=subprocess.DEVNULL
    )
    if any(line.split("\t")[-1:] == ["daly"] or "\tdaly" in line for line in done.stdout.decode().splitlines()):
        return
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        raise Problem("installed, but Wireshark 4.2 and later load no plugins for root; start it as an ordinary user")
    messages = plain(" ".join(done.stderr.decode(errors="replace").split()))[:200]
    raise Problem(
        f"installed, but {folders.program} does not load it: {messages or 'no message'}; is Lua switched off?"
    )
