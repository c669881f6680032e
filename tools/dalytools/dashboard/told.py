# SPDX-License-Identifier: GPL-2.0-or-later
"""What one board told, by name, each with when that was. Only names that are shown are kept."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dalyref.values import Fields, Value

FAULT: Final = "daly.fault."
LEVEL: Final = "daly.level."
_WAITS: Final = 200  # newest response times that are looked at

_PACK: Final = "pack.voltage pack.current soc power state remaining_capacity cycles charger load"
_SWITCHES: Final = "mos.charge mos.discharge mos.precharge heater fan balance.mask balance.cell balance.state"
_TABLES: Final = "cells.voltage cells.min cells.max sensors.temperature"
_EXTREMES: Final = "cell.min_voltage cell.max_voltage temperature.min temperature.max"
_HEAT: Final = "temperature.mos temperature.board temperature.heater"
KEPT: Final = frozenset(
    f"daly.{name}" for names in (_PACK, _SWITCHES, _TABLES, _EXTREMES, _HEAT) for name in names.split()
)
"""Names of the values that a screen shows."""
STATES: Final = frozenset((f"{FAULT}mos_off_by_command", f"{FAULT}charging_cabinet_offline"))
"""Bits of reply 98 that are states, not faults (docs/protocol.md)."""


@dataclass(frozen=True, slots=True)
class Told:
    """One value, or several, and when it was heard (s, monotonic clock)."""

    value: Value | list[Value]
    at: float

    @property
    def all(self) -> list[Value]:
        """The values as a list."""
        return self.value if isinstance(self.value, list) else [self.value]

    @property
    def number(self) -> float:
        """The value, where it is a number."""
        return float(self.value) if isinstance(self.value, int | float) else 0.0


@dataclass(slots=True)
class BoardTold:
    """One board, and how it answers."""

    name: str
    told: dict[str, Told] = field(default_factory=dict[str, Told])
    replies: int = 0
    waits: deque[float] = field(default_factory=lambda: deque[float](maxlen=_WAITS))
    """Newest response times, s."""
    heard_at: float = 0.0

    def take(self, fields: Fields, at: float) -> None:
        """Take the values of a reply."""
        if "daly.balance.mask" in fields:  # which cells is told by this reply alone: none is an answer too
            self.told.pop("daly.balance.cell", None)
        for name, value in fields.items():
            if name in KEPT or name.startswith((FAULT, LEVEL)):
                self.told[name] = Told(value, at)

    def late(self, fields: Fields, at: float) -> None:
        """Take what became known of a reply only later (a table whose end had to be waited for)."""
        for name in KEPT & fields.keys():
            known = self.told.get(name)
            if known is None or known.at < at:
                self.told[name] = Told(fields[name], at)

    def faults(self) -> list[str]:
        """Return the names of the faults that stand, without prefix; levels of CAN as ``name_level_N``."""
        standing: list[str] = []
        for name, told in self.told.items():
            if name.startswith(FAULT) and told.value is True and name not in STATES:
                standing.append(name.removeprefix(FAULT))
            elif name.startswith(LEVEL) and told.number > 0:
                standing.append(f"{name.removeprefix(LEVEL)}_level_{told.number:.0f}")
        return standing

    def faults_at(self) -> float | None:
        """When faults were last told, or that there are none; None: never."""
        return max((told.at for name, told in self.told.items() if name.startswith((FAULT, LEVEL))), default=None)

    def wait_ms(self, share: float) -> float | None:
        """Return the response time that `share` of the newest do not exceed, ms."""
        if not self.waits:
            return None
        ordered = sorted(self.waits)
        return 1000 * ordered[min(len(ordered) - 1, int(share * len(ordered)))]
