# SPDX-License-Identifier: GPL-2.0-or-later
"""selftest: a pseudo-terminal with a jumper, adapters that are wrong in one way each, and never without asking."""

from __future__ import annotations

import os
import threading
import tty
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from dalycapture.line import Counts, ModemState
from dalytools.cli import main
from dalytools.hardware_test import FINE, UNKNOWN, WRONG, run

if TYPE_CHECKING:
    from collections.abc import Generator


@contextmanager
def jumper(*, joined: bool = True) -> Generator[str]:
    """A pseudo-terminal that sends back what it gets."""
    master, slave = os.openpty()
    tty.setraw(slave)
    ended = threading.Event()

    def join() -> None:
        os.set_blocking(master, False)
        while not ended.wait(0.0005):
            try:
                data = os.read(master, 4096)
            except (BlockingIOError, OSError):
                continue
            if joined:
                os.write(master, data)

    thread = threading.Thread(target=join)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ended.set()
        thread.join()
        os.close(slave)
        os.close(master)


def test_a_pseudo_terminal_with_a_jumper(capsys: pytest.CaptureFixture[str]) -> None:
    with jumper() as port:
        status = main(["selftest", "--hardware", port, "--yes"])
    said = capsys.readouterr().out
    assert status == 0, said
    assert "ok         what is sent comes back" in said
    assert "256 right" in said
    assert "not known  error counters" in said  # a pseudo-terminal has none
    assert "not known  RTS and DTR" in said


def test_no_jumper_is_said_and_ends_it(capsys: pytest.CaptureFixture[str]) -> None:
    with jumper(joined=False) as port:
        assert main(["selftest", "--hardware", port, "--yes"]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "NOT OK     what is sent comes back          nothing: is the jumper in place?  (expected: a5 5a)"
    ]


def test_nothing_is_sent_before_a_yes(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal:
        def isatty(self) -> bool:
            return True

        def readline(self) -> str:
            return "no\n"

    monkeypatch.setattr("sys.stdin", Terminal())
    master, slave = os.openpty()
    try:
        assert main(["selftest", "--hardware", os.ttyname(slave)]) == 2
        os.set_blocking(master, False)
        with pytest.raises(BlockingIOError):
            os.read(master, 1)
    finally:
        os.close(slave)
        os.close(master)
    said = capsys.readouterr().err
    assert "TRANSMITS" in said
    assert "nothing was sent" in said


def test_without_a_terminal_it_asks_for_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", open(os.devnull))  # noqa: PTH123, SIM115
    assert main(["selftest", "--hardware", "/dev/null"]) == 2
    assert "--yes" in capsys.readouterr().err


def test_a_port_that_is_none_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["selftest", "--hardware", "/dev/there-is-none", "--yes"]) == 2
    said = capsys.readouterr().err
    assert "/dev/there-is-none" in said
    assert "Traceback" not in said


class Adapter:
    """A driver that tells everything; each way to be wrong is an argument."""

    baud = 1_000_000

    def __init__(self, *, flips: bool = False, counts_breaks: bool = True, stuck_rts: bool = False) -> None:
        self._flips, self._counts_breaks, self._stuck = flips, counts_breaks, stuck_rts
        self._waiting = bytearray()
        self._state = ModemState(rts=True, dtr=True)
        self._counts = Counts()

    def write(self, data: bytes) -> None:
        self._counts = self._counts._replace(rx=self._counts.rx + len(data))
        self._waiting += bytes(byte ^ (1 if self._flips and byte == 0x7F else 0) for byte in data)

    def read(self, count: int, timeout_s: float) -> bytes:  # noqa: ARG002 - nothing is waited for
        out, self._waiting = bytes(self._waiting[:count]), self._waiting[count:]
        return out

    def send_break(self) -> None:
        if self._counts_breaks:
            self._counts = self._counts._replace(breaks=self._counts.breaks + 1)

    def set_lines(self, *, rts: bool, dtr: bool) -> None:
        self._state = ModemState(rts=rts or self._stuck, dtr=dtr)

    def modem_state(self) -> ModemState | None:
        return self._state

    def counts(self) -> Counts | None:
        return self._counts

    def latency_ms(self) -> float | None:
        return 1.0


def verdicts(adapter: Adapter) -> dict[str, str]:
    return {f"{check.what} {check.expected}": check.verdict for check in run(adapter)}


def test_an_adapter_that_is_right() -> None:
    found = verdicts(Adapter())
    assert set(found.values()) == {FINE}
    assert len(found) == 7
    assert UNKNOWN not in found.values()


@pytest.mark.parametrize(
    ("adapter", "what"),
    [
        (Adapter(flips=True), "all 256 values of a byte 256 right"),
        (Adapter(counts_breaks=False), "a break is counted 1 or more"),
        (Adapter(stuck_rts=True), "RTS and DTR RTS off, DTR off"),
    ],
)
def test_an_adapter_that_is_wrong_in_one_way(adapter: Adapter, what: str) -> None:
    found = verdicts(adapter)
    assert [name for name, verdict in found.items() if verdict == WRONG] == [what]
