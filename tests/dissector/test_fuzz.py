# SPDX-License-Identifier: GPL-2.0-or-later
"""The short form of ``make fuzz``: mutated samples raise nothing; and what raises something is found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from bench import fuzz

if TYPE_CHECKING:
    from dalytools.tshark import Tshark


@pytest.mark.parametrize("way", fuzz.WAYS, ids=lambda way: " ".join(way) or "list")
@pytest.mark.parametrize("carrier", list(fuzz.LINK_TYPES))
def test_mutated_samples_raise_nothing(tshark: Tshark, way: tuple[str, ...], carrier: str) -> None:
    path = tshark.home / "fuzz.pcapng"
    fuzz.write(path, 77, 2000, carrier)
    path.chmod(0o644)
    assert fuzz.look(tshark, path, way) == ""


@pytest.mark.parametrize("way", fuzz.WAYS, ids=lambda way: " ".join(way) or "list")
def test_snapped_packets_raise_nothing(tshark: Tshark, way: tuple[str, ...]) -> None:
    path = tshark.home / "fuzz.pcapng"
    fuzz.write(path, 78, 2000)
    assert fuzz.look(tshark, fuzz.snapped(tshark, path), way) == ""


def test_an_error_is_found(tshark: Tshark) -> None:
    entry = tshark.home / "lua" / "daly_view.lua"
    right = entry.read_text()
    path = tshark.home / "fuzz.pcapng"
    fuzz.write(path, 79, 200)
    path.chmod(0o644)
    marker = "local function damaged(item, kind, raw, name)\n"
    assert marker in right
    try:
        entry.write_text(right.replace(marker, marker + "  error('planted')\n"))
        assert fuzz.look(tshark, path, ("-T", "fields"))
        assert "planted" in fuzz.look(tshark, path, ("-V",))
    finally:
        entry.write_text(right)
    assert fuzz.look(tshark, path, ("-T", "fields")) == ""
