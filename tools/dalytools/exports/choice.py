# SPDX-License-Identifier: GPL-2.0-or-later
"""Which columns people ask for: ``--fields daly.soc,daly.pack.*``."""

from __future__ import annotations

import difflib
import fnmatch
import re
from typing import TYPE_CHECKING

from dalytools.problem import Problem
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.exports.schema import Column


def choose(asked: str, columns: Sequence[Column], always: Sequence[Column] = ()) -> list[Column]:
    """Return the columns that a list of names means, in the order asked for, each once.

    A name is a field's (``daly.soc``, ``soc``) or a column's (``soc_percent``); ``*`` in it stands for anything. One of
    `always`, which stand in front in any case, is taken and adds nothing. Raises Problem for a name that means none.
    """
    chosen: dict[str, Column] = {}
    for word in asked.split(","):
        name = word.strip()
        found = _meant(name, columns)
        if not found and "*" not in name and _meant(name, always):
            continue
        if not found:
            raise Problem(f"--fields: no column is called {plain(name)!r}{_nearest(name, columns)}")
        for column in found:
            chosen.setdefault(column.name, column)
    if not chosen:
        raise Problem(f"--fields: {plain(asked)} is there in any case; name a field too")
    return list(chosen.values())


def _meant(name: str, columns: Sequence[Column]) -> list[Column]:
    pattern = re.compile(fnmatch.translate(name.replace("[", "[[]")))
    return [column for column in columns if any(pattern.match(known) for known in column.names())]


def _nearest(name: str, columns: Sequence[Column]) -> str:
    known = [one for column in columns for one in column.names()]
    near = difflib.get_close_matches(name, known, 1)
    return f"; do you mean {near[0]}?" if near else "; docs/fields.md lists them"
