# SPDX-License-Identifier: GPL-2.0-or-later
"""Lines of candump -L as SocketCAN packets: the layout of Linux' struct can_frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture import socketcan
from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from pathlib import Path

LOG = """\
(1700000000.000000) can0 18900140#R8
(1700000000.010000) can0 18900140#R
(1700000000.020000) can0 351#R2
(1700000000.030000) can0 18904001#01070000753002BC
"""


def test_remote_frames_hold_as_many_bytes_of_filling_as_they_say(tmp_path: Path) -> None:
    path = tmp_path / "can.log"
    path.write_text(LOG)
    packets = [packet.data for packet in read_capture(path)]
    assert [data.hex() for data in packets] == [
        "d8900140080000000000000000000000",
        "d890014000000000",
        "40000351020000000000",
        "989040010800000001070000753002bc",
    ]
    frames = [socketcan.unpack(data) for data in packets]
    assert [frame and (frame.remote, frame.data) for frame in frames[:3]] == [(True, b"")] * 3


def test_what_is_cut_off_is_no_frame() -> None:
    remote = bytes.fromhex("d8900140080000000000000000000000")
    assert [socketcan.unpack(remote[:length]) for length in (0, 8, 12, 15)] == [None] * 4
    assert socketcan.unpack(remote) == socketcan.Frame(0x18900140, True, True, b"")
