# SPDX-License-Identifier: GPL-2.0-or-later
"""A wrong port, or a Bluetooth capture without its discovery: no command may pass over that as if all were well."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import SAMPLES

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

TCP = SAMPLES / "wires" / "made-tcp.pcapng"
BLE = SAMPLES / "wires" / "made-ble.pcapng"
COMMANDS = {
    "decode": ("decode",),
    "check": ("check",),
    "check alone": ("check", "--no-dissector"),
    "report": ("report",),
    "survey": ("survey",),
}
every = pytest.mark.parametrize("command", COMMANDS)


def run(command: str, path: Path, tmp_path: Path, *options: str) -> int:
    output = ("-o", str(tmp_path / "out.html")) if command == "report" else ()
    return main([*COMMANDS[command], *options, str(path), *output])


@every
def test_a_wrong_port(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, TCP, tmp_path, "--tcp-ports", "8890,4001") == 2
    assert "made-tcp.pcapng: no TCP segment in it is from or to port 8890,4001; tshark " in capsys.readouterr().err


@every
def test_without_the_discovery(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its handles are named, 15 (000F) of requests and 17 (0011) of replies, and say that and it is read."""
    path = tmp_path / "late.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("bluetooth0", "", 201))
        for packet in read_capture(BLE):
            if packet.data[11:13] == b"\x04\x00" and packet.data[13:14] not in {b"\x52", b"\x1b"}:
                continue  # ATT, but no write command and no notification
            writer.write_packet(packet.time_ns, packet.data)
    assert run(command, path, tmp_path) == 2
    said = capsys.readouterr().err
    assert "no Bluetooth attribute in it is known to be Daly's" in said
    assert "say which it is with --ble-handles, of 15, 17\n" in said
    assert run(command, path, tmp_path, "--ble-handles", "15,17") == 0


@every
def test_beside_a_serial_line_nothing_is_said(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = SAMPLES / "wires" / "made-all-wires.pcapng"
    assert run(command, path, tmp_path, "--tcp-ports", "1") == 0
    assert "no TCP segment" not in capsys.readouterr().err
