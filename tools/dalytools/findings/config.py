# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark.toml``: what a project wants of its captures, kept beside them.

    [check]
    fail-on = "warning"          # note, warning, error, never
    ignore = ["echo"]
    late-after = 0.3             # s
    damaged-limit = 5            # %

    [check.severity]
    write = "error"

    [wire]                       # the constants of docs/records.md, as the options are called
    baud = 9600
    reply = 1.0
    tcp-ports = "8899"           # where Daly's bytes are: as --tcp-ports and --ble-handles
    ble-handles = [0x0f, 0x11]

A key that is not known is an error: a rule misspelt would be a rule not checked. The command line goes first.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, cast

from dalyref.options import Options
from dalytools.findings.finding import SEVERITIES, Severity
from dalytools.findings.rules import RULES
from dalytools.problem import Problem
from dalytools.wires import choice
from dalytools.wires.choice import Choice

if TYPE_CHECKING:
    from collections.abc import Iterable

NAME = "dalyshark.toml"
NEVER = "never"
_MOST_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Config:
    """What the file says; None: nothing."""

    path: str = ""
    fail_on: str | None = None
    ignore: tuple[str, ...] = ()
    late_after: float | None = None
    damaged_limit: float | None = None
    severity: dict[str, Severity] = field(default_factory=dict[str, Severity])
    wire: dict[str, float] = field(default_factory=dict[str, float])
    """Constants of the reading, by the names of ``Options``."""
    wires: Choice = field(default_factory=Choice)
    """What captures do not say of their wires."""


_WIRE = {("silence" if one.name == "quiet" else one.name.replace("_", "-")): one.name for one in fields(Options)}


def find(explicit: str | None, captures: Iterable[str]) -> Config:
    """Read the file that was named; else that in the working directory, else that beside the first capture."""
    if explicit is not None:
        return read(Path(explicit))
    folders = [Path(), *(Path(name).parent for name in list(captures)[:1] if name != "-")]
    for folder in folders:
        if (folder / NAME).is_file():
            return read(folder / NAME)
    return Config()


def read(path: Path) -> Config:
    """Read one file. Raises Problem, a line, where it can't be read or says what is not known."""
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise Problem(f"{path}: can not be read: {(error.strerror or str(error)).lower()}") from None
    if len(content) > _MOST_BYTES:
        raise Problem(f"{path}: too large for a {NAME}")
    try:
        document: dict[str, object] = tomllib.loads(content.decode("utf-8"))
    except (UnicodeDecodeError, RecursionError):
        raise Problem(f"{path}: is not a text in TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise Problem(f"{path}: {str(error)[:200]}") from None
    return _Reading(path).config(document)


class _Reading:
    """Checks every key and value, with the file's name in each complaint."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def config(self, document: dict[str, object]) -> Config:
        self._only(document, ("check", "wire"), "")
        check = self._table(document, "check", "")
        self._only(check, ("fail-on", "ignore", "late-after", "damaged-limit", "severity"), "check.")
        wire = self._table(document, "wire", "")
        self._only(wire, (*_WIRE, *choice.KEYS), "wire.")
        severity = self._table(check, "severity", "check.")
        self._only(severity, RULES, "check.severity.")
        return Config(
            str(self._path),
            self._choice(check["fail-on"], "check.fail-on", (*SEVERITIES, NEVER)) if "fail-on" in check else None,
            self._rules(check.get("ignore", [])),
            self._positive(check, "late-after"),
            self._positive(check, "damaged-limit"),
            {
                name: SEVERITIES[self._choice(value, f"check.severity.{name}", tuple(SEVERITIES))]
                for name, value in severity.items()
            },
            {_WIRE[key]: self._number(value, f"wire.{key}") for key, value in wire.items() if key in _WIRE},
            choice.checked({key: wire[key] for key in choice.KEYS if key in wire}, f"{self._path}: wire."),
        )

    def _table(self, inside: dict[str, object], key: str, where: str) -> dict[str, object]:
        table = inside.get(key, {})
        if not isinstance(table, dict):
            raise Problem(f"{self._path}: {where}{key} must be a table")
        return cast("dict[str, object]", table)

    def _only(self, table: dict[str, object], known: Iterable[str], where: str) -> None:
        names = list(known)
        for key in table:
            if key not in names:
                listed = ", ".join(names) if len(names) < 12 else "see dalyshark check --rules"
                raise Problem(f"{self._path}: {where}{key} is not known ({listed})")

    def _choice(self, value: object, key: str, choices: tuple[str, ...]) -> str:
        if not isinstance(value, str) or value not in choices:
            raise Problem(f"{self._path}: {key} is {value!r}, and must be one of {', '.join(choices)}")
        return value

    def _rules(self, value: object) -> tuple[str, ...]:
        if not isinstance(value, list):
            raise Problem(f'{self._path}: check.ignore must be a list of rules, such as ["echo"]')
        return tuple(
            self._choice(one, "check.ignore", tuple(RULES)) if one not in RULES else str(one)
            for one in cast("list[object]", value)
        )

    def _positive(self, table: dict[str, object], key: str) -> float | None:
        return self._number(table[key], f"check.{key}") if key in table else None

    def _number(self, value: object, key: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= 1e8:
            raise Problem(f"{self._path}: {key} is {value!r}, and must be a number from 0 up")
        return value
