# SPDX-License-Identifier: GPL-2.0-or-later
"""What `dalyshark decode` says of frames that mean something to each other."""

from __future__ import annotations

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
