# SPDX-License-Identifier: GPL-2.0-or-later
"""A terminal's hex log, opened by Wireshark as a capture; and files that are none."""

from __future__ import annotations

import random
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

ROOT = Path(__file__).resolve().parents[2]
REQUEST = "a5 40 90 08 00 00 00 00 00 00 00 00 7d"
REPLY = "a5 01 90 08 02 15 00 00 75 30 02 00 fc"


def read(tshark: Tshark, text: str | bytes, *passes: str) -> list[list[str]]:
    path = tshark.home / "terminal.log"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    path.chmod(0o644)
    names = ("frame.time_epoch", "daly.kind", "daly.undecoded", "frame.comment", "_ws.lua.error")
    done = tshark.run(*passes, "-r", str(path), "-T", "fields", *(word for name in names for word in ("-e", name)))
    assert b"Lua" not in done.stderr, done.stderr
    if done.returncode:
        return []
    rows = [line.split("\t") for line in done.stdout.decode(errors="replace").splitlines()]
    assert not any(row[4] for row in rows)
    return [row[:4] for row in rows]


STAMPS = {
    "1700000000.25": 1700000000.25,
    "[1700000000.25]": 1700000000.25,
    "2023-11-14T22:13:20.25Z": 1700000000.25,
    "2023-11-14 22:13:20.25": 1700000000.25,
    "2023/11/14 22:13:20,25": 1700000000.25,
    "2023-11-14T23:13:20.250000000+01:00": 1700000000.25,
    "[2023-11-14 16:43:20.25-0530]": 1700000000.25,
    "12:34:56.789": 12 * 3600 + 34 * 60 + 56.789,
    "[12:34:56]": 12 * 3600 + 34 * 60 + 56,
    "2024-02-29 00:00:00": 1709164800,
    "2000-12-31T23:59:59Z": 978307199,
}


@pytest.mark.parametrize("stamp", STAMPS)
@pytest.mark.parametrize("passes", [(), ("-2",)], ids=["one", "two"])
def test_time_stamps(tshark: Tshark, stamp: str, passes: tuple[str, ...]) -> None:
    rows = read(tshark, f"{stamp} {REQUEST}\n", *passes)
    assert len(rows) == 1
    assert (float(rows[0][0]), rows[0][1]) == (STAMPS[stamp], "frame")


@pytest.mark.parametrize(
    "written",
    [
        REQUEST,
        REQUEST.upper(),
        REQUEST.replace(" ", ""),
        REQUEST.replace(" ", ":"),
        "0x" + REQUEST.replace(" ", ",0x"),
        "0xA5, " + ", ".join(f"0x{word}" for word in REQUEST.split()[1:]),
        f"TX: {REQUEST}",
        f"rx {REQUEST}".replace("rx", "Rx"),
        f">> {REQUEST}",
        f"<<< {REQUEST}",
        f"Send: {REQUEST}",
        f"RECV {REQUEST}",
        f"Received: {REQUEST}",
        REQUEST + "   ",
        REQUEST + "\r",
    ],
)
def test_ways_to_write_bytes(tshark: Tshark, written: str) -> None:
    assert [row[1] for row in read(tshark, f"1700000000.0 {written}\n")] == ["frame"]


@pytest.mark.parametrize("passes", [(), ("-2", "-Y", "frame")], ids=["one", "two"])
def test_a_byte_order_mark_is_no_text(tshark: Tshark, passes: tuple[str, ...]) -> None:
    log = f"\ufeff1700000000.0 {REQUEST}\r\n1700000000.05 {REPLY}\r\n"
    assert [row[1] for row in read(tshark, log, *passes)] == ["frame", "frame"]


def test_a_session(tshark: Tshark) -> None:
    log = f"# recorded by hand\n\n1700000000.0 {REQUEST}\n; pause\n// more\n"
    log += f"1700000000.05 {REPLY[:20]}\n1700000000.06 {REPLY[20:]}"
    assert [row[1] for row in read(tshark, log, "-2", "-Y", "frame")] == ["frame", "", "frame"]


