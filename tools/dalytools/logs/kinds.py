# SPDX-License-Identifier: GPL-2.0-or-later
"""All kinds of log, and which one a file is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalytools.logs.candump import CanDump
from dalytools.logs.comtool import ComTool
from dalytools.logs.dalybms import DalyBms
from dalytools.logs.docklight import Docklight
from dalytools.logs.esphome import EspHome
from dalytools.logs.hexdump import HexDump
from dalytools.logs.hexlines import HexLines
from dalytools.logs.nrfconnect import NrfConnect
from dalytools.logs.saleae import Saleae
from dalytools.logs.serialbattery import SerialBattery
from dalytools.logs.sigrok import Sigrok

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalytools.logs.entry import LineLog

RAW: Final = "raw"
RAW_ABOUT: Final = "the bytes of a port, one after the other, no times"

KINDS: Final[dict[str, Callable[[], LineLog]]] = {
    kind.name: kind
    for kind in (
        EspHome,
        CanDump,
        NrfConnect,
        SerialBattery,
        DalyBms,
        Saleae,
        Sigrok,
        ComTool,
        Docklight,
        HexDump,
        HexLines,
    )
}
"""Those that are most particular first: of two that understand a log as well, the first is it."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A kind, and how many of the lines looked at fit it, out of how many."""

    name: str
    fit: int
    lines: int


def guess(lines: list[str]) -> Guess | None:
    """Guess a log's kind from its first lines: the one that understands most of them; None where none finds a byte."""
    best: Guess | None = None
    best_score = 0
    for name, made in KINDS.items():
        log = made()
        log.look(lines)
        found = fit = 0
        for line in lines:
            entries = log.parse(line)
            found += bool(entries)
            fit += entries is not None
        found += bool(log.finish())
        score = 4 * found + fit
        if name == HexDump.name and found and fit == len(lines) > 1:  # offsets that all fit are none by chance
            score = 6 * fit
        if found and score > best_score:
            best, best_score = Guess(name, fit, len(lines)), score
    return best
