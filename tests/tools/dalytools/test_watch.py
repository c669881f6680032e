# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark watch`` as a user runs it: a process, a bus, signals; and whatever breaks, the capture file does not."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, TYPE_CHECKING

import pytest
from tests.capture.bus import Bus
from tests.tools.dalytools.made import ANSWER, ASK, SAMPLES, a5, write

from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

RUN = [sys.executable, "-c", "from dalytools.cli import entry; entry()"]
ROW = re.compile(r" *(\d+) +(\d+\.\d{3})  (.+)")


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


class Watch:
    """A running ``dalyshark watch``, its output read as it comes."""

    def __init__(
        self,
        *words: object,
        run: Sequence[str] = RUN,
        stdout: IO[str] | int = subprocess.PIPE,
        env: dict[str, str] | None = None,
        cwd: Path | None = None,
    ) -> None:
        self.process = subprocess.Popen(
            [*run, "watch", *map(str, words)],
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={name: value for name, value in (env or os.environ).items() if name != "PYTHONUNBUFFERED"},
            cwd=cwd,
        )
        self.lines: list[str] = []
        self.errors: list[str] = []
        self._threads = [
            threading.Thread(target=into.extend, args=(stream,), daemon=True)
            for stream, into in ((self.process.stdout, self.lines), (self.process.stderr, self.errors))
            if stream
        ]
        for thread in self._threads:
            thread.start()

    @property
    def out(self) -> str:
        return "".join(self.lines)

    @property
    def err(self) -> str:
        return "".join(self.errors)

    def rows(self) -> list[str]:
        """What was shown of each record, in order."""
        found = [ROW.fullmatch(line.rstrip("\n")) for line in self.lines]
        return [row[3] for row in found if row]

    def until(self, text: str) -> None:
        until(lambda: text in self.out or self.process.poll() is not None)
        assert text in self.out, (self.out, self.err)

    def end(self, status: int) -> None:
        """Wait for its end; no traceback, nothing left behind."""
        until(lambda: self.process.poll() is not None)
        for thread in self._threads:
            thread.join(10)
        for stream in (self.process.stdout, self.process.stderr):
            if stream:
                stream.close()
        assert self.process.returncode == status, (self.out, self.err)
        assert "Traceback" not in self.err
        assert "Exception" not in self.err

    def tshark(self) -> int:
        """Process number of the tshark that shows records."""
        pid = str(self.process.pid)
        for place in Path("/proc").glob("[0-9]*"):
            try:
                state = (place / "stat").read_text().rsplit(")", 1)[1].split()
                if state[1] == pid and b"-l" in (place / "cmdline").read_bytes().split(b"\0"):
                    return int(place.name)
            except OSError:
                continue
        pytest.fail("no tshark was found")


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


def data_in(path: Path) -> list[bytes]:
    return [packet.data for packet in read_capture(path)]


