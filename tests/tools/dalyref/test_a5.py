# SPDX-License-Identifier: GPL-2.0-or-later
"""The A5 frame against real ones."""

from __future__ import annotations

import pytest
from tests.tools.dalyref import real

from dalyref import a5


@pytest.mark.parametrize("row", real.FRAMES, ids=lambda row: row["id"])
def test_real_frames(row: real.Row) -> None:
    frame = bytes.fromhex(row["hex"])
    good = bool(row["checksum_ok"])
    assert a5.is_good(frame) is good
    assert (a5.build(frame[1], frame[2], frame[4:12]) == frame) is good


def test_request_of_the_pc_software() -> None:
    assert a5.build(0x40, 0x90).hex() == "a540900800000000000000007d"


def test_sum_wraps_at_a_byte() -> None:
    # A5 + 01 + 98 + 08 + 8 x FF = 326 + 2040 = 2366 = 9 x 256 + 62
    assert a5.build(1, 0x98, b"\xff" * 8)[-1] == 62


def test_only_eight_data_bytes() -> None:
    with pytest.raises(ValueError, match="8 data bytes"):
        a5.build(1, 0x90, bytes(7))


def test_no_frame_beyond_the_end() -> None:
    frame = real.data("cpy-90")
    assert not a5.is_good(frame[:-1])
    assert a5.is_good(b"x" + frame, 1)
    assert not a5.is_good(b"x" + frame, 0)
