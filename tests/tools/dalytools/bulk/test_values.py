# SPDX-License-Identifier: GPL-2.0-or-later
"""The quick way reads the same values as the reference decoder, record by record."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from bench.soak import likely_bus, trouble, write
from tests.tools.dalytools.bulk.both import plain_fields, plainly, quick_fields
from tests.tools.dalytools.made import SAMPLES

from dalyref.options import Options

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from tests.traffic import Made

CAPTURES = sorted(path for path in SAMPLES.iterdir() if path.suffix in {".pcapng", ".pcap"})


def agree(path: Path, *chunks: int, options: Options | None = None) -> int:
    """Hold both ways against each other; return how many records there are."""
    expected = plain_fields(plainly(path, options)[0])
    for chunk in chunks:
        found = quick_fields(path, chunk=chunk, options=options)
        for one, other in zip(found, expected, strict=True):
            assert one == other
    return len(expected)


@pytest.mark.parametrize("path", CAPTURES, ids=lambda path: path.stem)
def test_samples(path: Path) -> None:
    assert agree(path, 1 << 20, 64, 200)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("make", [trouble, likely_bus])
def test_trouble(make: Callable[[int], Iterator[Made]], seed: int, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    write(path, itertools.islice(make(seed), 2000))
    assert agree(path, 1 << 20, 3000) > 1800