def test_the_simulated_bus(tmp_path: Path) -> None:
    """A real session (25 records, 1.2 s) is played first; every record of the file was shown."""
    watch = Watch("--duration", "3", cwd=tmp_path)
    watch.end(0)
    assert watch.err == ""
    name = re.search(r"\nThe capture: (captures/daly-\d{8}-\d{6}\.pcapng)\n", watch.out)
    assert name, watch.out
    path = tmp_path / name[1]
    packets = list(read_capture(path))
    assert [packet.data for packet in packets[:25]] == data_in(SAMPLES / "real-poll-cycle.pcapng")
    assert len(packets) > 30
    rows = watch.rows()
    assert len(rows) == len(packets)
    assert rows[1] == "Reply board 1  0x90 Pack: 52.8 V  0.0 A  SOC 50.0 %"
    assert re.search(rf"Check: dissector \(tshark [\d.]+\) against reference decoder, {len(packets)} records: "
                     r"0 differences\n", watch.out)  # fmt: skip
    assert f"  Records      {len(packets)}: {len(packets)} good\n" in watch.out
    assert re.search(r"\nOpen it:     wireshark -X lua_script:/\S+/daly\.lua captures/daly-", watch.out)
    assert "ended: duration reached\n" in watch.out
    assert list(tmp_path.iterdir()) == [tmp_path / "captures"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_a_normal_end(number: signal.Signals, bus: Bus, tmp_path: Path) -> None:
    """Each record shows before the next is sent, and what is held at the end shows then."""
    path = tmp_path / "x.pcapng"
    (tmp_path / "temporary").mkdir(mode=0o755)
    watch = Watch(bus.port, "-w", path, env={**os.environ, "TMPDIR": str(tmp_path / "temporary")})
    watch.until("until Ctrl-C; writing")
    frames = [ASK, ANSWER, a5(0x40, 0x98), a5(1, 0x98, b"\x12")]
    for count, frame in enumerate(frames, 1):
        bus.send(frame)
        until(lambda count=count: len(watch.rows()) == count)
    bus.send(ASK[:6])
    until(lambda: len(watch.rows()) == 5)  # given up after silence
    time.sleep(0.3)  # a silence in the file too, whose times are those of first bytes
    bus.send(ANSWER[:5])
    time.sleep(0.05)
    os.killpg(watch.process.pid, number)  # as a terminal does it
    watch.end(0)
    assert watch.rows() == [
        "Request board 1  0x90 Pack",
        "Reply board 1  0x90 Pack: 24.8 V  0.0 A  SOC 38.5 %",
        "Request board 1  0x98 Faults",
        "Reply board 1  0x98 Faults: cell_volt_high_level_2, sum_volt_high_level_1",
        "Cut-off frame  6 bytes  a5 40 90 08 00 00",
        "Cut-off frame  5 bytes  a5 01 90 08 00",
    ]
    assert data_in(path) == [*frames, ASK[:6], ANSWER[:5]]
    assert "ended: stopped\n" in watch.out
    assert "  Records      6: 4 good, 2 cut off\n" in watch.out
    assert "    pack       24.8 V  0.0 A  SOC 38.5 %\n" in watch.out
    assert "    faults     cell_volt_high_level_2, sum_volt_high_level_1\n" in watch.out
    assert "6 records: 0 differences\n" in watch.out
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_port_that_hangs_up(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    watch = Watch(bus.port, "-w", path)
    watch.until("Listening")
    bus.send(ASK)
    until(watch.rows)
    bus.unplug()
    watch.end(2)
    assert watch.rows()[1].startswith(f"Event: port lost: {bus.port} went away")
    assert data_in(path) == [ASK, b""]
    assert watch.err == f"dalyshark watch: {bus.port} went away; check the adapter and its cable, then start again\n"
    assert "2 records: 0 differences" in watch.out
    assert f"The capture: {path}\n" in watch.out


def test_tshark_killed_in_the_middle(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    watch = Watch(bus.port, "-w", path)
    watch.until("Listening")
    bus.send(ASK)
    until(watch.rows)
    os.kill(watch.tshark(), signal.SIGKILL)
    until(lambda: watch.err)  # at once, on a silent bus
    bus.send(ANSWER)
    until(lambda: len(data_in(path)) == 2)
    watch.process.send_signal(signal.SIGINT)
    watch.end(0)
    note = "the live view broke off, the capture did not: tshark was ended by Killed"
    assert watch.err == f"dalyshark watch: {note}\n"
    assert watch.out.count("  Note: ") == 1
    assert f"  Note: {note}\n" in watch.out
    assert len(watch.rows()) == 1
    assert "2 records: 0 differences" in watch.out


@pytest.mark.parametrize("when", ["before", "while records come"])
def test_nobody_reads_any_more(when: str, bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    reader, writer = os.pipe()
    watch = Watch(bus.port, "-w", path, stdout=writer)
    os.close(writer)
    with os.fdopen(reader, encoding="utf-8") as output:
        if when != "before":
            assert output.readline().startswith("Listening")
            bus.send(ASK)
            while "Request" not in output.readline():
                pass
    bus.send(ASK)
    watch.end(0)
    assert watch.err == f"dalyshark watch: standard output: broken pipe; the capture ended and is in {path}\n"
    heard = data_in(path)
    assert heard == [ASK] * len(heard)
    assert when == "before" or len(heard) == 2


def test_a_full_disk_behind_standard_output(tmp_path: Path) -> None:
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        watch = Watch("--duration", "1", "-w", tmp_path / "x", stdout=full)
        watch.end(2)
    assert watch.err.lower().startswith("dalyshark watch: standard output: no space left on device")
    assert watch.err.count("\n") == 1


def test_a_full_disk_behind_the_capture(bus: Bus, tmp_path: Path) -> None:
    watch = Watch(bus.port, "-w", "/dev/full")
    watch.end(2)
    assert watch.err == (
        "dalyshark watch: /dev/full: no space left on device; 0 records written, 0 lost; "
        "free some space, or write elsewhere\n"
    )


def test_a_disk_that_fills_up(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    code = (
        "import resource, dalytools.commands.watch as watch\n"
        "opened = watch.open_writer\n"
        "def open_writer(*words, **more):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))\n"
        "    return opened(*words, **more)\n"
        "watch.open_writer = open_writer\n"
        "from dalytools.cli import entry; entry()"
    )
    watch = Watch(bus.port, "-w", path, run=[sys.executable, "-c", code])
    watch.until("Listening")
    for _ in range(20):
        bus.send(ASK)
    watch.end(2)
    safe = data_in(path)
    assert 5 < len(safe) < 20
    assert safe == [ASK] * len(safe)
    assert len(watch.rows()) >= len(safe)
    found = re.fullmatch(
        rf"dalyshark watch: {path}: file too large; {len(safe)} records written, (\d+) lost; "
        r"free some space, or write elsewhere\n",
        watch.err,
    )
    assert found, watch.err


def test_a_busy_port(bus: Bus, tmp_path: Path) -> None:
    first = Watch(bus.port, "-w", tmp_path / "1")
    first.until("Listening")
    second = Watch(bus.port, "-w", tmp_path / "2")
    second.end(2)
    assert f"{bus.port} is in use by " in second.err
    assert f"(process {first.process.pid})" in second.err
    first.process.terminate()
    first.end(0)
    assert "Nothing was heard: is somebody talking on this bus" in first.out
    assert not (tmp_path / "2").exists()


@pytest.mark.parametrize("variable", ["", "NO_COLOR"])
def test_colours_on_a_terminal(variable: str, bus: Bus, tmp_path: Path) -> None:
    with Bus() as terminal:
        stdout = os.open(terminal.port, os.O_WRONLY | os.O_NOCTTY)
        environment = {name: value for name, value in os.environ.items() if name != "NO_COLOR"} | {"TERM": "xterm"}
        if variable:
            environment[variable] = "1"
        watch = Watch(bus.port, "-w", tmp_path / "x", stdout=stdout, env=environment)
        os.close(stdout)
        shown = ""

        def heard() -> str:
            nonlocal shown
            shown += terminal.heard().decode()
            return shown

        until(lambda: "Listening" in heard())
        bus.send(ASK + a5(1, 0x98, b"\x01") + ASK[:12] + b"\x00")
        until(lambda: "Bad checksum" in heard())
        watch.process.send_signal(signal.SIGINT)
        until(lambda: "Open it:" in heard())
        watch.end(0)
    assert ("\x1b[36m" in shown, "\x1b[1;31m" in shown) == ((False, False) if variable else (True, True))
    if not variable:
        assert re.search(r"\x1b\[36m +1 +0\.000  Request board 1  0x90 Pack\x1b\[m", shown)
        assert re.search(r"\x1b\[1;31m +2 [^\n]*Faults: cell_volt_high_level_1\x1b\[m", shown)
        assert re.search(r"\x1b\[1;31m +3 [^\n]*Bad checksum[^\n]*\x1b\[m", shown)


def test_quiet_shows_the_summary_only(tmp_path: Path) -> None:
    watch = Watch("-q", "--duration", "1", "-w", tmp_path / "x")
    watch.end(0)
    assert watch.rows() == []
    assert "Summary of 1." in watch.out
    assert "records: 0 differences" in watch.out


def test_a_series_of_files(bus: Bus, tmp_path: Path) -> None:
    """``watch`` keeps files as ``capture`` does; its summary and its check are of all of them."""
    told, statistics = tmp_path / "told", tmp_path / "s.json"
    words = ["-b", "packets:2", "-b", f"printname:{told}", "--sha256", "-c", "5", "--stats", statistics]
    watch = Watch(bus.port, "-w", tmp_path / "x.pcapng", *words)
    watch.until("Listening")
    for frame in (frames := [ASK, ANSWER, a5(0x40, 0x98), a5(1, 0x98), ASK]):
        bus.send(frame)
    watch.end(0)
    files = sorted(tmp_path.glob("x_*.pcapng"))
    assert [data_in(path) for path in files] == [frames[:2], frames[2:4], frames[4:]]
    assert told.read_text().split() == [str(path) for path in files]
    assert all(path.with_name(f"{path.name}.sha256").exists() for path in files)
    assert "  Records      5: 5 good\n" in watch.out
    assert "  Requests     3, 1 unanswered, 0 retries, 0 echoes\n" in watch.out
    assert "5 records: 0 differences\n" in watch.out
    assert f"The capture: {files[2]}, the last of 3: {files[0]} and so on\n" in watch.out
    assert json.loads(statistics.read_text())["records"] == 5


def test_going_on_in_a_file(bus: Bus, tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcapng", [(0, ASK), (0.1, ANSWER)])
    watch = Watch(bus.port, "-w", path, "--append", "-a", "packets:1")
    watch.until("Listening")
    bus.send(ASK)
    watch.end(0)
    assert data_in(path) == [ASK, ANSWER, ASK]
    assert "  Records      3: 3 good\n" in watch.out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-b", "printname:-"], "standard output shows the records, so printname:- is not possible; name a file"),
        (["--append", "-b", "packets:2"], "--append goes on in one file, -b begins new ones; leave one of them out"),
        (["--dashboard", "-q"], "argument -q/--quiet: not allowed with argument --dashboard"),
        (["-a", "packets:0"], "'0' is not a whole number from 1 up"),
    ],
)
def test_what_can_not_be(words: list[str], message: str, bus: Bus, tmp_path: Path) -> None:
    watch = Watch(bus.port, "-w", tmp_path / "x.pcapng", *words)
    watch.end(2)
    assert message in watch.err
    assert list(tmp_path.iterdir()) == []


def test_a_dashboard_needs_a_terminal(bus: Bus, tmp_path: Path) -> None:
    watch = Watch(bus.port, "-w", tmp_path / "x.pcapng", "--dashboard", "-c", "1")
    watch.until("Listening")
    bus.send(ASK)
    watch.end(0)
    assert watch.rows() == ["Request board 1  0x90 Pack"]
    assert watch.err == "dalyshark watch: no terminal for a dashboard: lines instead\n"
