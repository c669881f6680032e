# SPDX-License-Identifier: GPL-2.0-or-later
"""Passive means passive: every system call of a whole capture is watched, and those on the port are named here."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.capture.bus import Bus, numbered

from dalycapture.reader import read_capture

STRACE = shutil.which("strace")

ALLOWED_CALLS = {"openat", "fstat", "newfstatat", "ioctl", "flock", "fcntl", "read", "close"}
# TCGETS and TCSETS are termios, TIOCEXCL and TIOCNXCL exclusive use; nothing here moves a line or a byte.
# isatty and termios of newer C libraries speak TCGETS2 and TCSETS2.
# TIOCGICOUNT and TIOCMGET read error counters and modem lines: they ask the driver, not the bus.
ALLOWED_IOCTLS = {"TCGETS", "TCSETS", "TCGETS2", "TCSETS2", "TIOCEXCL", "TIOCNXCL", "TIOCGICOUNT", "TIOCMGET"}


def can_trace() -> bool:
    if not STRACE:
        return False
    return subprocess.run([STRACE, "-o", "/dev/null", "true"], capture_output=True, check=False).returncode == 0


def calls_on(trace: str, path: str) -> list[tuple[str, str]]:
    """(name, arguments) of the calls with a descriptor of this file, or its name, in strace -y output."""
    found: list[tuple[str, str]] = []
    for line in trace.splitlines():
        call = re.match(r"(?:\d+ +)?(\w+)\((.*)", line)
        if call and (f"<{path}>" in line or f'"{path}"' in line or f"<{path}<" in line):
            found.append((call[1], call[2]))
    return found


@pytest.mark.skipif(not can_trace(), reason="strace is missing or may not trace here (ptrace)")
@pytest.mark.parametrize("ending", ["signal", "unplug"])
def test_nothing_but_listening(ending: str, tmp_path: Path) -> None:
    trace, out = tmp_path / "trace", tmp_path / "x.pcapng"
    command = [
        str(STRACE), "-f", "-y", "-o", str(trace),
        sys.executable, "-c", "import sys; from dalytools.cli import main; sys.exit(main())",
    ]  # fmt: skip
    with Bus() as bus:
        sniffer = subprocess.Popen(
            [*command, "capture", bus.port, "-w", str(out)], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL
        )
        try:
            end = time.monotonic() + 30
            while "TIOCEXCL" not in (trace.read_text(encoding="utf-8") if trace.exists() else ""):
                assert time.monotonic() < end, sniffer.stderr and sniffer.stderr.read()
                time.sleep(0.02)
            for number in range(20):
                bus.send(numbered(number))
                time.sleep(0.01)
            bus.send(b"\xa5\x40\x90")  # and one that silence must close
            while len(list(read_capture(out)) if out.exists() and out.stat().st_size else []) < 21:
                assert time.monotonic() < end
                time.sleep(0.02)
            assert bus.heard() == b""
            if ending == "signal":
                traced = Path(f"/proc/{sniffer.pid}/task/{sniffer.pid}/children").read_text(encoding="ascii").split()
                for pid in traced:
                    subprocess.run(["kill", "-INT", pid], check=True)
            else:
                bus.unplug()
            assert sniffer.wait(30) == (0 if ending == "signal" else 2)
        finally:
            if sniffer.poll() is None:
                sniffer.send_signal(signal.SIGTERM)
                sniffer.wait(30)
            if sniffer.stderr:
                sniffer.stderr.close()
    calls = calls_on(trace.read_text(encoding="utf-8", errors="replace"), bus.port)
    by_descriptor = [(name, rest) for name, rest in calls if re.match(rf"\d+<{bus.port}[<>]", rest)]
    names = {name for name, _ in by_descriptor}
    assert {"ioctl", "read", "flock", "close"} <= names  # the trace did see the port
    opened = [rest for name, rest in calls if name in {"open", "openat"}]
    assert opened
    for rest in opened:
        assert "O_RDONLY" in rest
        assert "O_RDWR" not in rest
        assert "O_WRONLY" not in rest
        assert "O_NOCTTY" in rest
    polls = {"poll", "ppoll", "select", "pselect6", "epoll_ctl", "epoll_wait"}
    assert names - polls <= ALLOWED_CALLS
    requests = [
        re.search(r", ((?:[A-Z0-9_]+)(?: or [A-Z0-9_]+)*)", rest) for name, rest in by_descriptor if name == "ioctl"
    ]
    for request in requests:
        assert request
        assert ALLOWED_IOCTLS.intersection(request[1].split(" or ")), request[1]  # one number, several names
    assert not any("TCSETSF" in rest or "TCSETSW" in rest or "TCFLSH" in rest for _, rest in calls)


@pytest.mark.skipif(not can_trace(), reason="strace is missing or may not trace here (ptrace)")
def test_the_watch_would_see_a_write(tmp_path: Path) -> None:
    """The test above can fail: the same reading of a program that speaks finds it."""
    trace = tmp_path / "trace"
    code = (
        "import fcntl, os, sys, termios; fd = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); os.write(fd, b'x');"
        "termios.tcflush(fd, termios.TCIFLUSH)"
    )
    with Bus() as bus:
        subprocess.run(
            [str(STRACE), "-f", "-y", "-o", str(trace), sys.executable, "-c", code, bus.port], check=True, timeout=60
        )
        calls = calls_on(trace.read_text(encoding="utf-8", errors="replace"), bus.port)
    assert any(name == "write" for name, _ in calls)
    assert any(name == "ioctl" and "TCFLSH" in rest for name, rest in calls)
