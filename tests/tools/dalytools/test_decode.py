# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark decode``: both formats, damaged files, output files, terminals."""

from __future__ import annotations

import json
import os
import pty
import struct
import subprocess
import sys
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest

from dalyref import a5
from dalyref.decoder import Decoded, decode
from dalyref.packet import Packet
from dalytools.cli import main
from dalytools.commands.decode import jsonl
from dalytools.record_lines import line

SAMPLES = Path(__file__).parents[3] / "pcap_samples"
CYCLE = SAMPLES / "real-poll-cycle.pcapng"
ASK = a5.build(0x40, 0x90)
ANSWER = bytes.fromhex("a501900800f80000753001815d")  # 24.8 V, 0 A, 38.5 %: real frame cpy-90
NOON_NS = 1_700_000_000_123_456_789
"""14 November 2023, 22:13:20.123456789 UTC."""


@pytest.fixture(autouse=True)
def utc(monkeypatch: pytest.MonkeyPatch) -> None:
    import time

    monkeypatch.setenv("TZ", "UTC")
    time.tzset()


def block(kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    size = 12 + len(body)
    return struct.pack("<II", kind, size) + body + struct.pack("<I", size)


def option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def pcapng(*packets: tuple[int, bytes, str], link_type: int = 147) -> bytes:
    """Return a capture file made by hand; packets are (time in ns, bytes, comment)."""
    out = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    out += block(1, struct.pack("<HHI", link_type, 0, 0) + option(9, b"\x09") + option(0, b""))
    for time_ns, data, comment in packets:
        body = struct.pack("<IIIII", 0, time_ns >> 32, time_ns & 0xFFFFFFFF, len(data), len(data))
        body += data + bytes(-len(data) % 4)
        if comment:
            body += option(1, comment.encode()) + option(0, b"")
        out += block(6, body)
    return out


@pytest.fixture
def poll(tmp_path: Path) -> Path:
    path = tmp_path / "poll.pcapng"
    path.write_bytes(
        pcapng((NOON_NS, ASK, ""), (NOON_NS + 50_000_000, ANSWER, ""), (NOON_NS + 60_000_000, b"\x00\xff", ""))
    )
    return path


def said(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    status = main(["decode", *map(str, words)])
    out = capsys.readouterr()
    return status, out.out, out.err


def objects(text: str) -> list[dict[str, Any]]:
    return [json.loads(row, parse_float=Decimal) for row in text.splitlines()]


def test_jsonl(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = said(capsys, poll, "--format", "jsonl")
    assert (status, err) == (0, "")
    request, reply, junk = objects(out)
    assert list(request) == ["number", "time", "kind", "transport", "fields"]
    assert [row["number"] for row in (request, reply, junk)] == [1, 2, 3]
    assert [row["kind"] for row in (request, reply, junk)] == ["frame", "frame", "junk"]
    assert request["time"] == Decimal("1700000000.123456789")
    assert reply["time"] == Decimal("1700000000.173456789")
    assert request["fields"]["daly.reply_in"] == 2
    assert reply["fields"]["daly.pack.voltage"] == Decimal("24.8")
    assert reply["fields"]["daly.data"] == "00f8000075300181"
    assert junk["fields"] == {"daly.kind": "junk", "daly.transport": "uart", "daly.undecoded": "00ff"}


def test_jsonl_keeps_nine_decimals_and_types(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = said(capsys, CYCLE, "--format", "jsonl")
    assert status == 0
    rows = objects(out)
    assert len(rows) == 25
    assert all(len(row.split('"time": ')[1].split(",")[0].split(".")[1]) == 9 for row in out.splitlines())
    table = [row["fields"]["daly.cells.voltage"] for row in rows if "daly.cells.voltage" in row["fields"]]
    assert [len(cells) for cells in table] == [14]
    mos = next(row["fields"] for row in rows if "daly.mos.charge" in row["fields"])
    assert mos["daly.mos.charge"] is True


def test_time_before_a_second_is_padded() -> None:
    (record,) = decode([Packet(1, 5, b"\x00")])
    assert '"time": 0.000000005,' in jsonl(record)


def test_table(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = said(capsys, poll)
    assert status == 0
    rows = out.splitlines()
    assert rows[0].split() == ["1", "22:13:20.123", "host", "40", ">", "board", "1", "90", "pack?"]
    # 50 ms less 13 characters at 9600 baud
    assert " ".join(rows[1].split()) == "2 22:13:20.173 board 1 90 pack 24.8 V 0.0 A SOC 38.5 % (36 ms)"
    assert " ".join(rows[2].split()) == "3 22:13:20.183 junk 00 ff"


def text(*packets: bytes) -> str:
    return "\n".join(
        str(line(record)) for record in decode(Packet(n, n * 10**8, data) for n, data in enumerate(packets, 1))
    )


def test_lines_of_replies() -> None:
    assert "3133 mV (cell 7) to 3162 mV (cell 2)" in text(a5.build(1, 0x91, bytes.fromhex("0c5a020c3d070000")))
    assert "19 C (sensor 2) to 21 C (sensor 1)" in text(a5.build(1, 0x92, bytes.fromhex("3d013b0200000000")))
    assert "discharging  charge MOS on  discharge MOS off  20000 mAh left" in text(
        a5.build(1, 0x93, bytes.fromhex("0201000000004e20"))
    )
    assert "state 7" in text(a5.build(1, 0x93, bytes((7, 0, 0, 0, 0, 0, 0, 0))))
    assert "14 cells  1 sensors  charger 0  load 0  DI2  DO4  3 cycles" in text(
        a5.build(1, 0x94, bytes.fromhex("0e01000082000300"))
    )
    assert "cells 5 8" in text(a5.build(1, 0x97, b"\x90" + bytes(7)))
    assert "sum_volt_low_level_2  code 3" in text(a5.build(1, 0x98, b"\x80\0\0\0\0\0\0\x03"))
    assert "none" in text(a5.build(1, 0x98))
    assert "part 1: DL-BMS-" in text(a5.build(1, 0x63, b"\x01DL-BMS-"))
    assert "setting.mos_discharge on" in text(a5.build(1, 0xD9, bytes.fromhex("0101000002006cbe")))
    assert "discharging" in text(a5.build(1, 0x93, b"\x02" + bytes(7)), a5.build(1, 0x90)).splitlines()[1]


def test_lines_warn() -> None:
    assert text(ASK, *[b"?"] * 11).splitlines()[0].endswith("! no reply")
    assert "no reply" not in text(ASK)  # of the last request of a capture nothing is known (records.md, 7)
    echo, retry, *_ = text(*[ASK] * 3, *[b"?"] * 11).splitlines()[1:]  # 100 ms from begin to begin are 86 from the end
    assert "! echo" in echo
    assert "! retry, no reply" in retry
    assert "! checksum 5C is wrong" in text(ANSWER[:-1] + b"\x5c")
    assert "! cut off" in text(ANSWER[:9])
    assert "! missing part 1 2" in text(a5.build(1, 0x95, b"\x03" + bytes(7)))
    assert "! the same part again" in text(a5.build(1, 0x95, b"\x01" + bytes(7)), a5.build(1, 0x95, b"\x01" + bytes(7)))
    faults = text(a5.build(1, 0x98, b"\x01" + bytes(7)), a5.build(1, 0x98, b"\x02" + bytes(7)))
    assert faults.endswith("! came: cell_volt_high_level_2, went: cell_volt_high_level_1")


def test_lines_of_the_rest() -> None:
    assert "read 000C x 1?" in text(bytes.fromhex("d203000c000157aa"))
    assert "Sinowealth" in text(bytes.fromhex("0a01020d03fd"))
    assert text(bytes(5000)).count("\n") == 1  # cut at 4096
    assert "... 4096 bytes" in text(bytes(5000))


@pytest.mark.parametrize("time_ns", [0, 2**64 - 1, 2**80, -(2**70)])
def test_no_time_stamp_is_too_odd(time_ns: int) -> None:
    (record,) = decode([Packet(1, time_ns, b"\x00")])
    assert "junk" in str(line(record))
    assert json.loads(jsonl(record))["number"] == 1


def test_control_characters_never_reach_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "hostile.pcapng"
    hostile = "port\x1b]0;owned\x07 lost\r\n\u202e\x9b31m"
    path.write_bytes(
        pcapng((NOON_NS, b"", hostile), (NOON_NS, a5.build(1, 0x57, b"\x01\x1b[31m\x07\n"[:8].ljust(8, b"\x9b")), ""))
    )
    _, out, _ = said(capsys, path)
    assert "owned" in out
    assert out.count("\n") == 2
    assert all(character.isprintable() or character == "\n" for character in out)


# -- files ------------------------------------------------------------------------------------------------------------


def test_what_was_read_before_the_damage_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = CYCLE.read_bytes()
    path = tmp_path / "cut.pcapng"
    path.write_bytes(whole[: len(whole) // 2])
    status, out, err = said(capsys, path)
    assert status == 2
    assert 3 < len(out.splitlines()) < 25
    assert len(err.splitlines()) == 1
    assert err.startswith("dalyshark decode: ")


@pytest.mark.parametrize("content", [None, b"", b"hello, this is no capture file at all", "directory"])
def test_files_that_are_no_captures(
    content: bytes | str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "none.pcapng"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content:
        path.mkdir()
    status, out, err = said(capsys, path, "-o", tmp_path / "out.txt")
    assert (status, out) == (2, "")
    assert all(row.startswith("dalyshark decode: ") for row in err.splitlines())
    assert "none.pcapng" in err
    assert not (tmp_path / "out.txt").exists()


def test_capture_of_something_else(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "ethernet.pcapng"
    path.write_bytes(pcapng((NOON_NS, bytes(60), ""), link_type=1))
    status, out, err = said(capsys, path)
    assert (status, out) == (2, "")
    assert "Ethernet" in err
    assert "USER0" in err


def test_empty_capture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "empty.pcapng"
    path.write_bytes(pcapng())
    status, out, err = said(capsys, path)
    assert (status, out) == (0, "")
    assert "no packet" in err


def test_several_files(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = said(capsys, poll, poll.with_name("missing"), CYCLE, "--format", "jsonl")
    assert status == 2
    assert "missing" in err
    rows = objects(out)
    assert [row["file"] for row in rows] == [str(poll)] * 3 + [str(CYCLE)] * 25
    _, table, _ = said(capsys, poll, CYCLE)
    assert f"{poll}:" in table
    assert len(table.splitlines()) == 2 + 3 + 25


def test_output_file(poll: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "out.jsonl"
    place.write_text("old")
    status, out, err = said(capsys, poll, "--format", "jsonl", "-o", place)
    assert (status, out, err) == (0, "", "")
    assert len(objects(place.read_text())) == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.jsonl", "poll.pcapng"]


def test_output_that_fails_leaves_the_old_file(poll: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place = tmp_path / "out.jsonl"
    place.write_text("old")
    assert said(capsys, poll.with_name("missing"), "-o", place)[0] == 2
    assert place.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.jsonl", "poll.pcapng"]


@pytest.mark.parametrize("place", ["no/such/folder/out", ".", "/dev/full"])
def test_output_that_cannot_be(place: str, poll: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = said(capsys, poll, "-o", place if place[0] == "/" else tmp_path / place)
    assert status == 2
    assert len(err.splitlines()) == 1


def test_the_capture_itself_is_no_output(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = poll.read_bytes()
    assert said(capsys, poll, "-o", poll)[0] == 2
    assert poll.read_bytes() == before


@pytest.mark.parametrize("words", [["--baud", "0"], ["--baud", "fast"], ["--quiet", "-1"], ["--echo", "nan"], []])
def test_unusable_words(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["decode", *(["x", *words] if words else [])])
    assert stop.value.code == 2
    assert "Try: dalyshark decode --help" in capsys.readouterr().err


def test_options_reach_the_decoder(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = said(capsys, poll, "--reply", "0.01")
    assert "no reply" in out
    _, out, _ = said(capsys, poll, "--baud", "115200")
    assert "(49 ms)" in out


# -- terminals --------------------------------------------------------------------------------------------------------


def on_a_terminal(*words: str, **environment: str) -> str:
    """Run the command with a terminal as its standard output; return what the terminal got."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", "from dalytools.cli import entry; entry()", "decode", *words]
    kept = {name: value for name, value in os.environ.items() if name not in {"NO_COLOR", "FORCE_COLOR", "COLUMNS"}}
    variables = {**kept, "TERM": "xterm-256color", "TZ": "UTC", **environment}
    process = subprocess.Popen(command, stdout=theirs, stderr=theirs, stdin=subprocess.DEVNULL, env=variables)
    os.close(theirs)
    got = b""
    try:
        while chunk := os.read(ours, 65536):
            got += chunk
    except OSError:  # Linux says so when the other side is closed
        pass
    os.close(ours)
    assert process.wait() == 0
    return got.decode()


def test_colours_on_a_terminal_only(poll: Path, capsys: pytest.CaptureFixture[str]) -> None:
    coloured = on_a_terminal(str(poll))
    assert "\x1b[" in coloured
    assert "24.8 V" in coloured
    assert "\x1b" not in on_a_terminal(str(poll), NO_COLOR="1")
    assert "\x1b" not in on_a_terminal(str(poll), TERM="dumb")
    assert "\x1b" not in said(capsys, poll)[1]


def test_long_lines_are_not_folded(tmp_path: Path) -> None:
    path = tmp_path / "long.pcapng"
    path.write_bytes(pcapng((NOON_NS, bytes(40), "")))
    assert len(on_a_terminal(str(path), COLUMNS="40").strip().splitlines()) == 1


def test_reader_of_standard_output_may_leave(poll: Path) -> None:
    command = f"{sys.executable} -c 'from dalytools.cli import entry; entry()' decode {' '.join([str(CYCLE)] * 300)}"
    done = subprocess.run(["sh", "-c", f"{command} | head -1"], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert len(done.stdout.splitlines()) == 1


def test_records_come_while_the_capture_is_read(poll: Path) -> None:
    rows: list[Decoded] = list(decode([Packet(1, 0, ASK), Packet(2, 50_000_000, ANSWER)]))
    assert [line(row).kind for row in rows] == ["request", "reply"]
