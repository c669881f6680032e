# SPDX-License-Identifier: GPL-2.0-or-later
"""What can't be proven on pseudo-terminals, tried on one real adapter with its output joined to its input.

    computer --> adapter TX --+
                              | jumper
    computer <-- adapter RX --+

Each check says what was expected, what was found, and a verdict; where a driver does not tell, that is the verdict.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.line import Counts, ModemState

FINE, WRONG, UNKNOWN = "ok", "NOT OK", "not known"

_PATTERN: Final = bytes(range(256))
_ROUNDS: Final = 40
_PATIENCE_S: Final = 1.0
_SLOW_MS: Final = 5.0
"""An adapter that holds bytes back longer than this should be asked for low latency."""


class Loop(Protocol):
    """An open port whose output comes back as its input."""

    baud: int

    def write(self, data: bytes, /) -> None:
        """Send; returns when the last bit has left, as far as the driver tells."""
        ...

    def read(self, count: int, timeout_s: float, /) -> bytes:
        """Return up to so many bytes, fewer when the time is over."""
        ...

    def send_break(self) -> None:
        """Hold the line low for a quarter of a second."""
        ...

    def set_lines(self, *, rts: bool, dtr: bool) -> None:
        """Set both outputs."""
        ...

    def modem_state(self) -> ModemState | None:
        """Read both outputs back; None: the driver does not tell."""
        ...

    def counts(self) -> Counts | None:
        """Read the driver's counters; None: it has none."""
        ...

    def latency_ms(self) -> float | None:
        """Read the latency timer that the system states; None: it states none."""
        ...


@dataclass(frozen=True, slots=True)
class Check:
    """One line of the report."""

    what: str
    expected: str
    found: str
    verdict: str


def run(loop: Loop) -> Iterator[Check]:
    """Try everything, one after the other; a jumper that is not there ends it."""
    jumper = _jumper(loop)
    yield jumper
    if jumper.verdict == WRONG:
        return
    yield _every_byte(loop)
    yield from _latency(loop)
    yield from _counters(loop)
    yield from _lines(loop)


def _jumper(loop: Loop) -> Check:
    loop.read(4096, 0.05)  # what lies there
    loop.write(b"\xa5\x5a")
    heard = loop.read(2, _PATIENCE_S)
    verdict = FINE if heard == b"\xa5\x5a" else WRONG
    found = heard.hex(" ") or "nothing: is the jumper in place?"
    return Check("what is sent comes back", "a5 5a", found, verdict)


def _every_byte(loop: Loop) -> Check:
    loop.write(_PATTERN)
    heard = loop.read(len(_PATTERN), _PATIENCE_S + len(_PATTERN) * 10 / loop.baud)
    wrong = sum(one != other for one, other in zip(heard, _PATTERN, strict=False)) + abs(len(_PATTERN) - len(heard))
    return Check("all 256 values of a byte", "256 right", f"{256 - wrong} right", WRONG if wrong else FINE)


def _latency(loop: Loop) -> Iterator[Check]:
    """How long a byte takes beyond its time on the wire: what the adapter holds it back."""
    held: list[float] = []
    for _ in range(_ROUNDS):
        began = time.monotonic()
        loop.write(b"\x55")
        if loop.read(1, _PATIENCE_S) == b"\x55":
            held.append((time.monotonic() - began - 10 / loop.baud) * 1000)
    stated = loop.latency_ms()
    told = f"{stated:g} ms" if stated is not None else "nothing"
    if len(held) < _ROUNDS:
        yield Check("a byte on its way", f"{_ROUNDS} of {_ROUNDS}", f"{len(held)} of {_ROUNDS}", WRONG)
        return
    middle, worst = statistics.median(held), max(held)
    verdict = UNKNOWN if stated is None else FINE if worst <= stated + 5 else WRONG
    found = f"median {max(middle, 0):.1f} ms, worst {max(worst, 0):.1f} ms"
    yield Check("held back by the adapter", f"the system states {told}", found, verdict)
    if middle > _SLOW_MS:
        yield Check("times of records", f"at most {_SLOW_MS:g} ms held back", "capture with --low-latency", WRONG)


def _counters(loop: Loop) -> Iterator[Check]:
    before = loop.counts()
    if before is None:
        yield Check("error counters (TIOCGICOUNT)", "counted", "the driver has none", UNKNOWN)
        return
    loop.write(_PATTERN)
    loop.read(len(_PATTERN), _PATIENCE_S + len(_PATTERN) * 10 / loop.baud)
    after = loop.counts() or before
    received = after.since(before).rx
    yield Check("characters counted", "256", str(received), FINE if received == len(_PATTERN) else WRONG)
    loop.send_break()
    loop.read(16, 0.5)
    errors = (loop.counts() or after).since(after)
    seen = errors.breaks + errors.frame
    yield Check("a break is counted", "1 or more", str(errors) or "nothing", FINE if seen else WRONG)


def _lines(loop: Loop) -> Iterator[Check]:
    if loop.modem_state() is None:
        yield Check("RTS and DTR", "as set", "the driver does not tell", UNKNOWN)
        return
    for rts, dtr in ((True, True), (False, False)):
        loop.set_lines(rts=rts, dtr=dtr)
        state = loop.modem_state()
        expected = f"RTS {'on' if rts else 'off'}, DTR {'on' if dtr else 'off'}"
        verdict = FINE if state is not None and (state.rts, state.dtr) == (rts, dtr) else WRONG
        yield Check("RTS and DTR", expected, str(state), verdict)
