# SPDX-License-Identifier: GPL-2.0-or-later
"""The live view alone: a line a packet, and a tshark that hangs or dies."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, FRAME_S, dissector, program

import dalytools.tshark
from dalycapture.errors import CaptureError
from dalycapture.interface import tap
from dalyref.options import Options
from dalytools.live_view import LiveView
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Callable


def view(data: list[bytes], *, before_end: Callable[[LiveView], None] = lambda _: None) -> tuple[list[str], list[str]]:
    """What is shown of these packets, a frame's length apart, and what is complained of."""
    shown: list[str] = []
    complaints: list[str] = []
    with Tshark() as tshark:
        one = LiveView(tshark, shown.append, complaints.append, options=Options(), link_type=147, application="test")
        try:
            one.sink.add_interface(tap("/dev/ttyTEST"))
            for number, each in enumerate(data):
                one.sink.write_packet(EPOCH_NS + round(number * FRAME_S * 1e9), each, comment="" if each else "\x1b[2J")
        except CaptureError:
            assert isinstance(one.sink.failure, BrokenPipeError)
        before_end(one)
        one.sink.close()
        one.finish(0.5 if before_end is stop else 60)
    return shown, complaints


def stop(one: LiveView) -> None:
    os.kill(one._process.pid, signal.SIGSTOP)  # pyright: ignore[reportPrivateUsage]


def test_a_line_a_packet() -> None:
    assert view([ASK, ANSWER, b"", b"\x01\x02" + ASK]) == (
        [
            "    1      0.000  Request board 1  0x90 Pack",
            "    2      0.014  Reply board 1  0x90 Pack: 24.8 V  0.0 A  SOC 38.5 %",
            "    3      0.027  Event:  [2J",  # the dissector shows a control character as a blank
            "    4      0.041  Junk  2 bytes  01 02 | Request board 1  0x90 Pack",
        ],
        [],
    )


def test_a_tshark_that_hangs_is_ended() -> None:
    assert view([ASK], before_end=stop)[1] == ["tshark did not keep up and was ended"]


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ("echo 'out of luck' >&2; exit 3", "tshark ended with status 3: out of luck"),
        ("exit 3", "tshark ended with status 3: it said nothing"),
        ("kill -9 $$", "tshark was ended by Killed"),
        ("echo 'tshark: Lua: Error during loading:' >&2; echo ' a.lua:1: \x1b[2J' >&2; cat >/dev/null",
         "tshark: Lua: Error during loading: a.lua:1: \\x1b[2J"),
    ],
)  # fmt: skip
def test_a_tshark_that_dies(script: str, complaint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with program(f'case " $* " in *" -l "*) {script}; exit;; esac; exec REAL "$@"') as path:
        monkeypatch.setenv("DALYSHARK_TSHARK", str(path))
        assert view([ASK] * 3) == ([], [complaint])


def test_a_packet_at_which_the_dissector_breaks(monkeypatch: pytest.MonkeyPatch) -> None:
    breaks = (r"function daly\.dissector\(.*\)", r'\g<0> if pinfo.number == 3 then error("on purpose") end')
    with dissector(breaks) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        shown, complaints = view([ASK, ANSWER, ASK, ANSWER])
    assert shown[2] == "    3      0.027  (not decoded: an error in the dissector)"
    assert len(shown) == 4
    assert complaints == []
