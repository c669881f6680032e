# SPDX-License-Identifier: GPL-2.0-or-later
"""Pseudo-terminals that nobody's reading or not reading can disturb."""

from __future__ import annotations

import errno
import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from dalytools.problem import Problem
from dalytools.simulator.terminal import Terminal

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path


@contextmanager
def terminal(link: Path | None = None) -> Generator[Terminal]:
    port = Terminal(link)
    try:
        yield port
    finally:
        port.close()


def opened(path: str) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def read(fd: int) -> bytes:
    data = b""
    try:
        while piece := os.read(fd, 65536):
            data += piece
    except BlockingIOError:
        pass
    return data


def test_what_is_sent_while_nobody_listens_is_gone() -> None:
    with terminal() as port:
        assert not port.listened()
        port.send(b"before")
        fd = opened(port.path)
        assert port.listened()
        port.send(b"\x00\x03\x04\x0a\x0d\x11\x13\x1a\x7f\xff now")  # raw: no byte means anything to a terminal
        assert read(fd) == b"\x00\x03\x04\x0a\x0d\x11\x13\x1a\x7f\xff now"
        os.close(fd)


def test_the_next_listener_does_not_get_what_the_last_one_left() -> None:
    with terminal() as port:
        fd = opened(port.path)
        port.send(b"not read")
        os.close(fd)
        assert not port.listened()
        port.send(b"nobody")
        fd = opened(port.path)
        port.send(b"for the next")
        assert read(fd) == b"for the next"
        os.close(fd)


def test_a_listener_that_does_not_read_loses_bytes_and_blocks_nobody() -> None:
    with terminal() as port:
        fd = opened(port.path)
        sent = b"".join(bytes((i % 251,)) * 100 for i in range(5000))
        for at in range(0, len(sent), 100):
            port.send(sent[at : at + 100])  # would hang here
        got = read(fd)
        assert 0 < len(got) < len(sent)
        assert sent.startswith(got[:4000])
        os.close(fd)


def test_what_a_listener_writes_is_received_even_when_it_has_left() -> None:
    with terminal() as port:
        assert port.received() == b""
        fd = opened(port.path)
        assert port.listened()
        os.write(fd, b"\x04\x0a\xa5")
        os.close(fd)
        assert not port.listened()
        assert port.received() == b"\x04\x0a\xa5"
        assert port.received() == b""


def test_link_is_stable_and_goes_away(tmp_path: Path) -> None:
    link = tmp_path / "new" / "tap"
    with terminal(link) as port:
        assert port.path == str(link)
        fd = opened(port.path)
        port.send(b"here")
        assert read(fd) == b"here"
        os.close(fd)
    assert not link.is_symlink()


def test_link_of_somebody_else_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "tap"
    with terminal(link):
        link.unlink()
        link.symlink_to("/dev/null")
    assert str(link.readlink()) == "/dev/null"
    link.unlink()
    link.write_text("precious")
    with pytest.raises(Problem, match="remove it"):
        Terminal(link)
    assert link.read_text() == "precious"


def test_a_device_left_exclusive_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A listener that was killed after TIOCEXCL leaves a device that ordinary users cannot open again."""
    with terminal(tmp_path / "tap") as port:
        device = (tmp_path / "tap").readlink()
        fd = opened(port.path)
        assert port.listened()
        os.close(fd)
        really = os.open

        def refused(path: str, flags: int) -> int:
            if path == str(device):
                raise OSError(errno.EBUSY, "busy")
            return really(path, flags)

        monkeypatch.setattr(os, "open", refused)
        assert not port.listened()
        monkeypatch.undo()
        fd = opened(port.path)
        port.send(b"works")
        assert read(fd) == b"works"
        os.close(fd)
