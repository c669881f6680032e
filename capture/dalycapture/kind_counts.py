# SPDX-License-Identifier: GPL-2.0-or-later
"""Records counted by kind, and what of them is good, bad and junk."""

from __future__ import annotations

from collections import Counter

from dalyref.kinds import Kind


class KindCounts(Counter[Kind]):
    """How many records of each kind."""

    @property
    def good(self) -> int:
        """Frames with right checksum."""
        return self[Kind.FRAME]

    @property
    def bad(self) -> int:
        """Damaged Daly frames, whole or cut off."""
        return self[Kind.BAD_CHECKSUM] + self[Kind.SHORT]

    @property
    def junk(self) -> int:
        """Records that are no Daly frame at all."""
        return self[Kind.JUNK] + self[Kind.FOREIGN]
