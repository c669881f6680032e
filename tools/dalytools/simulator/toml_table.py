# SPDX-License-Identifier: GPL-2.0-or-later
"""One table of a scenario file: keys taken out one by one, every mistake told in a line that says what is allowed."""

from __future__ import annotations

import datetime as dt
import difflib
import re
from typing import TYPE_CHECKING, cast

from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable

MAX_TABLES = 1000  # of one kind in a file
_HEX = re.compile(r"(?:0x)?((?:[0-9A-Fa-f]{2}[ :,]?)+)")


class Table:
    """A table, and where it stands (``""``: top of the file, ``board 2``). ``end`` tells keys nobody asked for."""

    def __init__(self, file: str, where: str, values: dict[str, object]) -> None:
        self.file = file
        self.where = where
        self._values = values
        self._asked: list[str] = []

    def problem(self, key: str, allowed: str) -> Problem:
        """Say that a key is wrong: file, table, key, its value, what is allowed."""
        value = self._values.get(key)
        shown = repr(value) if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else str(value)
        if len(shown) > 60:
            shown = shown[:57] + "..."
        place = f"{self.where}: " if self.where else ""
        return Problem(f"{self.file}: {place}{key} = {shown}: must be {allowed}")

    def missing(self, key: str, what: str) -> Problem:
        """Say that a key is not there."""
        place = f"{self.where}: " if self.where else ""
        return Problem(f"{self.file}: {place}{key} is missing: {what}")

    def has(self, key: str) -> bool:
        """Whether the file says something about it."""
        self._ask(key)
        return key in self._values

    def _ask(self, key: str) -> None:
        if key not in self._asked:
            self._asked.append(key)

    def _raw(self, key: str) -> object:
        self._ask(key)
        return self._values.get(key)

    def integer(self, key: str, default: int, low: int, high: int, *, shown: str = "") -> int:
        """Read a whole number within bounds; ``shown``: the bounds as people write them."""
        value = self._raw(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.problem(key, shown or f"a whole number from {low} to {high}")
        return value

    def number(self, key: str, default: float, low: float, high: float) -> float:
        """Read a number within bounds."""
        value = self._raw(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise self.problem(key, f"a number from {low:g} to {high:g}")
        return float(value)

    def flag(self, key: str, *, default: bool) -> bool:
        """Read true or false."""
        value = self._raw(key)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.problem(key, "true or false")
        return value

    def word(self, key: str, default: str, allowed: Iterable[str]) -> str:
        """Read one of some words."""
        value = self._raw(key)
        if value is None:
            return default
        words = list(allowed)
        if value not in words:
            raise self.problem(key, one_of(words, value))
        return str(value)

    def words(self, key: str, default: tuple[str, ...], allowed: Iterable[str]) -> tuple[str, ...]:
        """Read a list of some words."""
        value = self._raw(key)
        if value is None:
            return default
        words = list(allowed)
        if not isinstance(value, list):
            raise self.problem(key, f"a list of {one_of(words, '')}")
        for word in cast("list[object]", value):
            if word not in words:
                raise self.problem(key, f"a list of {one_of(words, word)}")
        return tuple(str(word) for word in cast("list[object]", value))

    def text(self, key: str, default: str, longest: int) -> str:
        """Read a text of printable ASCII."""
        value = self._raw(key)
        if value is None:
            return default
        if not isinstance(value, str) or not value.isascii() or not value.isprintable() or len(value) > longest:
            raise self.problem(key, f"a text of at most {longest} printable ASCII characters")
        return value

    def integers(self, key: str, default: tuple[int, ...], low: int, high: int, *, shown: str) -> tuple[int, ...]:
        """Read a list of whole numbers within bounds."""
        value = self._raw(key)
        if value is None:
            return default
        numbers = cast("list[object]", value) if isinstance(value, list) else [None]
        found = [n for n in numbers if isinstance(n, int) and not isinstance(n, bool) and low <= n <= high]
        if len(found) != len(numbers) or len(found) > MAX_TABLES:
            raise self.problem(key, shown)
        return tuple(found)

    def data(self, key: str, most: int) -> bytes:
        """Read bytes written in hex; none where the key is not there."""
        value = self._raw(key)
        if value is None:
            return b""
        if isinstance(value, str) and (found := _HEX.fullmatch(value.strip() + "")):
            data = bytes.fromhex(re.sub(r"[ :,]", "", found[1]))
            if len(data) <= most:
                return data
        raise self.problem(key, f'1 to {most} bytes in hex, such as "A5 40 90 08"')

    def day(self, key: str, default: tuple[int, int, int]) -> tuple[int, int, int]:
        """Read a date: year, month, day."""
        value = self._raw(key)
        if value is None:
            return default
        if not isinstance(value, dt.date) or not 2000 <= value.year <= 2099:
            raise self.problem(key, "a date from 2000-01-01 to 2099-12-31, without quotes")
        return value.year, value.month, value.day

    def moment(self, key: str, default_ns: int) -> int:
        """Read a date and time: ns since 1970; UTC where it says no zone."""
        value = self._raw(key)
        if value is None:
            return default_ns
        if not isinstance(value, dt.datetime) or not 1971 <= value.year <= 2099:
            raise self.problem(key, "a date and time such as 2026-01-01T12:00:00Z, without quotes")
        when = value if value.tzinfo else value.replace(tzinfo=dt.UTC)
        since = when - dt.datetime(1970, 1, 1, tzinfo=dt.UTC)
        return (since.days * 86400 + since.seconds) * 10**9 + since.microseconds * 1000

    def table(self, key: str) -> Table:
        """Read a table within this one; an empty one where it is not there."""
        value = self._raw(key)
        if value is None:
            value = {}
        if not isinstance(value, dict):
            raise self.problem(key, f"a table: [{key}]")
        return Table(self.file, f"{self.where}: {key}" if self.where else key, cast("dict[str, object]", value))

    def tables(self, key: str) -> list[Table]:
        """Read a list of tables; they are called ``board 1``, ``board 2`` in messages."""
        value = self._raw(key)
        if value is None:
            return []
        items = cast("list[object]", value) if isinstance(value, list) else [None]
        tables = [cast("dict[str, object]", item) for item in items if isinstance(item, dict)]
        if len(tables) != len(items) or len(tables) > MAX_TABLES:
            raise self.problem(key, f"at most {MAX_TABLES} tables, each begun by [[{key}]]")
        place = f"{self.where}: " if self.where else ""
        return [Table(self.file, f"{place}{key} {number}", item) for number, item in enumerate(tables, 1)]

    def end(self) -> None:
        """Tell of the first key that means nothing here."""
        for key in self._values:
            if key not in self._asked:
                place = f"{self.where}: " if self.where else ""
                near = difflib.get_close_matches(key, self._asked, 1)
                hint = f"did you mean {near[0]}? " if near else ""
                raise Problem(
                    f"{self.file}: {place}{key} means nothing here; {hint}known are: {', '.join(self._asked)}"
                )


def one_of(words: list[str], value: object) -> str:
    """Name the words that may stand there; of many, those nearest to what was written."""
    if len(words) > 15:
        near = difflib.get_close_matches(str(value), words, 4, 0.5) or words[:4]
        return f"one of {len(words)} names, such as {', '.join(near)}"
    return f"one of {', '.join(words)}"
