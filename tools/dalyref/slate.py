# SPDX-License-Identifier: GPL-2.0-or-later
"""The fields of a record to which later records may still add something."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dalyref.bursts import Burst
    from dalyref.values import Fields


class Owner(Protocol):
    """The bus of a record, which knows when it is settled."""

    now_ns: int
    """The latest beginning of a record on this bus."""

    def settle(self, slate: Slate, latest_ns: int) -> None:
        """Nothing more shall come to this record: its time is over, or the capture.

        latest_ns: when the latest packet of the capture began.
        """
        ...


@dataclass(slots=True, eq=False)
class Slate:
    """The fields of one record, and until when something may be added to them."""

    fields: Fields
    bus: Owner
    open_until_ns: int = 0
    """A record of this bus that begins later settles it; 0: settled."""
    asks: bool = False
    """It is a request that nobody has answered."""
    burst: Burst[Slate] | None = None
    """The burst it is a part of, while that may still say something of it."""

    def waits_until(self) -> int:
        """Return when it is settled by time, ns; 0: it is settled."""
        return self.burst.open_until_ns if self.burst is not None else self.open_until_ns

    def close(self) -> None:
        """Nothing more comes to it."""
        self.open_until_ns = 0
        self.burst = None
