# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture`` as a user runs it: a process, a pty, a file, a signal."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus, numbered

from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

COMMAND = [sys.executable, "-c", "import sys; from dalytools.cli import main; sys.exit(main())", "capture"]


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


def start(*words: object) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [*COMMAND, *map(str, words)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def finish(process: subprocess.Popen[bytes]) -> tuple[int, bytes, str]:
    out, err = process.communicate(timeout=30)
    return process.returncode, out, err.decode()


def fails(*words: object) -> str:
    """The one line of a run that could not be."""
    code, out, err = finish(start(*words))
    assert (code, out) == (2, b"")
    assert "Traceback" not in err
    lines = err.splitlines()
    assert len(lines) == 1 or lines[1].startswith("Try: ")
    assert lines[0].startswith("dalyshark capture: ")
    return lines[0]


def until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


def size_of(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def listening(path: Path) -> bool:
    """The interface is described: the port is open."""
    return size_of(path) > 0 and b"dalyshark bus=" in path.read_bytes()


def packets_in(path: Path) -> int:
    return len(list(read_capture(path))) if size_of(path) else 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_a_normal_end(number: signal.Signals, bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    process = start(bus.port, "-w", path, "--bus", "garage", "--link-type", 150)
    until(lambda: listening(path))
    for count in range(10):
        bus.send(numbered(count))
    until(lambda: packets_in(path) == 10)
    process.send_signal(number)  # while it sleeps in poll on a silent bus
    code, out, err = finish(process)
    assert (code, out) == (0, b"")
    packets = list(read_capture(path))
    assert [p.data for p in packets] == [numbered(n) for n in range(10)]
    assert packets[0].link_type == 150
    assert packets[0].description.startswith(f"dalyshark bus=garage 9600 8N1 {bus.port}; ")
    assert f"{path}: 10 records (10 good), 130 bytes in " in err
    assert f"from {bus.port} at 9600 baud; ended: stopped." in err


def test_a_series_of_files_and_their_checksums(bus: Bus, tmp_path: Path) -> None:
    words = ["-b", "packets:4", "-b", "printname:-", "-a", "files:3", "--sha256"]
    process = start(bus.port, "-w", tmp_path / "x.pcapng", *words)
    until(lambda: any(listening(path) for path in tmp_path.glob("x_00001_*.pcapng")))
    bus.send(b"".join(numbered(count) for count in range(20)))
    code, out, err = finish(process)
    assert code == 0
    names = out.decode().split()
    assert names == sorted(str(path) for path in tmp_path.glob("*.pcapng"))
    assert len(names) == 3
    assert f"{names[-1]}, the last of 3 files: " in err
    for name in names:
        told = Path(f"{name}.sha256").read_text(encoding="utf-8")
        assert told.split()[0] == hashlib.sha256(Path(name).read_bytes()).hexdigest()


def test_append_tells_what_it_cut_off(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    said = ""
    for life in range(2):
        process = start(bus.port, "-w", path, "--append", "-c", 2)
        until(lambda life=life: size_of(path) > 0 and path.read_bytes().count(b"dalyshark bus=") == life + 1)
        bus.send(numbered(2 * life) + numbered(2 * life + 1))
        code, _, said = finish(process)
        assert code == 0
        if life == 0:
            assert "torn" not in said
            with path.open("ab") as file:
                file.write(b"\x06\0\0\0\x30\0\0\0\x01")
    assert "a torn end of 9 bytes was cut off" in said
    assert [p.data for p in read_capture(path)] == [numbered(0), numbered(1), b"", numbered(2), numbered(3)]


@pytest.mark.parametrize("option", [["-F", "pcap"], ["--pcap"]])
def test_stop_conditions_and_classic_pcap(option: list[str], bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcap"
    process = start(bus.port, "-w", path, *option, "-a", "duration:60", "-c", 3, "-q")
    until(lambda: size_of(path) == 24)
    for count in range(5):
        bus.send(numbered(count))
    assert finish(process) == (0, b"", "")
    assert packets_in(path) == 3


def test_a_silent_bus_gets_advice(bus: Bus, tmp_path: Path) -> None:
    code, _, err = finish(start(bus.port, "-w", tmp_path / "x.pcapng", "-a", "duration:0.05"))
    assert code == 0
    assert "Nothing was heard" in err


def test_standard_output_can_be_piped(bus: Bus, tmp_path: Path) -> None:
    process = start(bus.port, "-w", "-", "-a", "packets:2")
    time.sleep(0.1)
    bus.send(numbered(1) + numbered(2))
    code, out, err = finish(process)
    assert code == 0
    (tmp_path / "out").write_bytes(out)
    assert [p.data for p in read_capture(tmp_path / "out")] == [numbered(1), numbered(2)]
    assert "standard output: 2 records" in err


def test_a_reader_that_goes_away_is_a_normal_end(bus: Bus) -> None:
    process = start(bus.port, "-w", "-")
    assert process.stdout
    assert process.stdout.read(4) == b"\x0a\x0d\x0d\x0a"
    process.stdout.close()  # on a silent bus
    assert process.wait(30) == 0
    assert process.stderr
    assert b"reader of the pipe went away" in process.stderr.read()
    process.stderr.close()


def test_an_unplugged_adapter_is_exit_status_2(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    process = start(bus.port, "-w", path)
    until(lambda: listening(path))
    bus.send(numbered(1))
    until(lambda: packets_in(path) == 1)
    bus.unplug()
    code, _, err = finish(process)
    assert code == 2
    assert err.splitlines()[-1] == (
        f"dalyshark capture: {bus.port} went away; check the adapter and its cable, then start again"
    )
    assert [p.comment[:9] for p in read_capture(path)] == ["", "port lost"]


def test_two_sniffers_on_one_port(bus: Bus, tmp_path: Path) -> None:
    first = start(bus.port, "-w", tmp_path / "1.pcapng")
    until(lambda: listening(tmp_path / "1.pcapng"))
    assert re.search(
        rf"{bus.port} is in use by .*\(process {first.pid}\)", fails(bus.port, "-w", tmp_path / "2.pcapng")
    )
    assert not (tmp_path / "2.pcapng").exists()
    first.terminate()
    assert finish(first)[0] == 0


def test_what_can_be_wrong_is_one_line(bus: Bus, tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("mine", encoding="utf-8")
    out = tmp_path / "x.pcapng"
    assert "/dev/ttyUSB77 is not there; " in fails("/dev/ttyUSB77", "-w", out)
    assert "is a file, not a serial device" in fails(text, "-w", out)
    assert "is a directory, not a serial device" in fails(tmp_path, "-w", out)
    assert "baud rate 12345 is not possible" in fails(bus.port, "-w", out, "--baud", 12345)
    assert not out.exists()
    assert "is not a capture file, so it is not overwritten" in fails(bus.port, "-w", text)
    assert "there is no directory" in fails(bus.port, "-w", tmp_path / "none" / "x")
    assert "is a directory; give the name of a file" in fails(bus.port, "-w", tmp_path)
    assert "/dev/full: no space left on device" in fails(bus.port, "-w", "/dev/full")
    assert text.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--link-type", "149"], "149 (USER2) is taken: Wireshark reads it as Apple's PKTAP; use 147, 148 or 150..162"),
        (["--link-type", "1"], "1 (Ethernet) is not for private use"),
        (
            ["-a", "pages:3"],
            "'pages:3' is not a stop condition; use duration:SECONDS, packets:N, filesize:KB or files:N",
        ),
        (
            ["-b", "pages:3"],
            "'pages:3' is not a condition for a new file; use duration:SECONDS, interval:SECONDS, filesize:KB",
        ),
        (["-a", "files:2"], "say with -b when each next one begins"),
        (["-b", "files:0"], "'files:0' is not a condition for a new file"),
        (["-b", "duration:nan"], "'duration:nan' is not a condition for a new file"),
        (["--sync", "-1"], "'-1' is not a number of seconds from 0 up"),
        (["-a", "duration:nan"], "'nan' is not a number of seconds above 0"),
        (["-c", "0"], "'0' is not a whole number from 1 up"),
        (["--bus", "a b"], "bus name 'a b' is not one word"),
        (["--baud", "fast"], "'fast' is not a baud rate"),
    ],
)
def test_unusable_options_are_one_line(words: list[str], message: str, tmp_path: Path) -> None:
    assert message in fails("/dev/null", "-w", tmp_path / "x", *words)
    assert not (tmp_path / "x").exists()


def test_a_wrong_port_costs_no_older_capture(bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    assert finish(start(bus.port, "-w", path, "-a", "duration:0.05"))[0] == 0
    before = path.read_bytes()
    fails("/dev/ttyUSB77", "-w", path)
    assert path.read_bytes() == before


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody who may not write")
def test_unwritable_directory_as_somebody(bus: Bus, tmp_path: Path) -> None:
    code = (
        "import fcntl, grp, os, sys, termios; from dalytools.cli import main; import dalytools.commands.capture\n"
        "os.seteuid(65534)\n"
        "sys.exit(main(['capture', *sys.argv[1:]]))"
    )
    tmp_path.chmod(0o755)
    os.chmod(bus.port, 0o666)  # noqa: PTH101 - the name is a plain string
    words = [sys.executable, "-c", code, bus.port, "-w", "/x.pcapng"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "dalyshark capture: no permission to write /x.pcapng; choose another directory, or change its permissions\n"
    )


def test_a_terminal_gets_a_status_line(bus: Bus, tmp_path: Path) -> None:
    with Bus() as terminal:
        stderr = os.open(terminal.port, os.O_WRONLY | os.O_NOCTTY)
        command = [*COMMAND, bus.port, "-w", str(tmp_path / "x.pcapng"), "-c", "1"]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=stderr)
        os.close(stderr)
        until(lambda: listening(tmp_path / "x.pcapng"))
        bus.send(numbered(1))
        assert process.wait(30) == 0
        shown = terminal.heard().decode()
    assert shown.startswith("\r0:00  0.0 records/s  0 good, 0 bad, 0 junk  no board  0.3 kB  0 lost")
    assert shown.endswith(f"\r\x1b[K{tmp_path / 'x.pcapng'}: 1 record (1 good), 13 bytes in " + shown.split(" in ")[-1])


def test_junk_alone_gets_advice(bus: Bus, tmp_path: Path) -> None:
    process = start(bus.port, "-w", tmp_path / "x.pcapng", "-c", 1)
    time.sleep(0.1)
    bus.send(b"\x55" * 30)
    code, _, err = finish(process)
    assert code == 0
    assert "No good frame: wrong baud rate, or A and B swapped?" in err


def test_it_stays_light(bus: Bus) -> None:
    """What a small computer needs to capture: no table printer, no packet library, at most 40 MiB."""
    code = (
        "import sys; from dalytools.cli import main; status = main(sys.argv[1:])\n"
        "heavy = {'rich', 'scapy', 'serial', 'pcapng', 'hypothesis'} & set(sys.modules)\n"
        "peak = [line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')]\n"
        "print(status, sorted(heavy), *peak)"
    )
    words = [sys.executable, "-c", code, "capture", bus.port, "-w", os.devnull, "-a", "duration:0.05", "-q"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=30, check=True)
    status, heavy, peak = done.stdout.split(maxsplit=2)
    assert (status, heavy) == ("0", "[]")
    assert int(peak) <= 40 << 10
