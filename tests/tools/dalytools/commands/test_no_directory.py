# SPDX-License-Identifier: GPL-2.0-or-later
"""A directory that is not there: every command that writes a capture names it, and the file, as the user did."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import SAMPLES

from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

CYCLE = str(SAMPLES / "real-poll-cycle.pcapng")


@pytest.mark.parametrize("words", [("reframe", CYCLE), ("redact", CYCLE), ("simulate", "clean-16s")])
def test_no_directory(words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, "-w", str(tmp_path / "none" / "x.pcapng")]) == 2
    said = f"there is no directory {tmp_path / 'none'} for x.pcapng; make it first, or write elsewhere\n"
    assert capsys.readouterr().err == f"dalyshark {words[0]}: {said}"
