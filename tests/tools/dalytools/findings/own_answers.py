# SPDX-License-Identifier: GPL-2.0-or-later
"""Which request each reply of an ID answers: docs/records.md 6 to 8 read once more, for A5 alone, on whole packets."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.findings.heard import A5_SIZE, BURST_QUIET_S, BURSTS, CLOCK_S, WAITS_S, between

if TYPE_CHECKING:
    from tests.tools.dalytools.findings.heard import Frame

ECHO_S = 0.1
LAST_NUMBER = {0x95: 16, 0x96: 3}
LOOKS_BACK_S = 5.0


def answers(heard: list[Frame], data_id: int, first: float, last: float) -> dict[Frame, Frame]:
    """Return the reply that each request in that time was given, its first; a request without one is left out."""
    given: dict[Frame, Frame] = {}
    waiting: list[Frame] = []
    newest: dict[tuple[int, bytes], Frame] = {}
    echoed: set[Frame] = set()
    burst: Frame | None = None
    for frame in between(heard, first - LOOKS_BACK_S, last + WAITS_S + 0.1):
        waiting = [request for request in waiting if frame.seconds <= request.ends + WAITS_S + CLOCK_S]
        if frame.asks and frame.data_id == data_id:
            before = newest.get((frame.address, frame.payload))
            if before is not None and before in waiting and before not in echoed and _echoes(before, frame):
                echoed.add(before)
                continue
            newest[frame.address, frame.payload] = frame
            waiting.append(frame)
        elif frame.replies and frame.data_id != data_id:
            burst = None
        elif frame.replies and not _skipped(frame):
            asked = burst is not None and any(burst.seconds < request.seconds for request in newest.values())
            goes_on = burst is not None and _goes_on(burst, frame, asked=asked)
            burst = frame if data_id in BURSTS else None
            takers = [] if goes_on else [request for request in waiting if _takes(request.address, frame.address)]
            if takers:
                given[takers[-1]] = frame
                waiting.remove(takers[-1])
    return given


def _echoes(before: Frame, frame: Frame) -> bool:
    return frame.size == A5_SIZE and frame.seconds - before.ends <= ECHO_S + CLOCK_S


def _takes(asked: int, replies: int) -> bool:
    """Tell whether a request to that address takes a reply of that one: 41..4F are for one board."""
    return asked - 0x3F == replies or not 0x41 <= asked <= 0x4F


def _skipped(frame: Frame) -> bool:
    return frame.data_id in BURSTS and frame.payload[0] > LAST_NUMBER.get(frame.data_id, 0xFE)


def _goes_on(burst: Frame, frame: Frame, *, asked: bool) -> bool:
    """Tell whether a reply of the same ID is of the running burst. asked: there was a request since its last frame."""
    more = frame.payload[0] - burst.payload[0]
    quiet = frame.seconds - burst.ends > BURST_QUIET_S + CLOCK_S
    return frame.address == burst.address and not quiet and (more > 0 or (more == 0 and not asked))
