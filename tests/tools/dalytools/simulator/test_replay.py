# SPDX-License-Identifier: GPL-2.0-or-later
"""Captures become bytes on the wire again, at their own pace."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dalycapture.errors import TruncatedError
from dalycapture.interface import Interface
from dalycapture.output import open_output
from dalycapture.pcapng import PcapngWriter
from dalyref.packet import Packet
from dalytools.problem import Problem
from dalytools.simulator.replay import open_replay, replay

if TYPE_CHECKING:
    from pathlib import Path

SECOND = 10**9


def played(*packets: tuple[float, bytes], speed: float = 1.0, longest: float = 2.0) -> list[tuple[float, bytes]]:
    """At 1000 baud a byte takes 10 ms."""
    given_packets = [Packet(i + 1, int(seconds * SECOND), data) for i, (seconds, data) in enumerate(packets)]
    sent = replay(given_packets, baud=1000, speed=speed, longest_silence_s=longest)
    return [(round(piece.time_ns / SECOND, 6), piece.data) for piece in sent]


def test_pace_is_kept_from_the_first_packet() -> None:
    assert played((1000.0, b"abc"), (1000.5, b"d"), (1001.0, b"e")) == [(0.0, b"abc"), (0.5, b"d"), (1.0, b"e")]


def test_silence_is_cut() -> None:
    """b ends at 0.01; an hour becomes 2 s."""
    assert played((0.0, b"b"), (3600.0, b"c"), (3600.5, b"d")) == [(0.0, b"b"), (2.01, b"c"), (2.51, b"d")]


def test_faster() -> None:
    assert played((0.0, b"a"), (1.0, b"b"), (2.0, b"c"), speed=4) == [(0.0, b"a"), (0.25, b"b"), (0.5, b"c")]


def test_a_huge_packet_comes_in_pieces() -> None:
    """1000 bytes at 1000 baud: a piece every 2.56 s, and what follows it begins after 10 s."""
    whole = bytes(range(250)) * 4
    out = played((0.0, whole), (10.0, b"next"))
    assert b"".join(data for _, data in out) == whole + b"next"
    assert [seconds for seconds, _ in out] == [0.0, 2.56, 5.12, 7.68, 10.0]


def test_overlapping_and_backward_times_follow_each_other() -> None:
    assert played((5.0, b"abc"), (5.01, b"d"), (1.0, b"e")) == [(0.0, b"abc"), (0.03, b"d"), (0.04, b"e")]


@given(
    st.lists(st.tuples(st.floats(0, 1e6), st.binary(min_size=1, max_size=50)), max_size=30),
    st.sampled_from([0.5, 1.0, 10.0]),
)
def test_no_byte_is_lost_and_nothing_overlaps(packets: list[tuple[float, bytes]], speed: float) -> None:
    out = played(*packets, speed=speed)
    assert [data for _, data in out] == [data for _, data in packets]
    for (before, data), (after, _) in pairwise(out):
        silence = after - before - len(data) * 0.01 / speed
        assert -2e-6 <= silence <= 2 / speed + 2e-6


def capture(path: Path, *packets: tuple[int, bytes]) -> Path:
    """Write (link type, bytes) packets."""
    with PcapngWriter(open_output(path)) as writer:
        for i, (link_type, data) in enumerate(packets):
            number = writer.add_interface(Interface("x", link_type=link_type))
            writer.write_packet(i * SECOND, data, interface=number)
    return path


def test_all_user_link_types_and_no_others(tmp_path: Path) -> None:
    kinds = [1, *range(147, 163), 227]
    path = capture(tmp_path / "c.pcapng", *((kind, bytes((kind,))) for kind in kinds), (147, b""))
    assert [piece.data[0] for piece in open_replay(path, baud=9600)] == list(range(147, 163))


def test_what_cannot_be_played_is_said_at_once(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="nothing to play back"):
        open_replay(capture(tmp_path / "can.pcapng", (227, b"x")), baud=9600)
    with pytest.raises(Problem, match="no such file"):
        open_replay(tmp_path / "none.pcapng", baud=9600)
    (tmp_path / "log.txt").write_text("A5 40 90\n")
    with pytest.raises(Problem, match="text file"):
        open_replay(tmp_path / "log.txt", baud=9600)


def test_a_capture_cut_off_is_played_as_far_as_it_goes(tmp_path: Path) -> None:
    path = capture(tmp_path / "c.pcapng", (147, b"one"), (147, b"two"))
    path.write_bytes(path.read_bytes()[:-5])
    sent = open_replay(path, baud=9600)
    assert next(sent).data == b"one"
    with pytest.raises(TruncatedError):
        next(sent)