def test_what_is_not_understood_is_shown(tshark: Tshark) -> None:
    rows = read(tshark, f"1700000000.0 {REQUEST}\nport lost\n1700000001.0 {REPLY} xyz\n1700000002.0 {REPLY}\n")
    assert [row[1] for row in rows] == ["frame", "event", "event", "frame"]
    assert rows[1][3] == "not understood: port lost"
    assert rows[2][3].startswith("not understood: 1700000001.0 a5 01")


def test_after_midnight_is_the_next_day(tshark: Tshark) -> None:
    log = f"23:59:59.9 {REQUEST}\n00:00:00.1 {REPLY}\n23:00:00.0 {REQUEST}\n01:00:00 {REPLY}\n"
    times = [float(row[0]) for row in read(tshark, log)]
    assert times == [86399.9, 86400.1, 86400 + 82800, 2 * 86400 + 3600]


OTHERS = [
    path
    for pattern in ("*.md", "Makefile", "docs/*.md", "dissector/*.lua", "tools/dalyref/*.py")
    for path in ROOT.glob(pattern)
]


@pytest.mark.parametrize("path", OTHERS, ids=lambda path: path.name)
def test_other_texts_are_left_alone(tshark: Tshark, path: Path) -> None:
    assert read(tshark, path.read_bytes()) == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "\n\n# only a comment\n",
        "time,voltage\n2023-11-14 22:13:20,53.2\n",
        "2023-11-14 22:13:20;53;20\n",
        "1700000000,12,34\n",
        "2023-11-14 22:13:20 a line of words\n",
        f"2023-13-14 22:13:20 {REQUEST}\n",
        f"25:13:20 {REQUEST}\n",
        f"1700000000.0{REQUEST}\n",
        "1700000000.0 a 5 4 0\n",
        "1700000000.0 a54\n",
        "1700000000.0 a5 " + "00 " * 4000 + "\n",
    ],
)
def test_other_logs_are_left_alone(tshark: Tshark, text: str) -> None:
    assert not any(row[1] for row in read(tshark, text))  # Wireshark may know it by another name


def test_candump_logs_stay_wiresharks_own(tshark: Tshark) -> None:
    path = tshark.home / "can.log"
    path.write_text("(1700000000.000000) can0 18900140#0000000000000000\n")
    path.chmod(0o644)
    done = tshark.run("-r", str(path), "-T", "fields", "-e", "can.id")
    assert int(done.stdout.strip() or b"0", 0) == 0x18900140


def test_damaged_logs_raise_nothing(tshark: Tshark) -> None:
    r = random.Random(5)
    good = "".join(f"17000000{n:02d}.5 {REQUEST}\n[12:00:{n:02d}.1] TX {REPLY}\n" for n in range(60)).encode()
    for _ in range(12):
        bad = bytearray(good)
        for _ in range(r.choice((1, 20, 300))):
            at = r.randrange(200, len(bad))
            bad[at : at + r.choice((0, 1, 3))] = r.randbytes(r.choice((0, 1, 3)))
        read(tshark, bytes(bad))


@pytest.mark.timeout(60)
def test_a_capture_from_a_pipe_shows_while_it_grows(tshark: Tshark) -> None:
    """Our reader is asked only when the file is none that Wireshark knows: it would wait for the tenth line."""
    sample = (ROOT / "pcap_samples/real-poll-cycle.pcapng").read_bytes()
    end = 0
    for _ in range(4):  # section, interface, two packets
        end += int.from_bytes(sample[end + 4 : end + 8], "little")
    process = tshark.start(["-l", "-r", "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
    with process:
        assert process.stdin
        assert process.stdout
        process.stdin.write(sample[:end])
        assert b"Request board 1" in process.stdout.readline()
        process.stdin.close()
