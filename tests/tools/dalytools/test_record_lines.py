# SPDX-License-Identifier: GPL-2.0-or-later
"""What `dalyshark decode` says of frames that mean something to each other."""

from __future__ import annotations

import pytest
from tests.meaning import CASES, a5

from dalyref.decoder import decode
from dalyref.packet import Packet
from dalytools.record_lines import line


def said(name: str) -> list[str]:
    """What a session of tests/meaning.py reads like."""
    packets = [
        Packet(number, 1_700_000_000_000_000_000 + round(heard.at * 1e9), bytes.fromhex(heard.frame))
        for number, heard in enumerate(CASES[name], 1)
    ]
    return [str(line(record)) for record in decode(packets)]


def test_what_frames_mean_to_each_other_is_said_in_words() -> None:
    assert "WRITE DA charge MOS" in said("MOS switches")[0]
    assert said("MOS switches")[1].endswith("! write confirmed")
    assert said("MOS switches")[3].endswith("! write denied")
    assert said("late")[0].endswith("! no reply")
    assert said("late")[1].endswith("! late, asked in 1")
    assert said("the same answer twice")[2].endswith("! nobody asked")
    assert said("board 2 answers what 40 asked")[1].endswith("! another board than was asked")
    assert "a second host asks" in said("two hosts")[2]
    assert said("cut off by time")[1].endswith("! cut off here")
    assert said("state and switches")[2].endswith("! changed: state discharge_mos")
    assert said("91 beyond 20 mV of the cells")[2].endswith("! cell_max contradicts 2, cell_min contradicts 2")
    assert '= "DL-BMS-R32-01E"' in said("a text")[1]
    assert "unasked" not in said("faults")[2]


def test_a_fault_reply_that_nobody_asked_for_names_faults_alone() -> None:
    frames = [a5(0x40, 0x90), a5(1, 0x98, "01")]
    packets = [Packet(n, n * 1_000_000_000, bytes.fromhex(frame)) for n, frame in enumerate(frames, 1)]
    assert "cell_volt_high_level_1  ! nobody asked" in str([line(record) for record in decode(packets)][1])


@pytest.mark.parametrize(
    ("data", "text"),
    [
        ("0100000000000000", "cells 1"),  # byte 1 is 0: no cell by the other reading, which is no alternative
        ("0108", "cells 1 12  (or, with an active balancer: cell 8)"),
        ("0000000000008000", "no cell"),
    ],
)
def test_an_active_balancer_is_an_alternative_only_where_it_names_a_cell(data: str, text: str) -> None:
    (record,) = decode([Packet(1, 0, bytes.fromhex(a5(1, 0x97, data)))])
    assert line(record).values == text


TOLD: dict[str, str] = {
    # heezes: 30000 mAh, 3600 mV; 3800 and 50 mV; 600 A (field notes, a.2)
    "50 00007530 00000e10": "rated capacity setting.rated_capacity 30000 mAh setting.cell_nominal_voltage 3600 mV",
    "5f 0ed8 0032": "balancing setting.balance_start 3800 mV setting.balance_difference 50 mV",
    "60 0258 014d": "short circuit setting.short_circuit_current 600 A setting.shunt_raw 333",
    "53 00 01 180315 0e10 0a": "battery setting.battery_type LFP setting.operating_mode long press "
    "production_date 2024-03-21 setting.sleep 3600 s setting.current_drift 1.0 A",
    "66 2d005a005a": "heater, fan setting.heater_start 5 C setting.fan_start 50 C setting.key_logic 0x5A",
    "d8 0000000001": "wake-up source wakeup.key off wakeup.button off wakeup.rs485 off wakeup.can off "
    "wakeup.current on",
    "75 0248 00c8 023e 012c": "alarm.level 1 alarm.class pack_high alarm.value 58.4 V alarm.delay 2.0 s "
    "alarm.recovery 57.4 V alarm.recovery_delay 3.0 s",
    "73 5f 0a 5a 0a": "alarm.level 1 alarm.class temp_high 5f 0a 5a 0a 00 00 00 00",
    "64 01020304": "fault log 01 02 03 04 00 00 00 00",
}


@pytest.mark.parametrize("frame", TOLD)
def test_settings_are_told_with_their_units(frame: str) -> None:
    data_id, data = bytes.fromhex(frame)[0], bytes.fromhex(frame)[1:].hex()
    (record,) = decode([Packet(1, 0, bytes.fromhex(a5(1, data_id, data)))])
    assert " ".join("".join(line(record).pieces()[2:4]).split()) == f"{data_id:02X} {TOLD[frame]}"


def test_a_write_tells_what_it_would_set() -> None:
    """The rule write = read - 40: 19 is the write of 59."""
    write = a5(0x40, 0x19, "0e42 0ea6 0af0 0a8c")
    (record,) = decode([Packet(1, 0, bytes.fromhex(write))])
    assert line(record).values == (
        "setting.cell_high_1 3650 mV  setting.cell_high_2 3750 mV  "
        "setting.cell_low_1 2800 mV  setting.cell_low_2 2700 mV"
    )
