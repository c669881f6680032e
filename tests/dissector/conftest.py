# SPDX-License-Identifier: GPL-2.0-or-later
"""Packets in, what the real tshark makes of them with our dissector out."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.dissector.dissection import Dissect, dissect_with

if TYPE_CHECKING:
    from collections.abc import Iterator

from dalytools.tshark import Tshark


@pytest.fixture(scope="session")
def tshark() -> Iterator[Tshark]:
    """A tshark with our dissector (DALYSHARK_TSHARK chooses which)."""
    with Tshark() as started:
        yield started


@pytest.fixture(scope="session")
def dissect(tshark: Tshark) -> Dissect:
    """``dissect(packets)``: a list of rows, one a packet; see tests/dissector/dissection.py."""
    return dissect_with(tshark)


@pytest.fixture
def open_folder() -> Iterator[Path]:
    """A temporary folder that the tshark which is started can read, whoever runs the tests."""
    folder = Path(tempfile.mkdtemp(prefix="dalyshark-test-"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)
