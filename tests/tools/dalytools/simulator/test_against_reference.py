# SPDX-License-Identifier: GPL-2.0-or-later
"""What the simulator builds by itself, the reference decoder reads: a third opinion and the second agree."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dalycapture.reader import read_capture
from dalyref.decoder import Decoder, Options
from dalytools.simulator.capture_file import write_capture
from dalytools.simulator.scenario_file import read_scenario

if TYPE_CHECKING:
    from pathlib import Path

    from dalyref.decoder import Decoded

WRONG = ("daly.contradiction", "daly.unanswered", "daly.unasked", "daly.burst.missing", "daly.burst.cut_off")


def decoded(name: str, path: Path, seconds: float = 0.0) -> list[Decoded]:
    write_capture(read_scenario(name), path, seconds=seconds)
    decoder = Decoder(Options())
    records = [record for packet in read_capture(path) for record in decoder.feed(packet)]
    return records + decoder.finish()


@pytest.mark.parametrize(
    "name", ["clean-16s", "clean-two-boards", "clean-48-cells", "clean-all-dialects", "clean-settings"]
)
def test_clean_scenarios_have_nothing_wrong(name: str, tmp_path: Path) -> None:
    records = decoded(name, tmp_path / "x.pcapng")
    assert len(records) > 500
    assert {record.kind.value for record in records} == {"frame"}
    for record in records:
        assert not [field for field in WRONG if field in record.fields], record.number


def test_settings_are_read_as_they_were_set(tmp_path: Path) -> None:
    seen: dict[str, object] = {}
    for record in decoded("clean-settings", tmp_path / "x.pcapng", 12):
        seen.update(record.fields)
    expected = {
        "daly.setting.rated_capacity": 100_000,
        "daly.setting.cell_high_1": 3600,
        "daly.setting.cell_low_2": 2700,
        "daly.setting.pack_high_1": 57.2,  # 16 x 3.58 V, in 0.1 V
        "daly.setting.charge_current_1": -100.0,
        "daly.setting.discharge_current_2": 200.0,
        "daly.setting.charge_temp_low_2": 0,
        "daly.setting.balance_start": 3400,
        "daly.setting.short_circuit_current": 600,
        "daly.software_version": "11_240123_K00T",
        "daly.hardware_version": "DL-BMS-R32-01E",
        "daly.battery_code": "DL-SIM-0001-20240315",
        "daly.firmware_index": "20240315",
        "daly.production_date": "2024-03-15",
    }
    assert {name: seen.get(name) for name in expected} == expected
