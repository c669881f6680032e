# SPDX-License-Identifier: GPL-2.0-or-later
"""The dashboard's own process, alone: what it does when what it is given is wrong."""

from __future__ import annotations

import os
import pty
import select
import socket
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ASK, write

from dalytools.dashboard.screen import END
from dalytools.dashboard.status import Key, pack

if TYPE_CHECKING:
    from pathlib import Path


def run(packets: Path, messages: bytes = b"") -> tuple[int, str, str]:
    """Its status, what it drew and what it said of errors."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    master, slave = pty.openpty()
    with packets.open("rb") as file, ours, theirs:
        if messages:
            ours.send(messages)
        process = subprocess.Popen(
            [sys.executable, "-m", "dalytools.dashboard", str(theirs.fileno()), "9600"],
            stdin=file,
            stdout=slave,
            stderr=subprocess.PIPE,
            pass_fds=[theirs.fileno()],
            text=True,
        )
        said = process.communicate(timeout=60)[1]
    drawn = b""
    while select.select([master], [], [], 0)[0]:
        drawn += os.read(master, 4096)
    os.close(master)
    os.close(slave)
    return process.returncode, drawn.decode(), said


def test_the_end_of_the_packets_is_a_good_end(tmp_path: Path) -> None:
    status, drawn, said = run(write(tmp_path / "x.pcapng", [(0, ASK)]))
    assert (status, said) == (0, "")
    assert drawn.startswith("\x1b[?1049h")
    assert drawn.endswith(END)


@pytest.mark.parametrize("size", [1, 50, -1])
def test_packets_that_are_cut_off(size: int, tmp_path: Path) -> None:
    """The capture was killed: no error of ours."""
    path = write(tmp_path / "x.pcapng", [(0, ASK)])
    path.write_bytes(path.read_bytes()[:size])
    assert run(path)[0] == 0


def test_no_packets_at_all(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_text("what is this?\n")
    status, drawn, said = run(path)
    assert (status, said) == (1, "standard input is a text file, not a capture; dalyshark import makes one of a log\n")
    assert drawn.endswith(END)


def test_an_error_of_its_own(tmp_path: Path) -> None:
    """A message that is none: said in a line, and the screen is put away."""
    fifo = tmp_path / "x"
    os.mkfifo(fifo)
    holder = os.open(fifo, os.O_RDWR)  # no packet comes, and no end
    status, drawn, said = run(fifo, b"{")
    os.close(holder)
    assert status == 1
    assert said.startswith("JSONDecodeError: ")
    assert said.count("\n") == 1
    assert drawn.endswith(END)


def test_keys_that_mean_nothing(tmp_path: Path) -> None:
    assert run(write(tmp_path / "x.pcapng", [(0, ASK)]), pack(Key("\x1b")))[0] == 0
