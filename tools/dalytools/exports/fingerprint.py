# SPDX-License-Identifier: GPL-2.0-or-later
"""A name for what was taken of a capture: the same records give the same, wherever the file lies."""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dalyref.decoder import Decoded


class Fingerprint:
    """Takes records."""

    def __init__(self, labels: Mapping[str, str]) -> None:
        """labels: the same capture under another label is another."""
        self._hash = blake2b(digest_size=12)
        for name, value in sorted(labels.items()):
            self._hash.update(f"{name}={value}\n".encode())

    def add(self, record: Decoded) -> None:
        """Take the next record."""
        head = f"{record.number} {record.time_ns} {record.kind} {record.interface} {len(record.data)}\n"
        self._hash.update(head.encode())
        self._hash.update(record.data)

    def text(self) -> str:
        """Return it as 24 hex digits."""
        return self._hash.hexdigest()
