# SPDX-License-Identifier: GPL-2.0-or-later
"""A wrong port, or a Bluetooth capture without its discovery: no command may pass over that as if all were well."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import SAMPLES
from tests.tools.dalytools.wires.each_command import every, run

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

TCP = SAMPLES / "wires" / "made-tcp.pcapng"
BLE = SAMPLES / "wires" / "made-ble.pcapng"


def _late(path: Path) -> Path:
    """Write the sample without its discovery."""
    with open_writer(path) as writer:
        writer.add_interface(Interface("bluetooth0", "", 201))
        for packet in read_capture(BLE):
            if packet.data[11:13] == b"\x04\x00" and packet.data[13:14] not in {b"\x52", b"\x1b"}:
                continue  # ATT, but no write command and no notification
            writer.write_packet(packet.time_ns, packet.data)
    path.chmod(0o644)
    return path


@every
def test_a_wrong_port(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command, TCP, tmp_path, "--tcp-ports", "8890,4001") == 2
    assert "made-tcp.pcapng: no TCP segment in it is from or to port 8890,4001; tshark " in capsys.readouterr().err


@every
def test_without_the_discovery(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its handles are named, 15 (000F) of requests and 17 (0011) of replies, and say that and it is read."""
    path = _late(tmp_path / "late.pcapng")
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


def test_where_the_bytes_are_can_stand_in_the_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The sample's server listens on 8899; its Bluetooth attributes are 15 and 17."""
    monkeypatch.chdir(tmp_path)
    late = str(_late(tmp_path / "late.pcapng"))
    settings = tmp_path / "dalyshark.toml"
    for right in ('tcp-ports = "8899"', "tcp-ports = 8899", 'tcp-ports = [1, "8890-8899"]'):
        settings.write_text(f"[wire]\n{right}\nble-handles = [0x0f, 17]\nreply = 1.0\n", encoding="utf-8")
        assert main(["check", str(TCP), late]) == 0
        assert "2 files, " in capsys.readouterr().out
    assert main(["check", str(TCP), "--tcp-ports", "1"]) == 2  # the command line goes first
    assert "from or to port 1;" in capsys.readouterr().err
    assert main(["check", late, "--ble-handles", "1"]) == 2


@pytest.mark.parametrize(("option", "like"), [("--tcp-ports", "8899"), ("--ble-handles", "0x0f,0x11")])
def test_what_is_no_number_is_answered_with_examples(
    option: str, like: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["decode", "x.pcapng", option, "zz"])
    assert f"{option}: 'zz' is no list of numbers from 1 to 65535; " in (said := capsys.readouterr().err)
    assert like in said
