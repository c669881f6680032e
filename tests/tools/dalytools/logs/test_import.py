# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark import`` as people run it, and whatever a file may hold."""

from __future__ import annotations

import io
import random
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dalycapture.captured import Told
from dalycapture.reader import read_capture
from dalyref.options import Options
from dalytools.logs.importer import Importer
from dalytools.logs.kinds import KINDS, guess
from dalytools.logs.text_lines import text_lines

if TYPE_CHECKING:
    from pathlib import Path

ASK = "A5 40 90 08 00 00 00 00 00 00 00 00 7D"
ANSWER = "A5 01 90 08 02 10 00 00 75 30 01 F4 EA"


def imported(*words: object, stdin: bytes = b"") -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-c", "from dalytools.cli import entry; entry()", "import", *map(str, words)]
    done = subprocess.run(line, input=stdin, capture_output=True, timeout=60, check=False)
    return subprocess.CompletedProcess(line, done.returncode, done.stdout.decode("latin-1"), done.stderr.decode())


def test_a_log_becomes_records_with_directions_and_origin(tmp_path: Path) -> None:
    log, out = tmp_path / "my.log", tmp_path / "my.pcapng"
    log.write_text(f"12:00:00.100 TX {ASK}\nhello\x1b[2J\n12:00:00.150 RX {ANSWER} {ANSWER}\n", encoding="utf-8")
    done = imported(log, "-w", out, "--date", "2026-11-21", "-v")
    assert done.returncode == 0
    about = KINDS["hex"]().about
    assert done.stderr.splitlines() == [
        f"dalyshark import: my.log: guessed hex ({about}): 2 of the first 3 lines fit",
        "dalyshark import: line 2: hello\\x1b[2J",
        f"dalyshark import: {out}: 2 lines with bytes of 3, 39 bytes; 3 records (3 frame)",
        "dalyshark import: 1 line was not understood",
    ]
    packets = list(read_capture(out))
    assert [packet.data.hex(" ").upper() for packet in packets] == [ASK, ANSWER, ANSWER]
    assert [packet.direction for packet in packets] == ["outbound", "inbound", "inbound"]
    noon = 20778 * 86400 * 10**9 + 43200 * 10**9
    assert [packet.time_ns - noon for packet in packets][:2] == [100_000_000, 150_000_000]
    assert "dalyshark bus=main 9600 8N1 my.log; imported from my.log, kind hex" in packets[0].description
    assert b"imported from my.log, kind hex" in out.read_bytes()[:200]


def test_raw_bytes_and_standard_streams(tmp_path: Path) -> None:
    data = bytes.fromhex(ASK + ANSWER) + b"\x00\xff"
    done = imported("-", "-w", "-", stdin=data)
    assert done.returncode == 0
    (tmp_path / "x.pcapng").write_bytes(done.stdout.encode("latin-1"))
    packets = list(read_capture(tmp_path / "x.pcapng"))
    assert b"".join(packet.data for packet in packets) == data
    assert "the log has no times" in packets[0].comment
    assert "guessed raw" in done.stderr
    assert "times between them mean nothing" in done.stderr


@pytest.mark.parametrize(
    ("content", "words", "says"),
    [
        (b"", (), "is empty"),
        (b"dear diary\nno bytes today\n", (), "a text without bytes that are known"),
        (b"\x0a\x0d\x0d\x0a", (), "is a capture already; dalyshark reframe"),
        (b"dear diary\n", ("--kind", "hex"), "no bytes were found in it as hex"),
        (ASK.encode(), ("--kind", "wav"), "invalid choice"),
        (ASK.encode(), ("--date", "yesterday"), "write 2026-01-31"),
        (ASK.encode(), ("--date", "1950-01-01"), "before 1970"),
        (ASK.encode(), ("--samplerate", "fast"), "samples a second"),
    ],
)
def test_what_can_not_be_imported_is_said_in_a_line(
    content: bytes, words: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    (tmp_path / "x.log").write_bytes(content)
    done = imported(tmp_path / "x.log", "-w", tmp_path / "x.pcapng", *words)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "x.pcapng").exists()


def test_the_log_is_never_overwritten(tmp_path: Path) -> None:
    log = tmp_path / "x.log"
    log.write_text(ASK, encoding="utf-8")
    done = imported(log, "-w", log)
    assert done.returncode == 2
    assert "the same file" in done.stderr
    assert log.read_text(encoding="utf-8") == ASK
    assert "no such file" in imported("none.log", "-w", "x").stderr


def entries_of(kind: str, text: bytes) -> bytes:
    importer = Importer("log", kind, Options(), Told())
    return b"".join(packet.data for packet in importer.packets(io.BytesIO(text)) if packet.link_type == 147)


_SHAPES = [
    f"[12:34:56.789] TX: {ASK}",
    f"24.11.2026 10:00:01.12 [TX] - {ASK}",
    f"[15:37:11.116]发→◇{ASK}",
    f"[21:57:14][D][uart_debug:114]: >>> {ASK}",
    '[1:2:3][D][uart_debug:1]: <<< "\\xA5\\u1234',
    "w a54090080000000000000000 7d",
    r"DEBUG:SerialBattery:[can0] Received: ID=0x18a64002, Daten=bytearray(b'\x01\r$')",
    "Time [s],Value,Parity Error,Framing Error",
    "0.1,0xA5,,Error",
    "1034-1117 uart-1: A5",
    "I\t10:00:00.000\tNotification received from 0000fff1-0000-1000-8000-00805f9b34fb, value: (0x) A5-01",
    "nRF Connect, 2026-99-99",
    "00000000: a540 9008  ....",
    "*",
    "99:99:99 A5",
    "31.02.2026 10:00:00 A5 40",
]


@given(
    st.lists(st.tuples(st.sampled_from(_SHAPES), st.integers(0, 200), st.text(max_size=4)), max_size=8),
    st.binary(max_size=40),
)
@settings(max_examples=300, deadline=None)
@example([("*", 0, "")], b"\xff\xfe\x00")
def test_no_file_ever_raises(shapes: list[tuple[str, int, str]], garbage: bytes) -> None:
    lines = [shape[:at] + noise + shape[at:] for shape, at, noise in shapes]
    text = "\n".join(lines).encode("utf-8", "replace") + garbage
    found = list(text_lines(io.BytesIO(text)))
    guess(found)
    for kind in KINDS:
        entries_of(kind, text)


def test_ten_thousand_mutated_logs() -> None:
    chance = random.Random(6)
    for _ in range(10_000):
        line = bytearray(chance.choice(_SHAPES).encode())
        for _ in range(chance.randrange(4)):
            line[chance.randrange(len(line))] = chance.randrange(256)
        kind = chance.choice(list(KINDS))
        list(Importer("log", kind, Options(), Told()).packets(io.BytesIO(bytes(line) * chance.randrange(1, 3))))


def test_lines_without_end_are_read_in_pieces() -> None:
    data = bytes(range(256)) * 4000
    assert entries_of("hex", data.hex().encode()) == data
    assert entries_of("hex", data.hex(" ").encode()) == data
    assert max(map(len, text_lines(io.BytesIO(b"x" * 1_000_000)))) <= 1 << 16
    assert list(text_lines(io.BytesIO(b"a\r\nb\rc\n\nd"))) == ["a", "b", "c", "", "d"]
