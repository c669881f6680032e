# SPDX-License-Identifier: GPL-2.0-or-later
"""Every Wireshark there is: this machine's own, and those that ``make matrix`` fetched."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Iterator

_FETCHED = Path(__file__).resolve().parents[1] / ".cache" / "wireshark"


def programs() -> list[str]:
    """Return the tshark programs, this machine's own as an empty word, first."""
    return ["", *sorted(str(path) for path in _FETCHED.glob("*/tshark") if os.access(path, os.X_OK))]


def each() -> Iterator[Tshark]:
    """Start one after the other."""
    for program in programs():
        if program:
            os.environ["DALYSHARK_TSHARK"] = program
        with Tshark() as tshark:
            yield tshark
