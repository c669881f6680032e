# SPDX-License-Identifier: GPL-2.0-or-later
"""Trouble made on purpose (tests/traffic.py) through both readings: the short form of `make soak`."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import pytest
from bench.soak import KINDS, WIRES, likely_bus, trouble, write

from dalytools.comparison import compare

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.traffic import Made

    from dalytools.tshark import Tshark


@pytest.mark.parametrize("seed", [101, 102, 103])
@pytest.mark.parametrize("make", [trouble, likely_bus])
def test_both_readings_agree(tshark: Tshark, make: Callable[[int], Iterator[Made]], seed: int) -> None:
    path = tshark.home / f"{make.__name__}-{seed}.pcapng"
    write(path, itertools.islice(make(seed), 4000))
    path.chmod(0o644)
    result = compare(tshark, path)
    assert [str(difference) for difference in result.differences[:5]] == []
    assert result.records > 3900
    assert result.kinds["frame"] > 2500
    if make is trouble:
        assert min(result.kinds[kind] for kind in ("bad_checksum", "short", "junk", "foreign", "event")) > 5


@pytest.mark.parametrize("kind", ["can", "ble", "tcp", "lossy-tcp", "lossy-tcp-again"])
def test_both_readings_agree_on_every_wire(tshark: Tshark, kind: str) -> None:
    link_type, made = KINDS[kind](104)
    path = tshark.home / f"{kind}.pcapng"
    write(path, itertools.islice(made, 3000), link_type)
    path.chmod(0o644)
    result = compare(tshark, path, wires=WIRES)
    assert [str(difference) for difference in result.differences[:5]] == []
    if kind == "lossy-tcp-again" and not tshark.version.startswith("4.0."):
        assert "tcp_connections" in {one.what for one in result.left_out}
        return
    left_out = {one.what for one in result.left_out}
    assert left_out == {"ble_values", "ble_packets"} if kind == "ble" else left_out <= {"tcp_records"}
    assert result.kinds["frame"] > 1500
    assert result.kinds["foreign"] > 20
