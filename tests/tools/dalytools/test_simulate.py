# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark simulate`` as people run it."""

from __future__ import annotations

import argparse
import json
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


def simulated(*words: object) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(command(*map(str, words)), capture_output=True, timeout=60, check=False)


def test_list_and_example(tmp_path: Path) -> None:
    listed = simulated("--list").stdout.decode().splitlines()
    assert len(listed) >= 20
    assert any(line.startswith("shared-bus ") and line.endswith("[g.9]") for line in listed)
    example = simulated("--example").stdout
    (tmp_path / "mine.toml").write_bytes(example)
    done = simulated(tmp_path / "mine.toml", "-w", tmp_path / "x.pcapng", "--duration", "1")
    assert (done.returncode, done.stdout) == (0, b"")
    assert b"on the wire in 1 s, as uart" in done.stderr


def test_bytes_of_a_serial_line_are_counted_on_no_other_wire(tmp_path: Path) -> None:
    """Two requests and replies, 4 frames of 13 bytes; on CAN they are not 13 bytes long."""
    words = ("-w", tmp_path / "x.pcapng", "--duration", "0.15")
    told = simulated(*words).stderr.decode()
    assert told == f"{tmp_path}/x.pcapng: 4 packets, 52 bytes on the wire in 0.15 s, as uart\n"
    assert simulated(*words, "--wire", "can").stderr.decode() == f"{tmp_path}/x.pcapng: 4 packets in 0.15 s, as can\n"


def test_a_capture_goes_down_a_pipe_and_needs_no_file() -> None:
    one = simulated("-w", "-", "--duration", "2", "--boards", "1-2")
    two = simulated("-w", "-", "--duration", "2", "--boards", "1-2")
    assert one.returncode == 0
    assert one.stdout == two.stdout
    assert one.stdout[:4] == b"\x0a\x0d\x0d\x0a"
    assert simulated("-w", "-", "--duration", "2", "--boards", "1-2", "--seed", "2").stdout != one.stdout


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("no-such-scenario",), "--list shows them"),
        (("faults", "--cells", "4"), "--cells and a scenario do not go together"),
        (("faults", "--no-host"), "--no-host and a scenario"),
        (("faults", "--baud", "1", "-w", "x"), "300 to 4000000"),
        (("clean-can",), "goes to a capture: -w FILE"),
        (("clean-16s", "-w", "/no/where/x.pcapng"), "there is no directory"),
        (("clean-16s", "-w", "-", "--replay", "x"), "choose one of them"),
        (("clean-ble", "-w", "x.pcapng", "--wire", "can"), "speaks d2, which CAN does not carry"),
    ],
)
def test_wrong_scenarios_get_one_line(words: tuple[str, ...], says: str, tmp_path: Path) -> None:
    done = subprocess.run(command(*words), cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_live_scenario_answers_modbus_clients_and_writes_its_truth(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text("host = []\n[[board]]\ndialects = ['a5', 'd2']\n", encoding="utf-8")
    words = command(str(tmp_path / "my.toml"), "--truth", str(tmp_path / "t.json"), "--duration", "20")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        _, client = labelled(process)
        fd = os.open(client, os.O_RDWR | os.O_NOCTTY)
        os.write(fd, bytes.fromhex("D206000C00019BAA"))  # the article's
        heard = b""
        while len(heard) < 8:
            heard += os.read(fd, 8)
        os.close(fd)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=10)
    assert heard == bytes.fromhex("D206000C00019BAA")
    (note,) = json.loads((tmp_path / "t.json").read_text(encoding="utf-8"))["notes"]
    assert (note["what"], note["host"], note["register"], note["result"]) == ("write", "client", 0x0C, "confirmed")
