# SPDX-License-Identifier: GPL-2.0-or-later
"""Real bytes of real devices, with the values that their sources state: pcap_samples/real-frames.jsonl.

Every frame stands on an interface, and so on a bus, of its own: nothing is known from the others.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import pytest
from tests.dissector.dissection import Dissect, P, Row, kinds, number, numbers

SAMPLES = Path(__file__).resolve().parents[2] / "pcap_samples"
ROWS: list[dict[str, Any]] = [json.loads(line) for line in (SAMPLES / "real-frames.jsonl").read_text().splitlines()]
UART = {row["id"]: row for row in ROWS if row["transport"] == "uart"}
MODBUS = {row["id"]: row for row in ROWS if row["transport"] in ("modbus", "ble") and "probe" not in row["id"]}
FRAMES = {key: row for key, row in UART.items() if row.get("kind") in (None, "frame") and row["checksum_ok"]}

# What the sources call it -> our field.
NAMES = {
    "pack_voltage_V": "pack.voltage",
    "acquisition_voltage_V": "pack.gather_voltage",
    "current_raw": "pack.current_raw",
    "current_A_raw_minus_30000": "pack.current",
    "soc_pct": "soc",
    "max_cell_mV": "cell.max_voltage",
    "max_cell_no": "cell.max_number",
    "min_cell_mV": "cell.min_voltage",
    "min_cell_no": "cell.min_number",
    "max_temp_C": "temperature.max",
    "max_temp_no": "temperature.max_number",
    "min_temp_C": "temperature.min",
    "min_temp_no": "temperature.min_number",
    "state": "state",
    "charge_mos": "mos.charge",
    "discharge_mos": "mos.discharge",
    "bms_life": "life",
    "remaining_mAh": "remaining_capacity",
    "cells": "cell_count",
    "temps": "sensor_count",
    "charger": "charger",
    "load": "load",
    "bytes5_6_u16": "cycles",
    "frame_no": "frame_number",
    "cells_mV": "cell.voltage",
    "temps_C": "temperature",
    "mask_cells": "balance.cell",
    "fault_code": "fault_code",
}
WORDS = {"reserved_hex", "byte7", "reserved", "byte1", "bits", "dio"}  # looked at by hand below
OF_REQUESTS = {"direction", "host_addr", "data_id", "payload", "command", "value", "datetime"}


@pytest.fixture(scope="module")
def seen(dissect: Dissect) -> dict[str, Row]:
    """Every real UART frame, dissected by itself, in one run of tshark."""
    ids = list(UART)
    packets = [P(UART[key]["hex"], at=index * 10.0, interface=index) for index, key in enumerate(ids)]
    rows = dissect(packets, descriptions=["dalyshark"] * len(ids))
    return dict(zip(ids, rows, strict=True))


@pytest.mark.parametrize("key", FRAMES)
def test_values_are_those_of_the_source(seen: dict[str, Row], key: str) -> None:
    row, real = seen[key], FRAMES[key]
    assert kinds([row]) == ["frame"]
    assert number(row, "checksum.status") == 1
    raw = bytes.fromhex(real["hex"])
    assert number(row, "address") == raw[1]
    assert number(row, "data_id") == raw[2]
    assert number(row, "direction") == (1 if raw[1] >= 0x20 else 2)
    assert number(row, "board") == 1
    expected: dict[str, Any] = real.get("expect") or {}
    if raw[1] >= 0x20:
        assert expected.keys() <= OF_REQUESTS | {"soc_pct"}
        assert "daly.soc" not in row
        return
    for name, value in expected.items():
        if name in NAMES:
            wanted = cast("list[float]", value if isinstance(value, list) else [value])
            assert numbers(row, NAMES[name]) == pytest.approx(wanted, abs=1e-9), name
        else:
            assert name in WORDS | OF_REQUESTS, f"{name} is expected and not looked at"
    if "reserved_hex" in expected:
        assert row["daly.reserved"] == [expected["reserved_hex"]]
    for name in ("byte7", "reserved"):
        if name in expected:
            assert int(row["daly.reserved"][0], 16) & 0xFF == expected[name]
    if "byte1" in expected:
        assert number(row, "balance.active_cell") == expected["byte1"]
    if "dio" in expected:
        bits = [number(row, f"di{i}") for i in range(1, 5)] + [number(row, f"do{i}") for i in range(1, 5)]
        assert sum(int(bit or 0) << i for i, bit in enumerate(bits)) == expected["dio"]


def test_one_real_fault_bit(seen: dict[str, Row]) -> None:
    row = seen["cpy-98"]
    assert number(row, "fault.mos_off_by_command") == 1
    assert number(row, "fault_count") == 0  # a state, not a fault
    assert number(row, "fault_code") == 0


def test_the_real_burst_is_fourteen_cells_and_a_stale_slot(dissect: Dissect) -> None:
    """tano-95-seq behind its own 0x94 reply, which says 14 cells."""
    real = UART["tano-95-seq"]
    rows = dissect([P(UART["tano-94-1"]["hex"]), P(real["hex"], at=0.1)])
    burst = rows[1]
    expected = real["expect"]["cells_mV"]
    assert numbers(burst, "cell.voltage") == expected
    assert numbers(burst, "cells.voltage") == expected
    assert number(burst, "cells.count") == 14
    assert (number(burst, "cells.min"), number(burst, "cells.max")) == (3740, 3784)
    assert number(burst, "cells.spread") == 44
    assert number(burst, "cells.average") == pytest.approx(sum(expected) / 14)
    assert burst["daly.reserved"][-1] == "0ec420"  # slot 15 and byte 7


def test_without_a_count_all_slots_are_shown(seen: dict[str, Row]) -> None:
    row = seen["tano-95-seq"]
    assert numbers(row, "cell.voltage")[-1] == 0x0EC4
    assert number(row, "cells.count") == 15


def test_damaged_bytes_give_no_values(seen: dict[str, Row]) -> None:
    row = seen["lv165-mix"]
    assert kinds([row]) == ["bad_checksum"]
    assert number(row, "checksum.status") == 0
    assert number(row, "data_id") == 0x95
    for name in ("cell.voltage", "frame_number", "direction", "board", "request_in"):
        assert f"daly.{name}" not in row


def test_good_frames_inside_a_damaged_burst(seen: dict[str, Row]) -> None:
    """lv165: five bytes are lost in the fifth frame; the sixth is whole again, the last is two replies mixed."""
    row = seen["lv165-stream"]
    assert kinds([row]) == ["frame+frame+frame+frame+short+frame+bad_checksum"]
    assert numbers(row, "cell.voltage")[:12] == UART["lv165-stream"]["expect"]["cells_mV_1_12"]
    assert numbers(row, "frame_number") == [1, 2, 3, 4, 6]
    assert numbers(row, "burst.missing") == [5]
    assert "daly.cells.voltage" not in row


@pytest.mark.parametrize("key", [key for key, row in UART.items() if row.get("kind") == "foreign"])
def test_other_makers_frames_are_not_daly(seen: dict[str, Row], key: str) -> None:
    row = seen[key]
    assert kinds([row]) in (["foreign"], ["junk"])
    assert not {"daly.address", "daly.data_id", "daly.dialect"} & row.keys()


def test_a_sinowealth_exchange_is_named(dissect: Dissect) -> None:
    row = dissect([P(UART["sino-0-req"]["hex"] + UART["sino-0-rsp"]["hex"])])[0]
    assert row["daly.foreign"] == ["Sinowealth"]


def test_real_modbus_frames_are_records(dissect: Dissect) -> None:
    keys = [key for key, row in MODBUS.items() if row["checksum_ok"] and row.get("kind") in (None, "frame")]
    rows = dissect([P(MODBUS[key]["hex"], at=index * 10.0) for index, key in enumerate(keys)])
    assert len(keys) > 25
    for key, row in zip(keys, rows, strict=True):
        raw = bytes.fromhex(MODBUS[key]["hex"])
        assert kinds([row]) == ["frame"], key
        assert row["daly.dialect"] == ["d2" if raw[0] == 0xD2 else "81"]
        assert number(row, "modbus.address") == raw[0]
        assert number(row, "modbus.function") == raw[1]
        assert number(row, "modbus.crc") == int.from_bytes(raw[-2:], "little")
        assert "daly.data_id" not in row
