# SPDX-License-Identifier: GPL-2.0-or-later
"""``make bench``: what our programs cost beside named peers, measured in the same run. Exit 1 if a goal is missed."""

from __future__ import annotations

import argparse
import importlib
import os
import platform
import sys
from typing import TYPE_CHECKING, cast

from bench.options import Options
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.table import Result

NAMES = ("dissector", "wires", "reference", "bulk", "commands", "sniffer", "evidence", "replug", "files", "recall")


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def main() -> int:
    """Run the measurements that are named, or all."""
    default = Options()
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    parser.add_argument("names", metavar="NAME", nargs="*", help=f"one or more of {', '.join(NAMES)}; default: all")
    parser.add_argument("--frames", type=_positive, default=default.frames, help="frames in a capture (%(default)s)")
    parser.add_argument("--seconds", type=_positive, default=default.seconds, help="time on the bus (%(default)g)")
    parser.add_argument("--repeat", type=_positive, default=default.repeat, help="times each side runs (%(default)s)")
    parser.add_argument("--faults", type=_positive, default=default.faults, help="put in for recall (%(default)s)")
    args = parser.parse_args()
    unknown = [name for name in args.names if name not in NAMES]
    if unknown:
        parser.error(f"there is no measurement {unknown[0]}; there are {', '.join(NAMES)}")
    options = Options(args.frames, float(args.seconds), args.repeat, args.faults)
    system = (
        platform.freedesktop_os_release().get("PRETTY_NAME", "") if sys.platform == "linux" else platform.platform()
    )
    load = ", ".join(f"{average:.1f}" for average in os.getloadavg())
    print(f"{os.cpu_count()} cores, {system}, Python {platform.python_version()}, load {load}, repeat {args.repeat}\n")
    missed = 0
    for name in args.names or NAMES:
        measure = cast("Callable[[Options], list[Result]]", importlib.import_module(f"bench.{name}").measure)
        try:
            for result in measure(options):
                print(result, end="\n\n", flush=True)
                missed += sum(not goal.met for goal in result.goals)
        except Problem as problem:
            print(f"bench {name}: {problem}", file=sys.stderr)
            return 2
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
