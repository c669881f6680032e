# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture`` as a person meets it while it runs: two taps, marks, the next file, statistics."""

from __future__ import annotations

import json
import os
import pty
import select
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus, a5, numbered

from dalycapture.line import Counts
from dalycapture.reader import read_capture
from dalycapture.tally import SideTally, Spread, Tally
from dalyref.kinds import Kind
from dalytools.capture_summary import side_sentences
from dalytools.cli import main
from dalytools.status_line import status_text

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PROGRAM = [sys.executable, "-c", "from dalytools.cli import entry; entry()", "capture"]


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


def packets(path: Path) -> list[tuple[bytes, str]]:
    if not path.exists() or not path.stat().st_size:
        return []
    return [(packet.data, packet.comment) for packet in read_capture(path)]


def listens(path: Path) -> bool:
    return path.exists() and b"dalyshark bus=" in path.read_bytes()


def test_two_taps_marks_and_statistics(tmp_path: Path) -> None:
    path, statistics = tmp_path / "x.pcapng", tmp_path / "s.json"
    with Bus() as host, Bus() as bms:
        words = ["--tap", f"host={host.port}", "--tap", f"bms={bms.port}", "-w", str(path), "--stats", str(statistics)]
        process = subprocess.Popen([*PROGRAM, *words], stderr=subprocess.PIPE, text=True)
        until(lambda: path.exists() and path.read_bytes().count(b"dalyshark bus=main side=") == 2)
        host.send(a5(0x40, 0x90))
        until(lambda: len(packets(path)) == 1)
        bms.send(numbered(7))
        until(lambda: len(packets(path)) == 2)
        process.send_signal(signal.SIGUSR2)
        until(lambda: len(packets(path)) == 3)
        process.send_signal(signal.SIGUSR1)  # nothing to rotate: it goes on
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=30)
    assert process.returncode == 0
    assert packets(path)[2] == (b"", "user mark 1")
    assert f"from {host.port} (host) and {bms.port} (bms) at 9600 baud; ended: stopped. 1 mark of yours." in told
    found: dict[str, Any] = json.loads(statistics.read_text(encoding="utf-8"))
    assert (found["records"], found["bytes"], found["marks"], found["boards"]) == (2, 26, 1, [1])
    assert [side["port"] for side in found["sides"]] == [host.port, bms.port]
    assert found["sides"][0]["time_bound_ms"]["max"] > 0


def test_the_signal_begins_the_next_file(tmp_path: Path) -> None:
    with Bus() as bus:
        words = [bus.port, "-w", str(tmp_path / "x.pcapng"), "-b", "packets:1000", "-q"]
        process = subprocess.Popen([*PROGRAM, *words])
        files = lambda: sorted(tmp_path.glob("x_*.pcapng*"))  # noqa: E731
        until(lambda: any(listens(path) for path in files()))
        bus.send(numbered(1))
        until(lambda: any(packets(path) for path in files()))
        process.send_signal(signal.SIGUSR1)
        until(lambda: len(files()) == 2)
        bus.send(numbered(2))
        until(lambda: sum(len(packets(path)) for path in files()) == 2)
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
    assert [data for path in files() for data, _ in packets(path)] == [numbered(1), numbered(2)]


def test_a_person_at_a_terminal(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as bus:
        pid, screen = pty.fork()
        if pid == 0:
            os.environ["COLUMNS"] = "120"
            os.execv(PROGRAM[0], [*PROGRAM, bus.port, "-w", str(path)])
        seen = b""

        def look() -> bytes:
            nonlocal seen
            while select.select([screen], [], [], 0)[0]:
                try:
                    seen += os.read(screen, 4096)
                except OSError:  # the other end is closed
                    break
            return seen

        until(lambda: b"m marks, Ctrl-C ends" in look())
        bus.send(numbered(1))
        until(lambda: b"1 good, 0 bad, 0 junk  boards 1" in look())
        os.write(screen, b"m")
        until(lambda: len(packets(path)) == 2)
        os.write(screen, b"\x03")
        until(lambda: b"ended: stopped" in look())
        assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
        os.close(screen)
    assert packets(path) == [(numbered(1), ""), (b"", "user mark 1")]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tap", "host=/dev/x"], "a two-port tap has one port for each side"),
        (["--tap", "host=/dev/x", "--tap", "host=/dev/y"], "a two-port tap has one port for each side"),
        (["--tap", "host=/dev/x", "--tap", "bms=/dev/x"], "both sides are /dev/x"),
        (["/dev/x", "--tap", "host=/dev/x"], "give one PORT, or --tap"),
        ([], "say which PORT"),
        (["/dev/x"], "say where the capture goes"),
    ],
)
def test_what_can_not_be(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["capture", *words]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tap", "left=/dev/x"], "is no tap; write host=PORT or bms=PORT"),
        (["--wait", "-1"], "is not a number of seconds"),
        (["--format", "9X"], "is not known; Daly's is 8N1"),
        (["--latency", "nan"], "is not a number of milliseconds"),
    ],
)
def test_options_that_can_not_be(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["capture", *words])
    assert caught.value.code == 2
    assert message in capsys.readouterr().err


def test_the_status_line() -> None:
    side = SideTally("a", boards={2, 1}, counts=Counts(overrun=2))
    side.kinds.update({Kind.FRAME: 20, Kind.SHORT: 1, Kind.JUNK: 2})
    tally = Tally(seconds=72, written=1_234_567, unwritten=3, sides=[side])
    assert status_text(tally, 7.25) == "1:12  7.2 records/s  20 good, 1 bad, 2 junk  boards 1 2  1.2 MB  5 lost"
    tally.sides[0].away = True
    assert status_text(tally, 0).endswith("  5 lost  waiting for a")


def test_spreads_are_right_to_five_percent() -> None:
    spread = Spread()
    for number in range(1, 1001):
        spread.add(number * 10_000)  # 0.01 to 10 ms
    assert spread.quantile_ms(0.5) == pytest.approx(5.0, rel=0.06)
    assert spread.quantile_ms(0.99) == pytest.approx(9.9, rel=0.06)
    assert Spread().quantile_ms(0.5) == 0


def test_what_was_wrong_is_said() -> None:
    side = SideTally("a", records=10, contradictory=5, marked=3, breaks=1, gaps=1, gaps_s=[2.5])
    side.counts = Counts(frame=3, breaks=1)
    text = " ".join(side_sentences(side))
    assert "5 times are doubtful" in text
    assert "Line errors at a: 3 bytes and 1 break marked; the driver counts 3 framing errors, 1 breaks." in text
    assert "a was away 1 time, for 2.5 s at most." in text
    side.away = True
    assert "a was away 1 time, for 2.5 s at most, and was not back at the end." in " ".join(side_sentences(side))
    assert side_sentences(SideTally("a")) == []
