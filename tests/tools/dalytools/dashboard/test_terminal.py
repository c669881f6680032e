# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark watch --dashboard`` in a real terminal (tmux): what is seen, keys, and that the terminal is as before."""

from __future__ import annotations

import os
import re
import signal
from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus
from tests.tools.dalytools.dashboard.heard import ALL, SWITCH_OFF
from tests.tools.dalytools.dashboard.terminal import Terminal, until
from tests.tools.dalytools.made import ASK, a5

from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


def packets(path: Path) -> list[tuple[bytes, str]]:
    return [(packet.data, packet.comment) for packet in read_capture(path)]


def test_a_whole_session(bus: Bus, tmp_path: Path) -> None:
    """80x24: values, a mark, a pause, a second board, a write, a larger window, the end."""
    path = tmp_path / "x.pcapng"
    frames = list(ALL)
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", path) as terminal:
        terminal.until("no board has answered yet", "q  end the capture")
        assert terminal.on
        bus.send(b"".join(ALL))
        shown = terminal.until("8 good  0 bad", "4 cells: 3280 to 3310 mV, spread 30 mV", "3310▲", "3280▼")
        assert "Pack    13.2 V  -15.4 A  charging  -203 W" in shown
        assert "●2cell V" in shown
        assert f" {bus.port}  9600 baud" in shown
        assert len(shown.splitlines()) == 24
        assert "\x1b[" in terminal.screen(colours=True)

        terminal.press("m")
        terminal.until("1 mark ", "user mark 1")
        terminal.press("p")
        terminal.until("PAUSED")
        second = a5(2, 0x90, bytes.fromhex("0108 0000 7530 01f4"))  # 26.4 V, 0 A, 50 %
        bus.send(second)
        until(lambda: len(packets(path)) == len(frames) + 2)  # the capture goes on
        assert "26.4" not in terminal.screen()
        terminal.press("p")
        terminal.until("26.4", "Tab  or number: board", "── Board 1 of 2 boards")
        terminal.press("Tab")
        terminal.until("── Board 2 of 2 boards", "Pack    26.4 V  0.0 A  0 W  SOC ███░░░ 50.0 %")
        terminal.press("1")
        terminal.until("── Board 1 of 2 boards")
        terminal.press("Left")
        terminal.until("── Board 2 of 2 boards")
        bus.send(SWITCH_OFF)
        terminal.until("Written  1 write, the last at ", "WRITE D9 discharge MOS")

        terminal.resize(120, 40)
        until(lambda: "SOC ██████░░░░░░ 50.0 %" in terminal.screen(), terminal.screen)
        assert len(terminal.screen().splitlines()) == 40
        terminal.resize(60, 12)
        until(lambda: terminal.screen().splitlines()[-1].startswith(" m  mark   p  pause"), terminal.screen)

        assert "susp = <undef>" in terminal.keys_of_the_system()  # Ctrl-Z would leave the screen behind
        terminal.press("q")
        shown = terminal.ended(0, "ended: stopped", "Records      11: 10 good, 1 event", "0 differences")
    assert packets(path) == [*((frame, "") for frame in frames), (b"", "user mark 1"), (second, ""), (SWITCH_OFF, "")]
    assert "Request" not in re.sub(r"Requests +\d+", "", shown)  # no lines of records beside the screen


@pytest.mark.parametrize("how", ["C-c", "SIGTERM", "unplugged"])
def test_the_terminal_is_as_before(how: str, bus: Bus, tmp_path: Path) -> None:
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", tmp_path / "x.pcapng") as terminal:
        bus.send(ASK)
        terminal.until("1 good")
        if how == "C-c":
            terminal.press("C-c")
        elif how == "SIGTERM":
            os.kill(terminal.pid(), signal.SIGTERM)
        elif how == "unplugged":
            bus.unplug()
        terminal.ended(*((2, "ended: port lost") if how == "unplugged" else (0, "ended: stopped")))


def test_a_dashboard_that_is_killed(bus: Bus, tmp_path: Path) -> None:
    """The terminal is right at once, and the capture goes on."""
    path = tmp_path / "x.pcapng"
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", path) as terminal:
        bus.send(ASK)
        terminal.until("1 good")
        os.kill(terminal.dashboard(), signal.SIGKILL)
        until(lambda: not terminal.on)
        bus.send(ASK)
        until(lambda: len(packets(path)) == 2)
        terminal.press("q")
        terminal.ended(0, "the live view broke off, the capture did not: it was ended by Killed", "2 good")


def test_a_capture_that_is_killed(bus: Bus, tmp_path: Path) -> None:
    """Nobody is left to end the dashboard: it ends by itself, and puts the screen away."""
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", tmp_path / "x.pcapng") as terminal:
        bus.send(ASK)
        terminal.until("1 good")
        os.kill(terminal.pid(), signal.SIGKILL)
        terminal.until("THE END")
        until(lambda: not terminal.on)


def test_a_dashboard_that_hangs(bus: Bus, tmp_path: Path) -> None:
    """It gets no more than its pipe holds, the file gets everything, and the end does not wait for ever."""
    path = tmp_path / "x.pcapng"
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", path) as terminal:
        bus.send(ASK)
        terminal.until("1 good")
        os.kill(terminal.dashboard(), signal.SIGSTOP)
        for number in range(20):
            bus.send(ASK * 100)
            until(lambda number=number: len(packets(path)) == 1 + 100 * (number + 1))
        terminal.press("q")
        terminal.ended(0, "it did not keep up and was ended", "2001 good")


def test_without_colour_and_unicode(bus: Bus, tmp_path: Path) -> None:
    env = {"NO_COLOR": "1", "LC_ALL": "C"}
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", tmp_path / "x", env=env) as terminal:
        bus.send(b"".join(ALL))
        assert terminal.until("8 good", "*2cell V", "3310^").isascii()
        colours = re.findall(r"\x1b\[([\d;]*)m", terminal.screen(colours=True))
        assert {number for colour in colours for number in colour.split(";")} <= set("01237") | {"39", "49", ""}


def test_lines_on_a_dumb_terminal(bus: Bus, tmp_path: Path) -> None:
    with Terminal(tmp_path, bus.port, "--dashboard", "-w", tmp_path / "x", env={"TERM": "dumb"}) as terminal:
        terminal.until("Listening to")
        bus.send(ASK)
        terminal.until("Request board 1  0x90 Pack")
        assert not terminal.on
        terminal.press("C-c")
        terminal.ended(0, "no terminal for a dashboard: lines instead")
