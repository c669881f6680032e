# SPDX-License-Identifier: GPL-2.0-or-later
"""A port that goes away and comes back: a link that leads to a pseudo-terminal, as udev's links lead to an adapter."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus, numbered
from tests.capture.test_sides import running, until

from dalycapture.create import open_writer
from dalycapture.errors import PortError
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.reader import read_capture
from dalycapture.replug import can_come_back
from dalycapture.settings import Settings
from dalycapture.side import Side
from dalycapture.sniffer import End, Sniffer

if TYPE_CHECKING:
    from pathlib import Path

    from dalycapture.port import Port


class Socket:
    """A name under which one bus after the other is plugged in."""

    def __init__(self, folder: Path) -> None:
        self.name = folder / "usb-adapter"
        self.bus = Bus()
        self.plug(self.bus)

    def plug(self, bus: Bus) -> None:
        self.bus = bus
        self.name.symlink_to(bus.port)

    def unplug(self) -> None:
        self.name.unlink()
        self.bus.unplug()


@pytest.fixture
def socket(tmp_path: Path) -> Socket:
    return Socket(tmp_path)


def side(socket: Socket, wait_s: float | None = None) -> Side:
    settings = Settings(19200)
    port = open_port(str(socket.name), settings)
    return Side(port, tap(str(socket.name), baud=19200), settings=settings, wait_s=wait_s)


def test_it_goes_on_where_it_left_off(socket: Socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Settings | int] = []

    def spy(name: str, settings: Settings | int) -> Port:
        opened.append(settings)
        return open_port(name, settings)

    monkeypatch.setattr("dalycapture.replug.open_port", spy)
    path = tmp_path / "x.pcapng"
    sniffer = Sniffer([side(socket)], [open_writer(path)])
    with running(sniffer):
        for life in range(3):
            socket.bus.send(numbered(life) + numbered(life)[:5])
            until(lambda life=life: sniffer.tally.bytes == 18 * (life + 1))
            gone = time.monotonic()
            socket.unplug()
            until(lambda: sniffer.tally.sides[0].away)
            time.sleep(0.3)
            socket.plug(Bus())
            gap = time.monotonic() - gone
            until(lambda: not sniffer.tally.sides[0].away)
            assert sniffer.tally.sides[0].gaps_s[-1] >= gap - 0.25  # noticed late on a busy machine; not longer ago
    socket.unplug()
    packets = list(read_capture(path))
    kinds = [packet.data or packet.comment.partition(":")[0].partition(" after")[0] for packet in packets]
    assert kinds == [
        what for life in range(3) for what in (numbered(life), numbered(life)[:5], "port lost", "port back")
    ]
    back = packets[3].comment
    assert back.startswith("port back after 0.")
    assert f"{socket.name}; " in back
    assert (sniffer.tally.sides[0].gaps, sniffer.tally.end) == (3, End.STOPPED)
    assert opened == [Settings(19200)] * 3


def test_it_waits_so_long_and_no_longer(socket: Socket, tmp_path: Path) -> None:
    sniffer = Sniffer([side(socket, wait_s=0.3)], [open_writer(tmp_path / "x.pcapng")])
    thread = threading.Thread(target=sniffer.run)
    thread.start()
    socket.unplug()
    thread.join(20)
    assert sniffer.tally.end is End.PORT_LOST
    assert "did not come back" in sniffer.tally.problem


def test_a_port_that_is_away_at_the_end_counts_too(socket: Socket, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    sniffer = Sniffer([side(socket)], [open_writer(path)])
    with running(sniffer):
        gone = time.monotonic()
        socket.unplug()
        until(lambda: sniffer.tally.sides[0].away)
        time.sleep(0.3)
    tally = sniffer.tally.sides[0]
    assert tally.gaps == 1
    assert 0.3 <= tally.gaps_s[0] <= time.monotonic() - gone
    assert tally.as_json()["gaps"]["away_at_the_end"] is True
    (event,) = read_capture(path)
    assert event.comment == f"port lost: {socket.name} went away"  # what to do then, the file can't know


def test_one_of_two_sides_may_be_away(socket: Socket, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with Bus() as other:
        one = side(socket)
        two = Side(open_port(other.port), tap(other.port, side="bms"), name="bms")
        sniffer = Sniffer([one, two], [open_writer(path)])
        with running(sniffer):
            socket.unplug()
            until(lambda: sniffer.tally.sides[0].away)
            time.sleep(0.05)  # longer than a frame lasts: it begins after the loss, however its start is estimated
            other.send(numbered(1))
            until(lambda: sniffer.tally.records == 1)
    assert [packet.data for packet in read_capture(path)] == [b"", numbered(1)]


def test_a_port_that_can_not_be_opened_yet_is_tried_seldom(
    socket: Socket, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each opening raises RTS and DTR on a real port."""
    tries: list[float] = []

    def busy(*_: object) -> Port:
        tries.append(time.monotonic())
        raise PortError("in use")

    sniffer = Sniffer([side(socket)], [open_writer(tmp_path / "x.pcapng")])
    monkeypatch.setattr("dalycapture.replug.open_port", busy)
    with running(sniffer):
        socket.unplug()
        until(lambda: sniffer.tally.sides[0].away)
        socket.plug(Bus())
        time.sleep(1)
    assert 1 <= len(tries) <= 5
    socket.unplug()


def test_who_may_be_waited_for(socket: Socket) -> None:
    assert can_come_back(str(socket.name))
    assert not can_come_back(socket.bus.port)  # its number goes to somebody else's terminal
    assert can_come_back("/dev/ttyUSB7")
    assert can_come_back("socket://127.0.0.1:1")
    socket.unplug()
