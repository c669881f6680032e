# SPDX-License-Identifier: GPL-2.0-or-later
"""Which of the eight data bytes of A5 (serial line, classic CAN) are kept, by data ID (docs/protocol.md, a).

    reply 61 (clock)     | YY MM DD hh mm ss | -  - |       clock: blanked; the rest may be stale
    reply 57 (code)      | n | c c c c c c c        |       frame number kept, characters blanked
    request 17 (write)   | n | c c c c c c c        |       write = read - 40: as the reply
    request 90           | -  -  -  -  -  -  -  -   |       means nothing: 00, FF and AA stay

A byte that nobody explains is not kept, and what no row names may be stale: left from a reply before (``stale``).
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

from dalyref import alarms, bursts, settings, texts, writes
from dalytools.redact.what import TEXTS, What, named

if TYPE_CHECKING:
    from collections.abc import Iterable

SIZE: Final = 8


class Span(NamedTuple):
    """Some bytes, and what they are to be blanked as; None: they are kept."""

    first: int
    last: int
    what: What | None

    @property
    def text(self) -> bool:
        """Tell whether a text is blanked."""
        return self.what in TEXTS


_PAPER: Final = {0x90: 8, 0x91: 6, 0x92: 4, 0x93: 8, 0x94: 7, 0x97: 6, 0x98: 8}
"""Data bytes with a meaning, from the first, in replies of the vendor's paper; 95 and 96: ``slots``."""
_DATE: Final = 0x58  # no layout is known
_WRITE_ID: Final = range(0x10, 0x2B)
_READ: Final = 0x40
_PADDING: Final = frozenset((0x00, 0xFF, 0xAA))


@cache
def reply(data_id: int) -> tuple[Span, ...]:
    """Return the spans of a reply, over all eight bytes. Of 95 and 96 the slots count as stale: see ``slots``."""
    if data_id in _PAPER:
        return _filled([Span(0, _PAPER[data_id] - 1, None)])
    if data_id in bursts.IDS:
        if data_id in texts.FIELDS:
            return (Span(0, 0, None), Span(1, 7, named(texts.FIELDS[data_id].removeprefix("daly."))))
        return _filled([Span(0, 0, None)])
    if data_id in alarms.IDS:
        return (Span(0, 7, None),)
    if data_id in writes.SWITCHES or data_id == writes.SET_CLOCK:
        return _filled([Span(0, 0, None)])
    if data_id == _DATE:
        return (Span(0, 7, What.PRODUCTION_DATE),)
    if data_id in _WRITE_ID:
        return reply(data_id + _READ)
    if data_id in settings.TABLE:
        return _filled(Span(first, last, named(name)) for first, last, name, _ in settings.TABLE[data_id])
    return (Span(0, 7, What.UNKNOWN),)


@cache
def request(data_id: int) -> tuple[Span, ...]:
    """Return the spans of a request that writes; of one that reads, or that nobody knows, none."""
    if data_id == writes.SET_CLOCK:
        return (Span(0, 5, What.CLOCK), Span(6, 7, None))
    if data_id in writes.SWITCHES:
        return (Span(0, 0, None), Span(1, 7, What.UNKNOWN))
    if data_id in _WRITE_ID:
        return tuple(
            span._replace(what=What.UNKNOWN) if span.what is What.STALE else span for span in reply(data_id + _READ)
        )
    return ()


def padding(data: bytes) -> bool:
    """Tell whether the bytes of a request to read are what programs pad with."""
    return _PADDING.issuperset(data)


def _filled(spans: Iterable[Span]) -> tuple[Span, ...]:
    """Put stale spans where no span is."""
    out: list[Span] = []
    at = 0
    for span in sorted(spans):
        if span.first > at:
            out.append(Span(at, span.first - 1, What.STALE))
        out.append(span)
        at = span.last + 1
    if at < SIZE:
        out.append(Span(at, SIZE - 1, What.STALE))
    return tuple(out)
