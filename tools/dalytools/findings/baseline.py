# SPDX-License-Identifier: GPL-2.0-or-later
"""What an earlier check found, so that only what is new counts: its JSON (``--json``), or the capture itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, cast

from dalytools.findings.as_json import FORMAT, FORMAT_VERSION
from dalytools.problem import Problem

if TYPE_CHECKING:
    from dalytools.findings.checked import Checked

Key = tuple[str, str]
_MOST_BYTES = 64 << 20


class Baseline:
    """The findings that are known: rule and place. A finding counts as known in every file."""

    def __init__(self, keys: set[Key]) -> None:
        self.keys = frozenset(keys)

    @classmethod
    def of(cls, checked: Checked) -> Baseline:
        """Take what was found in a capture."""
        return cls({finding.key for finding in checked.findings})


def read_json(path: str) -> Baseline | None:
    """Read the JSON of an earlier check; None when the file is no JSON (then it is a capture). Raises Problem."""
    place = Path(path)
    try:
        with place.open("rb") as file:
            if file.read(64).lstrip()[:1] != b"{":
                return None
            file.seek(0)
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise Problem(f"{path}: can not be read: {(error.strerror or str(error)).lower()}") from None
    if len(content) > _MOST_BYTES:
        raise Problem(f"{path}: too large for the JSON of a check")
    try:
        return Baseline(_keys(json.loads(content)))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise Problem(
            f"{path} is not the JSON of an earlier check; make one with: dalyshark check --json {path} OLD"
        ) from None


def _keys(document: dict[str, object]) -> set[Key]:
    if document["format"] != FORMAT or document["version"] != FORMAT_VERSION:
        raise ValueError
    files = cast("list[dict[str, list[dict[str, object]]]]", document["files"])
    return {(str(finding["rule"]), str(finding["where"])) for file in files for finding in file["findings"]}
