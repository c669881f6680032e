# SPDX-License-Identifier: GPL-2.0-or-later
"""Write the outputs in docs/statistics.md again: each stands behind the comment that says what was run.

python docs/make_statistics.py [FILE]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from dalytools.tshark import Tshark

HERE = Path(__file__).parent
PAGE = HERE / "statistics.md"
SAMPLES = HERE.parent / "pcap_samples"


def output(tshark: Tshark, report: str, sample: str) -> str:
    """Return what tshark prints, as an indented block of Markdown."""
    done = tshark.run("-q", "-z", report, "-r", str(tshark.readable(SAMPLES / sample)))
    lines = done.stdout.decode().splitlines()
    return "".join(f"    {line}".rstrip() + "\n" for line in lines)


def page(tshark: Tshark, text: str) -> str:
    """Return the page with all outputs made anew."""
    return re.sub(
        r"(<!-- run: (\S+) (\S+) -->\n)(?:\n(?: {4}.*)?)*\n*",
        lambda found: f"{found[1]}\n{output(tshark, found[2], found[3])}\n",
        text,
    )


def main() -> None:
    """Write the page to the file named, or to docs/statistics.md."""
    with Tshark() as tshark:
        text = page(tshark, PAGE.read_text(encoding="utf-8"))
    Path(*sys.argv[1:] or (PAGE,)).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
