# SPDX-License-Identifier: GPL-2.0-or-later
"""How large to measure. The defaults are what bench/README.md reports."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Options:
    """frames: in a capture; seconds: on the bus; repeat: times each side is measured, in turn; faults: put in."""

    frames: int = 1_000_000
    seconds: float = 60.0
    repeat: int = 3
    faults: int = 50_000
