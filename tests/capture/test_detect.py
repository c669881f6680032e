# SPDX-License-Identifier: GPL-2.0-or-later
"""Speed, format and swapped wires, by listening: a UART in bits stands for the wire and the adapter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus, a5, numbered, real_uart_frames
from tests.capture.uart import Line

from dalycapture import detect
from dalycapture.detect import SPEEDS, Trial, judge, trials
from dalycapture.errors import PortError
from dalycapture.opening import open_port
from dalycapture.settings import Settings
from dalytools.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.port import Port


def traffic(baud: int, parity: str = "N", *, requests: bool = True) -> Line:
    line = Line()
    for number, frame in enumerate(real_uart_frames()[:24]):
        if requests:
            line.send(a5(0x40, 0x90 + number % 9), baud, parity)
        line.send(frame, baud, parity)
    return line


class Wire:
    """Stands for a tunable port; ``listen`` gives what its receiver makes of the line."""

    def __init__(self, line: Line, *, swapped: bool = False, marks: bool = True) -> None:
        self.line, self.swapped, self.marks = line, swapped, marks
        self.settings = Settings()
        self.tuned: list[str] = []

    def retune(self, settings: Settings) -> None:
        self.settings = settings
        self.tuned.append(f"{settings.baud} {settings.line_format}")

    def listen(self, _port: Port, settings: Settings, seconds: float) -> Trial:
        assert settings == self.settings
        got = list(self.line.received(settings.baud, settings.parity, swapped=self.swapped))
        bad = sum(error for _, error in got)
        return Trial(settings, seconds, bytes(byte for byte, _ in got), bad if self.marks else None)

    def done(self) -> list[Trial]:
        return list(trials(self, Settings(), listen=self.listen))  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("baud", SPEEDS)
def test_every_speed_is_found(baud: int) -> None:
    wire = Wire(traffic(baud))
    verdict = judge(wire.done())
    assert verdict.settings == Settings(baud)
    assert verdict.text.startswith(f"Found: {baud} 8N1: ")
    assert wire.tuned[-1] == f"{baud} 8N1"  # and then it stops


@pytest.mark.parametrize("parity", ["E", "O"])
def test_parity_is_found_where_errors_are_marked(parity: str) -> None:
    verdict = judge(Wire(traffic(19200, parity)).done())
    assert verdict.settings == Settings(19200, f"8{parity}1")


def test_parity_is_not_claimed_where_they_are_not() -> None:
    verdict = judge(Wire(traffic(9600), marks=False).done())
    assert verdict.settings == Settings(9600)
    assert "Parity can not be told here" in verdict.text


@pytest.mark.parametrize("baud", [9600, 19200, 4800])
def test_swapped_wires_are_told(baud: int) -> None:
    verdict = judge(Wire(traffic(baud), swapped=True).done())
    assert verdict.settings is None
    assert verdict.text.startswith(f"A and B look swapped: at {baud} baud")


def test_what_can_not_be_known_is_not_claimed() -> None:
    """Replies alone have no zeros to go by."""
    verdict = judge(Wire(traffic(9600, requests=False), swapped=True).done())
    assert verdict.settings is None
    assert "swapped" in verdict.text


def test_other_traffic_is_not_ours() -> None:
    line = Line()
    for _ in range(30):
        line.send(bytes.fromhex("0103000000044409"), 9600)  # Modbus, somebody else's address
        line.send(b"hello world\r\n", 9600)
    assert judge(Wire(line).done()).text.startswith("Something is on the line")


def test_silence_is_silence() -> None:
    verdict = judge(Wire(Line()).done())
    assert verdict.settings is None
    assert verdict.text.startswith("Silence: not a byte in 24 s at 8 speeds.")


def test_a_line_held_low() -> None:
    assert "held low" in judge([Trial(Settings(), 3, b"", 0, breaks=1)]).text


def test_a_real_port_is_tuned_and_heard() -> None:
    with Bus() as bus:
        port = open_port(bus.port, 1200)
        settings = Settings(9600)
        detect.tuner(port)(settings)
        ticks = iter(range(1000))  # past the settling
        bus.send(b"".join(map(numbered, range(6))))
        trial = detect.listen(port, settings, 3, clock=lambda: next(ticks) / 10)
        assert trial.good == (6, 78)
        port.close()
        assert bus.heard() == b""


def test_the_command(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    wire = Wire(traffic(19200))
    monkeypatch.setattr(detect, "listen", wire.listen)

    def tuner(_: Port) -> Callable[[Settings], None]:
        return wire.retune

    monkeypatch.setattr(detect, "tuner", tuner)
    with Bus() as bus:
        assert main(["capture", "--detect", bus.port]) == 0
        assert bus.heard() == b""
    out, err = capsys.readouterr()
    assert "Found: 19200 8N1: " in out
    assert f"dalyshark capture {bus.port} --baud 19200 -w FILE" in out
    assert "9600 8N1: " in err


def test_a_url_has_no_speed_to_change() -> None:
    with Bus() as bus:
        port = open_port(bus.port)

        class Plain:
            name = "socket://x:1"

        with pytest.raises(PortError, match="only a serial device"):
            list(trials(Plain(), Settings()))  # pyright: ignore[reportArgumentType]
        port.close()
