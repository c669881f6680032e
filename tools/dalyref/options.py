# SPDX-License-Identifier: GPL-2.0-or-later
"""The constants of the reading (docs/records.md): times on the wire, and tolerances."""

from __future__ import annotations

from dataclasses import dataclass

NANO = 1_000_000_000
TOLERANCE_NS = 1_000
"""A difference within a microsecond of a limit is inside it (docs/records.md, section 1)."""
BITS_A_CHARACTER = 10
"""8N1: start, eight data bits, stop."""


@dataclass(frozen=True, slots=True)
class Options:
    """What can be set, with the defaults that the dissector has too. Times in seconds."""

    baud: int = 9600
    quiet: float = 0.250
    """An incomplete frame is given up after so long a silence."""
    echo: float = 0.100
    """A repeat that starts within this, after the original's end, is an echo."""
    reply: float = 1.0
    """A request waits so long for its reply."""
    burst: float = 0.500
    """A burst ends after so long a silence."""
    late: float = 10.0
    """A reply that its request waited for no longer, but that starts within this, is late."""
    age: float = 10.0
    """Records further apart than this do not contradict each other."""
    cell_tolerance: float = 20
    """91 against the cells of 95, mV."""
    temperature_tolerance: float = 2
    """92 against the sensors of 96, C."""
    sum_tolerance: float = 1
    """Pack voltage against the sum of the cells, %."""
    soc_tolerance: float = 1
    """SOC as A5 tells it against SOC as Modbus does, %."""

    def characters_ns(self, count: int) -> int:
        """Return how long `count` characters take on the wire, in ns."""
        return (count * BITS_A_CHARACTER * NANO + self.baud // 2) // self.baud

    @staticmethod
    def limit_ns(seconds: float) -> int:
        """Return the largest difference, in ns, that is still within `seconds`."""
        return round(seconds * NANO) + TOLERANCE_NS
