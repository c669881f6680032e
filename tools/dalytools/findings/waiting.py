# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests that nobody answered, while they wait: a reply given to a newer one may have been meant for them.

43 asked | 40 asked | reply of board 4        it goes to 40, which takes any board's (docs/records.md 7)
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Generic, TypeVar

_MOST = 1024
_WAITS_NS = 1_020_000_000
"""1 s from a request's end."""

Key = TypeVar("Key")
Who = TypeVar("Who")


class Waiting(Generic[Key, Who]):
    """The newest unanswered request of each kind; of many kinds those that were asked for last."""

    def __init__(self) -> None:
        self._newest: OrderedDict[Key, tuple[int, Who]] = OrderedDict()

    def ask(self, kind: Key, time_ns: int, who: Who) -> None:
        """Take a request that will get no answer, by whom or of whom."""
        self._newest[kind] = time_ns, who
        self._newest.move_to_end(kind)
        if len(self._newest) > _MOST:
            self._newest.popitem(last=False)

    def at(self, kind: Key, time_ns: int) -> Who | None:
        """Return who waits at that time, None: nobody."""
        found = self._newest.get(kind)
        return found[1] if found is not None and 0 <= time_ns - found[0] <= _WAITS_NS else None
