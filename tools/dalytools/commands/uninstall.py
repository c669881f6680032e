# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark uninstall``: what ``install`` put into Wireshark's folders is taken away again.

Exit status: 0 nothing of it is left, 1 a file was kept that you changed, 2 could not be done.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.commands.install import asker, say
from dalytools.installation import Installation, Step
from dalytools.wireshark_folders import wireshark_folders

if TYPE_CHECKING:
    import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Remove the dissector, the profile and the capture tool from Wireshark's personal folders. What you changed is "
        "asked for."
    )
    parser.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")
    parser.add_argument("--force", action="store_true", help="remove without asking")


def run(args: argparse.Namespace) -> int:
    """Uninstall; print a line a file."""
    done = Installation(wireshark_folders(), ask=asker(force=args.force), dry_run=args.dry_run).uninstall()
    say(done, dry_run=args.dry_run)
    if not done:
        print("nothing is installed")  # noqa: T201
    return 1 if any(each.step is Step.KEEP for each in done) and not args.dry_run else 0
