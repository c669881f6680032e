# SPDX-License-Identifier: GPL-2.0-or-later
"""What cells are made of: voltage over charge, and the limits that a board of that chemistry is set to.

lfp   3.2 V   lithium iron phosphate: steep ends, a flat middle
nmc   3.7 V   "ternary" in the vendor's words: a slope
lto   2.3 V   lithium titanate: a gentle slope
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Final, TypeAlias

# Fault           quantity       level 1, level 2, back by     stops
Limit: TypeAlias = tuple[str, str, float, float, float, str]

_NOT_BY_VOLTAGE: Final[tuple[Limit, ...]] = (
    ("chg_temp_high", "max_c", 50, 55, 3, "charge"),
    ("chg_temp_low", "min_c", 2, 0, 3, "charge"),
    ("dischg_temp_high", "max_c", 60, 65, 3, "discharge"),
    ("dischg_temp_low", "min_c", -15, -20, 3, "discharge"),
    ("chg_overcurrent", "charge_c", 1.0, 1.2, 0.1, ""),
    ("dischg_overcurrent", "discharge_c", 1.5, 2.0, 0.1, ""),
    ("soc_low", "soc", 10, 5, 2, ""),
    ("diff_volt", "difference_mv", 300, 500, 30, ""),
    ("diff_temp", "difference_c", 15, 20, 2, ""),
)


@dataclass(frozen=True, slots=True)
class Chemistry:
    """``open_circuit``: volts of a cell at rest by its charge in percent. All limits in mV of one cell."""

    code: int  # as the board tells it: 0 LFP, 1 ternary, 2 LTO (field notes a.2, 0x53)
    nominal_mv: int
    empty_mv: int  # a load ends here
    full_mv: int  # a charger ends here
    balance_start_mv: int
    open_circuit: tuple[tuple[float, float], ...]
    by_voltage: tuple[Limit, ...]
    by_permille: list[float] = field(init=False, repr=False, compare=False)  # volts at 0, 0.1 .. 100 %

    def __post_init__(self) -> None:
        table: list[float] = []
        for (low, volts), (high, more) in itertools.pairwise(self.open_circuit):
            steps = round((high - low) * 10)
            table += [volts + (more - volts) * step / steps for step in range(steps)]
        last = self.open_circuit[-1][1]
        object.__setattr__(self, "by_permille", [*table, last, last])

    @property
    def limits(self) -> tuple[Limit, ...]:
        """All limits that the board watches."""
        return self.by_voltage + _NOT_BY_VOLTAGE


CHEMISTRIES: Final = {
    "lfp": Chemistry(
        code=0,
        nominal_mv=3200,
        empty_mv=2850,
        full_mv=3590,
        balance_start_mv=3400,
        open_circuit=(
            (0.0, 2.500),
            (2.0, 2.850),
            (5.0, 3.030),
            (10.0, 3.150),
            (20.0, 3.225),
            (30.0, 3.262),
            (40.0, 3.284),
            (50.0, 3.293),
            (60.0, 3.304),
            (70.0, 3.326),
            (80.0, 3.334),
            (90.0, 3.346),
            (95.0, 3.368),
            (98.0, 3.425),
            (100.0, 3.560),
        ),
        by_voltage=(
            ("cell_volt_high", "max_mv", 3600, 3650, 50, "charge"),
            ("cell_volt_low", "min_mv", 2900, 2700, 100, "discharge"),
            ("sum_volt_high", "mean_mv", 3580, 3630, 30, "charge"),
            ("sum_volt_low", "mean_mv", 2950, 2800, 50, "discharge"),
        ),
    ),
    "nmc": Chemistry(
        code=1,
        nominal_mv=3700,
        empty_mv=3150,
        full_mv=4180,
        balance_start_mv=4000,
        open_circuit=(
            (0.0, 3.000),
            (2.0, 3.200),
            (5.0, 3.380),
            (10.0, 3.470),
            (20.0, 3.560),
            (30.0, 3.605),
            (40.0, 3.645),
            (50.0, 3.695),
            (60.0, 3.770),
            (70.0, 3.860),
            (80.0, 3.955),
            (90.0, 4.060),
            (95.0, 4.110),
            (100.0, 4.170),
        ),
        by_voltage=(
            ("cell_volt_high", "max_mv", 4200, 4250, 50, "charge"),
            ("cell_volt_low", "min_mv", 3100, 2900, 100, "discharge"),
            ("sum_volt_high", "mean_mv", 4190, 4230, 30, "charge"),
            ("sum_volt_low", "mean_mv", 3150, 3000, 50, "discharge"),
        ),
    ),
    "lto": Chemistry(
        code=2,
        nominal_mv=2300,
        empty_mv=1850,
        full_mv=2670,
        balance_start_mv=2450,
        open_circuit=(
            (0.0, 1.700),
            (2.0, 1.900),
            (5.0, 2.050),
            (10.0, 2.120),
            (20.0, 2.180),
            (40.0, 2.240),
            (60.0, 2.310),
            (80.0, 2.400),
            (90.0, 2.480),
            (95.0, 2.540),
            (100.0, 2.650),
        ),
        by_voltage=(
            ("cell_volt_high", "max_mv", 2700, 2800, 50, "charge"),
            ("cell_volt_low", "min_mv", 1800, 1600, 100, "discharge"),
            ("sum_volt_high", "mean_mv", 2680, 2750, 30, "charge"),
            ("sum_volt_low", "mean_mv", 1850, 1700, 50, "discharge"),
        ),
    ),
}
