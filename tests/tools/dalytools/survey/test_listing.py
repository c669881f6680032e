# SPDX-License-Identifier: GPL-2.0-or-later
"""The listing in a terminal: unknown first, names beside bytes, as wide as the terminal; what fails is a line."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import SAMPLES, a5, write
from tests.tools.dalytools.survey.planted import Bus

from dalytools.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path


def listed(words: Sequence[str], **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", "from dalytools.cli import entry; entry()", "survey", *words],
        env={**os.environ, **environment},
        capture_output=True,
        timeout=60,
        check=True,
    )
    return done.stdout.decode("utf-8")


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    bus = Bus(60)
    replies: dict[int, Callable[[int], bytes]] = {
        0xE0: lambda poll: bytes((poll, *bus.noise(3), 0, 0, 0, 0)),
        0x93: lambda _: bytes((0, 1, 1, 9, 0, 0, 1, 2)),
    }
    return bus.write(tmp_path_factory.mktemp("survey") / "a.pcapng", replies)


def test_unknown_first_and_names_beside_bytes(capture: Path) -> None:
    text = listed([str(capture)])
    assert text.index("Not known") < text.index("board 1 reply 0xE0") < text.index("board 1 reply 0x90")
    assert re.search(r"names d0-1 pack\.voltage; d2-3 pack\.gather_voltage; d4-5 pack\.current; d6-7 soc", text)
    assert "never moved: 00 01 01 09 00 00 01 02" in text
    assert "d0   counts up by 1 each time" in text


def test_it_is_as_wide_as_the_terminal(capture: Path) -> None:
    from io import StringIO

    from rich.console import Console

    from dalyref.options import Options
    from dalytools.commands.survey import surveyed
    from dalytools.survey.findings import findings
    from dalytools.survey.listing import Listing

    survey = surveyed([str(capture)], Options(), [])
    found = findings(survey)
    for width in (40, 60, 80, 132):
        out = StringIO()
        Listing(Console(file=out, width=width)).show(survey, found, several_buses=False)
        for line in out.getvalue().splitlines():
            if line.startswith(("bits ", "held ", "newest ", "  names", "  d")) and "bits, how" not in line:
                assert len(line) <= width


def test_colour_can_be_switched_off_and_ascii_is_enough(capture: Path) -> None:
    text = listed([str(capture)], NO_COLOR="1", PYTHONIOENCODING="ascii")
    assert "\x1b" not in text
    assert "█" not in text
    assert "bits   " in text


def test_only_what_was_asked_for(capture: Path) -> None:
    text = listed([str(capture), "--id", "E0", "--direction", "reply", "--unknown", "--board", "1"])
    assert "board 1 reply 0xE0" in text
    assert "0x90 " not in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--id", "zz"], "is no number in hex"),
        (["--id", "90-10"], "is no number in hex"),
        (["--board", "17"], "is no board"),
        (["--register", "-1"], "is no number in hex"),
        (["--board", "9"], "nothing of what was read is what was asked for"),
    ],
)
def test_what_cannot_be_done_is_a_line(
    capture: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        sys.exit(main(["survey", str(capture), *words]))  # argparse ends by itself
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_no_capture_is_overwritten_and_none_is_a_line(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["survey", str(capture), "-o", str(capture)]) == 2
    assert main(["survey", str(capture), "--json", str(capture)]) == 2
    capsys.readouterr()
    assert main(["survey", str(tmp_path / "none.pcapng")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["survey", str(capture), "-o", str(capture)]) == 2
    empty = write(tmp_path / "empty.pcapng", [(0.0, b"")])
    assert main(["survey", str(empty)]) == 2
    said = capsys.readouterr().err
    assert "name another file" in said
    assert "no good frame" in said
    assert "Traceback" not in said


def test_a_torn_file_is_shown_as_far_as_it_goes(
    capture: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = tmp_path / "torn.pcapng"
    torn.write_bytes(capture.read_bytes()[:-7])
    assert main(["survey", str(torn)]) == 2
    said = capsys.readouterr()
    assert "board 1 reply 0xE0" in said.out
    assert "torn.pcapng" in said.err


@pytest.mark.parametrize("sample", sorted(SAMPLES.glob("*.pcap*")), ids=lambda path: path.name)
def test_every_sample_can_be_surveyed(sample: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["survey", str(sample)])
    said = capsys.readouterr()
    if sample.name == "real-sinowealth.pcapng":
        assert "no good frame" in said.err
        status = 0
    assert status == 0


def test_control_characters_do_not_reach_the_terminal(tmp_path: Path) -> None:
    named = write(
        tmp_path / "named.pcapng",
        [(number / 10, a5(1, 0xE0, b"\x1b[2J\x07\x9b\x00\x01")) for number in range(20)],
        interfaces=["dalyshark bus=\x1b[31m", "dalyshark bus=\x07b"],
    )
    text = listed([str(named)], NO_COLOR="1")
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", text)
    assert "bus \\x1b[31m" in text
