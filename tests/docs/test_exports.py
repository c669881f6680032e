# SPDX-License-Identifier: GPL-2.0-or-later
"""The commands of docs/exports.md run, and the columns that it names are there."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from tests.docs.shell import shell

from dalytools.exports import moments, records, values

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/exports.md").read_text("utf-8")
COMMANDS = re.findall(r"^    (dalyshark .*?)(?:   .*)?$", PAGE, re.MULTILINE)


def test_the_commands_run(tmp_path: Path) -> None:
    assert len(COMMANDS) == 4
    for name in ("pack", "other"):
        shutil.copy(ROOT / "pcap_samples/made-two-boards.pcapng", tmp_path / f"{name}.pcapng")
    for command in COMMANDS:
        shell(command, tmp_path)
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {"pack.pcapng", "other.pcapng", "pack.csv", "packs.parquet", "fleet"}


def test_the_columns_are_there() -> None:
    known = {column.name for shape in (moments, records, values) for column in shape.CHOICES}
    known |= {column.name for column in (*records.HEAD, *values.COLUMNS)}
    named = set(re.findall(r"`([a-z_]+_(?:V|mV|percent|\d\d_C|\d\d_mV|UTC))`", PAGE))
    assert len(named) >= 6
    assert named <= known
