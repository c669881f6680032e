# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark simulate`` as people run it."""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dalytools.commands.simulate import add_arguments, board_numbers, scenario
from dalytools.problem import Problem

SAMPLE = Path(__file__).parents[3] / "pcap_samples/real-poll-cycle.pcapng"


def command(*words: str) -> list[str]:
    return [sys.executable, "-c", "from dalytools.cli import entry; entry()", "simulate", *words]


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return parser.parse_args(words)


def labelled(process: subprocess.Popen[str]) -> tuple[str, str]:
    assert process.stdout is not None
    tap, client = process.stdout.readline(), process.stdout.readline()
    assert tap.startswith("tap: ")
    assert client.startswith("client: ")
    return tap[5:].strip(), client[8:].strip()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_runs_until_stopped_and_ends_well(how: signal.Signals, tmp_path: Path) -> None:
    words = command("--link", str(tmp_path), "--boards", "1-2")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        tap, client = labelled(process)
        assert (tap, client) == (str(tmp_path / "tap"), str(tmp_path / "client"))
        fd = os.open(tap, os.O_RDONLY | os.O_NOCTTY)
        assert os.read(fd, 100)
        os.close(fd)
        process.send_signal(how)
        _, errors = process.communicate(timeout=10)
        assert process.returncode == 0
        assert errors == ""
    assert list(tmp_path.iterdir()) == []


def test_duration_and_replay_end_by_themselves() -> None:
    for words in (("--duration", "0.2"), ("--replay", str(SAMPLE), "--speed", "100")):
        done = subprocess.run(command(*words), capture_output=True, text=True, timeout=20, check=False)
        assert done.returncode == 0
        assert done.stdout.startswith("tap: /")
        assert done.stderr == ""


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--boards", "0"), "boards are numbered 1 to 16"),
        (("--boards", "two"), "write 1 or 1,2 or 1-3"),
        (("--cells", "49"), "1 to 48"),
        (("--host-address", "0x01"), "0x20 to 0xff"),
        (("--damage", "2"), "0 to 1"),
        (("--fault", "wet"), "no fault 'wet'"),
        (("--replay", "missing.pcapng"), "no such file"),
        (("--duration", "-1"), "above 0"),
    ],
)
def test_wrong_words_get_one_line_that_helps(words: tuple[str, ...], says: str) -> None:
    done = subprocess.run(command(*words), capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 2  # argparse's own errors add where to find help


def test_scenario_from_words() -> None:
    made = scenario(parsed("--boards", "1-3,7", "--cells", "48", "--damage", "0.4", "--asleep", "echo", "--no-host"))
    assert [board.number for board in made.boards] == [1, 2, 3, 7]
    assert {board.pack.cells for board in made.boards} == {48}
    assert {board.asleep for board in made.boards} == {"echo"}
    assert made.damage.total == pytest.approx(0.4)  # pyright: ignore[reportUnknownMemberType]
    assert not made.host.polls
    assert scenario(parsed("--host-address", "0x41")).host.address == 0x41
    assert board_numbers("2") == [2]
    with pytest.raises(Problem):
        scenario(parsed("--baud", "1"))
