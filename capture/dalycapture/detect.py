# SPDX-License-Identifier: GPL-2.0-or-later
"""Find speed and character format of a bus by listening alone: where checksums come out right, they are right.

The port is opened once and set to one speed after the other. What is heard at each is a trial; ``judge`` reads them::

    good frames                               that speed
    and every other byte marked as bad        the format has a parity bit: 8E1 and 8O1 are tried
    no good frame, much of it FF in rows      A and B swapped (see below)
    no good frame, something else             other traffic, noise, or a speed that was not tried
    nothing                                   nobody speaks, or nothing is connected: not to be told apart

Swapped wires turn every bit round. A receiver then takes the stop bit (now low) for a start bit, and a byte 00, of
which every request has eight, for an FF. So a row of FF stands for the zeros of a request.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from dalycapture.errors import PortError
from dalycapture.marks import Unmarker
from dalycapture.waiting import Waiter
from dalyref.kinds import Kind
from dalyref.records import split

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dalycapture.port import Port
    from dalycapture.settings import Settings

SPEEDS: Final = (9600, 19200, 115200, 38400, 57600, 4800, 2400, 1200)
PARITIES: Final = ("8E1", "8O1")
ENOUGH_FRAMES: Final = 4
MOST_BYTES: Final = 20_000  # of a trial
SETTLING_S: Final = 0.05  # bytes that were on their way when the speed was changed
SURE: Final = 0.5  # of the bytes in good frames: no other speed comes near
FEW_ERRORS: Final = 0.02  # of the bytes
_INVERTED = re.compile(rb"\xff{5,}")


@dataclass(frozen=True, slots=True)
class Trial:
    """What was heard at one speed and format. marked: bytes with line errors; None: the driver does not mark them."""

    settings: Settings
    seconds: float
    data: bytes
    marked: int | None = None
    breaks: int = 0

    @property
    def good(self) -> tuple[int, int]:
        """Good frames, and the bytes in them."""
        frames = [record for record in split(self.data) if record.kind is Kind.FRAME]
        return len(frames), sum(len(record.data) for record in frames)

    @property
    def share(self) -> float:
        """Bytes in good frames, of all."""
        return self.good[1] / len(self.data) if self.data else 0.0

    @property
    def inverted(self) -> float:
        """Bytes in rows of FF, of all."""
        return sum(map(len, _INVERTED.findall(self.data))) / len(self.data) if self.data else 0.0

    def __str__(self) -> str:
        """Say it: ``9600 8N1: 412 bytes in 2.0 s, 31 good frames (98 % of the bytes)``."""
        name = f"{self.settings.baud} {self.settings.line_format}"
        if not self.data:
            return f"{name}: nothing in {self.seconds:.1f} s"
        marks = f", {self.marked} with line errors" if self.marked else ""
        frames, _ = self.good
        return (
            f"{name}: {len(self.data)} bytes in {self.seconds:.1f} s, {frames} good frames "
            f"({100 * self.share:.0f} % of the bytes){marks}"
        )


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the trials say. settings: to listen with; None: not found."""

    settings: Settings | None
    text: str


def listen(port: Port, settings: Settings, seconds: float, clock: Callable[[], float] = time.monotonic) -> Trial:
    """Listen at these settings until the time is over, or enough good frames were heard. Raises PortError."""
    unmarker = Unmarker()
    data, marked, breaks = bytearray(), 0, 0
    waiter = Waiter()
    waiter.watch(port.fileno(), read=True)
    started = now = clock()
    looked_at = 0
    while now - started < seconds and len(data) < MOST_BYTES:
        if port.fileno() in waiter.wait(seconds - (now - started)) and (raw := port.read()):
            now = clock()
            if now - started < SETTLING_S:
                continue
            if port.facts.marked:
                raw, bad, broken = unmarker.feed(raw)
                marked += len(bad)
                breaks += len(broken)
            data += raw
            if len(data) - looked_at >= 13 * ENOUGH_FRAMES:
                looked_at = len(data)
                trial = Trial(settings, now - started, bytes(data))
                if trial.good[0] >= ENOUGH_FRAMES and trial.share >= SURE:
                    break
        now = clock()
    return Trial(settings, now - started, bytes(data), marked if port.facts.marked else None, breaks)


def trials(
    port: Port,
    settings: Settings,
    *,
    seconds: float = 3.0,
    speeds: Sequence[int] = SPEEDS,
    listen: Callable[[Port, Settings, float], Trial] = listen,
) -> Iterator[Trial]:
    """Yield a trial of each speed, the likeliest first, until one is sure; then of parities, where it has errors.

    settings: what else is asked of the port. Raises PortError.
    """
    retune = tuner(port)
    for baud in speeds:
        tried = replace(settings, baud=baud, line_format="8N1")
        retune(tried)
        trial = listen(port, tried, seconds)
        yield trial
        if trial.share < SURE:
            continue
        if trial.marked and trial.marked > FEW_ERRORS * len(trial.data):
            for line_format in PARITIES:
                tried = replace(tried, line_format=line_format)
                retune(tried)
                yield listen(port, tried, seconds)
        return


def tuner(port: Port) -> Callable[[Settings], None]:
    """Return what changes speed and format of this port. Raises PortError where nothing does."""
    retune: Callable[[Settings], None] | None = getattr(port, "retune", None)
    if retune is None:
        raise PortError(f"{port.name}: only a serial device of this machine can be set to other speeds")
    return retune


def judge(done: Sequence[Trial]) -> Verdict:
    """Say what the trials mean."""
    best = max(done, key=lambda trial: (trial.share >= SURE, trial.share - _errors(trial), trial.good[0]))
    frames, _ = best.good
    if frames and best.share >= SURE:
        sure = "" if best.marked is not None else " Parity can not be told here: the driver does not mark line errors."
        return Verdict(best.settings, f"Found: {best}.{sure}")
    if frames >= 2:
        return Verdict(
            best.settings,
            f"Probably: {best}. The rest is damaged or other traffic: check ground, cable and terminators.",
        )
    if not any(trial.data for trial in done):
        seconds = sum(trial.seconds for trial in done)
        if any(trial.breaks for trial in done):
            return Verdict(None, "The line is held low (break): A and B swapped, or a driver that is stuck.")
        return Verdict(
            None,
            f"Silence: not a byte in {seconds:.0f} s at {len(done)} speeds. Nobody asks (a Daly board speaks only when "
            "asked), everyone sleeps, or the receiver is on the wrong pair: listening alone can not tell which.",
        )
    swapped = max(done, key=lambda trial: trial.inverted)
    if swapped.inverted >= 0.15:
        name = f"{swapped.settings.baud}"
        return Verdict(
            None, f"A and B look swapped: at {name} baud the bytes are those of inverted requests. Swap them."
        )
    most = max(len(trial.data) for trial in done)
    return Verdict(
        None,
        f"Something is on the line (up to {most} bytes in a trial), and at no speed is it Daly's: noise, another "
        "protocol, or A and B swapped on a wire that only carries replies.",
    )


def _errors(trial: Trial) -> float:
    return (trial.marked or 0) / len(trial.data) if trial.data else 0.0
