# SPDX-License-Identifier: GPL-2.0-or-later
"""The real frames that the tests stand on (pcap_samples/real-frames.md)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Row = dict[str, Any]

_FOLDER = Path(__file__).parents[3] / "pcap_samples"


def _rows(name: str) -> list[Row]:
    return [json.loads(line) for line in (_FOLDER / name).read_text(encoding="utf-8").splitlines()]


ROWS: list[Row] = _rows("real-frames.jsonl")
MORE: list[Row] = _rows("more-real-frames.jsonl")
UART: list[Row] = [row for row in ROWS if row["transport"] == "uart"]
FRAMES: list[Row] = [row for row in UART if row.get("kind", "frame") == "frame" and len(row["hex"]) == 26]


def data(name: str) -> bytes:
    """Return the bytes of the row with this id."""
    return next(bytes.fromhex(row["hex"]) for row in ROWS if row["id"] == name)
