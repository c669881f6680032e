# SPDX-License-Identifier: GPL-2.0-or-later
"""What a measurement found, as a table that stands in the terminal and in bench/README.md alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from statistics import median
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure that was asked for: ``limit`` is the most it may be, or with ``at_least`` the least."""

    what: str
    figure: float
    limit: float
    unit: str = ""
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Whether the figure is within the limit."""
        return self.figure >= self.limit if self.at_least else self.figure <= self.limit

    def __str__(self) -> str:
        word = "at least" if self.at_least else "at most"
        verdict = "met" if self.met else "MISSED"
        return f"{self.what}: {self.figure:.2f}{self.unit}, {word} {self.limit:g}{self.unit} asked: {verdict}"


@dataclass(slots=True)
class Result:
    """Rows under a heading, the goals they were measured for, and what one must know to read them."""

    title: str
    columns: Sequence[str]
    rows: list[tuple[str, ...]] = field(default_factory=list[tuple[str, ...]])
    goals: list[Goal] = field(default_factory=list[Goal])
    note: str = ""

    def __str__(self) -> str:
        grid = [tuple(self.columns), *self.rows]
        widths = [max(len(row[column]) for row in grid) for column in range(len(self.columns))]

        def line(row: Sequence[str]) -> str:
            first, *others = (
                cell.ljust(width) if column == 0 else cell.rjust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            )
            return "| " + " | ".join([first, *others]) + " |"

        rule = "|-" + "-|-".join("-" * width for width in widths) + "-|"
        parts = [f"## {self.title}", "", line(grid[0]), rule, *map(line, grid[1:]), ""]
        if self.note:
            parts += [self.note, ""]
        return "\n".join([*parts, *(f"- {goal}" for goal in self.goals)])


def spread(values: Sequence[float], form: str = ".2f") -> str:
    """Write the median of some measurements and their range: ``3.68 (3.61..3.90)``."""
    middle = format(median(values), form)
    return f"{middle} ({format(min(values), form)}..{format(max(values), form)})" if len(values) > 1 else middle
