# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN: the same secrets in candump logs; identifiers, lengths and what is no secret stay."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.redact.planted import CLOCK, CODE, UNKNOWN, left, texts

from dalycapture import socketcan
from dalycapture.reader import read_capture
from dalyref.options import Options
from dalytools.cli import main
from dalytools.redact.copy import redact

if TYPE_CHECKING:
    from pathlib import Path

PACK = "0210000075300329"


def lines(*frames: str) -> str:
    return "".join(f"(1700000000.{at:06}) janes-can {frame}\n" for at, frame in enumerate(frames))


def redacted(folder: Path, *frames: str) -> list[str]:
    log, out = folder / "log", folder / "out.pcapng"
    log.write_text(lines(*frames), encoding="ascii")
    redact(str(log), str(out), Options(), frozenset())
    assert left(out.read_bytes()) == []
    assert b"janes" not in out.read_bytes()
    found = [socketcan.unpack(packet.data) for packet in read_capture(out)]
    return [f"{each.identifier:0{8 if each.extended else 3}X}#{each.data.hex()}" for each in found if each]


def test_classic(tmp_path: Path) -> None:
    code = [frame[4:12].hex() for frame in texts(0x57, CODE)]
    out = redacted(
        tmp_path,
        "18900140#0000000000000000",
        f"18904001#{PACK}",
        "18570140#0000000000000000",
        *(f"18574001#{part}" for part in code),
        "18914001#0cf8030cee07" + CODE[5:7].hex(),
        f"18210140#{CLOCK.hex()}0320",
        "18610140#",
        f"18614001#{CLOCK.hex()}0000",
        f"186B4001#{UNKNOWN.hex()}",
    )
    xs = "58" * 7
    assert out == [
        "18900140#0000000000000000",
        f"18904001#{PACK}",
        "18570140#0000000000000000",
        f"18574001#01{xs}",
        f"18574001#02{xs}",
        f"18574001#03{'58' * 6}00",
        "18914001#0cf8030cee070000",
        "18210140#0000000000000320",
        "18610140#",
        "18614001#0000000000000000",
        "186B4001#0000000000000000",
    ]


def test_hkms(tmp_path: Path) -> None:
    """0400: byte 7 has no meaning. 040C is the clock. 0402: seven bytes have one, 0409 faults."""
    out = redacted(
        tmp_path,
        "0400FF80#0000000000000000",
        "04004001#010ce40ce50ce641",
        f"040C4001#{CLOCK.hex()}0000",
        "04024001#0210753003294142",
        "182A0180#0001000000000000",
        "04094001#0000800000000001",
        f"040B4001#003c01{UNKNOWN[3:].hex()}",
    )
    assert out == [
        "0400FF80#0000000000000000",
        "04004001#010ce40ce50ce600",
        "040C4001#0000000000000000",
        "04024001#0210753003294100",
        "182A0180#0001000000000000",
        "04094001#0000800000000001",
        "040B4001#003c010000000000",
    ]


def test_other_frames_are_blanked_and_do_not_become_ours(tmp_path: Path) -> None:
    """35E is a maker's name. Eight zeros under 0400FF80 would be a keep-alive: all would read differently."""
    out = redacted(tmp_path, "35E#50594c4f4e202020", "0400FF80#4142434445464748", "7FF#01", "12345678#1122334455")
    assert out == ["35E#0000000000000000", "0400FF80#0100000000000000", "7FF#00", "12345678#0000000000"]


def test_flexible_and_error_frames(tmp_path: Path) -> None:
    log, out = tmp_path / "log", tmp_path / "out.pcapng"
    log.write_text(lines("123##1" + "41" * 12, "20000004#0004000000000000"), encoding="ascii")
    redact(str(log), str(out), Options(), frozenset())
    flexible, error = (packet.data for packet in read_capture(out))
    assert flexible[8:] == bytes(12)
    assert error[8:] == b"\0\4" + bytes(6)


def test_check_finds_nothing_new(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    log, out = tmp_path / "log", tmp_path / "out.pcapng"
    code = [frame[4:12].hex() for frame in texts(0x57, CODE)]
    asked, answered = "18900140#0000000000000000", f"18904001#{PACK}"
    frames = (asked, answered, "18570140#", *(f"18574001#{part}" for part in code), "35E#50594c4f4e202020")
    log.write_text(lines(*frames), encoding="ascii")
    assert main(["redact", str(log), "-w", str(out)]) == 0
    out.chmod(0o644)
    assert main(["check", "--baseline", str(log), "--fail-on", "note", str(out)]) == 0
