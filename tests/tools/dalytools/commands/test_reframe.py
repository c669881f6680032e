# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark reframe`` as people call it: what it says, and its exit status."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import SAMPLES

from dalycapture.reader import read_capture
from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

CHUNKED = SAMPLES / "made-raw-chunked.pcapng"


def test_a_chunked_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The manifest says 50 frames in 41 packets."""
    out = tmp_path / "new.pcapng"
    assert main(["reframe", str(CHUNKED), "-w", str(out)]) == 0
    assert capsys.readouterr().err == f"{out}: 41 packets became 50 records (50 frame), 650 bytes\n"
    assert len(list(read_capture(out))) == 50
    assert b"reframed from made-raw-chunked.pcapng" in out.read_bytes()


def test_a_damaged_one_gives_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.pcapng"
    cut.write_bytes(CHUNKED.read_bytes()[:-500])
    assert main(["reframe", str(cut), "-w", str(tmp_path / "new.pcapng")]) == 1
    assert "whole packets; what came before is in the output" in capsys.readouterr().err
    assert list(read_capture(tmp_path / "new.pcapng"))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["SAME", "-w", "SAME"], "IN and OUT are the same file"),
        (["missing", "-w", "OUT"], "missing: there is no such file"),
        (["SAME", "-w", "TEXT"], "is not a capture file, so it is not overwritten"),
        (["TEXT", "-w", "OUT"], "is a text file, not a capture"),
        (["BYTES", "-w", "OUT"], "give a pcapng or pcap file, or --raw where it is the bytes of a port"),
        (["-", "--raw", "-w", "OUT"], "--raw needs a file"),
    ],
)
def test_what_can_not_be(words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "TEXT").write_text("three years of work", encoding="utf-8")
    (tmp_path / "SAME").write_bytes(CHUNKED.read_bytes())
    (tmp_path / "BYTES").write_bytes(bytes(range(0xA5)))
    paths = [str(tmp_path / word) if word.isupper() else word for word in words]
    assert main(["reframe", *paths]) == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "TEXT").read_text(encoding="utf-8") == "three years of work"
    assert (tmp_path / "SAME").read_bytes() == CHUNKED.read_bytes()
    assert not (tmp_path / "OUT").exists()


def test_to_standard_output_as_classic_pcap(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert main(["reframe", str(CHUNKED), "-F", "pcap", "-w", "-"]) == 0
    assert len(capfdbinary.readouterr().out) == 24 + 50 * (16 + 13)
