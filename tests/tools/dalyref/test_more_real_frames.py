# SPDX-License-Identifier: GPL-2.0-or-later
"""More real bytes of real devices, with what their sources and the papers say: pcap_samples/more-real-frames.jsonl.

Every row is a capture of its own: the bytes, behind the request that they answer; on CAN behind a frame that tells
the dialect.
"""

from __future__ import annotations

from typing import Any, cast

import pytest
from tests.tools.dalyref.can import CanCapture
from tests.tools.dalyref.real import MORE, Row
from tests.tools.dalyref.traffic import Capture


def read(row: Row) -> dict[str, list[Any]]:
    """All values of the row's records: field -> values in order."""
    if row["transport"] == "can":
        on_can = CanCapture()
        hkms = len(row["can_id"]) == 8 and row["can_id"].startswith("04")
        on_can.put(0, "0400FF80" if hkms else "18984001", "00" * 8)
        last, records = on_can.put(500, row["can_id"], row["hex"]), on_can.read()
    else:
        on_a_line = Capture()
        if "request" in row:
            on_a_line.put(0, bytes.fromhex(row["request"]))
        last, records = on_a_line.put(200, bytes.fromhex(row["hex"])), on_a_line.read()
    found: dict[str, list[Any]] = {}
    for record in records:
        for name, value in record.fields.items() if record.number == last else ():
            values = cast("list[Any]", list(value) if isinstance(value, (list, tuple)) else [value])
            found.setdefault(name.removeprefix("daly."), []).extend(values)
    return found


@pytest.mark.parametrize("row", MORE, ids=lambda row: row["id"])
def test_values_are_those_of_the_source(row: Row) -> None:
    found = read(row)
    if row.get("kind", "frame") == "frame":
        assert found["kind"] == ["frame"]
    for name, value in row["expect"].items():
        wanted = cast("list[Any]", value if isinstance(value, list) else [value])
        if isinstance(wanted[0], str):
            assert [str(one) for one in found[name]] == wanted, name
        else:
            assert found[name] == pytest.approx(wanted, abs=1e-9), name
    if row.get("kind") == "foreign":
        assert not {"address", "data_id", "dialect"} & found.keys()
