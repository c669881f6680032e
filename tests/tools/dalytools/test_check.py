# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark check``: what it prints and its exit status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, SAMPLES, dissector, write

import dalytools.tshark
from dalycapture.reader import read_capture
from dalyref.decoder import Options, decode
from dalytools.cli import main
from dalytools.comparison import compare

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CYCLE = SAMPLES / "real-poll-cycle.pcapng"
FAULTS = SAMPLES / "made-faults.pcapng"


@pytest.fixture
def wrong_soc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A dissector that shows a tenth of the SOC."""
    with dissector((r"(fields\.soc, 6, 2, \(g \* 256 \+ h\) / 10)", r"\g<1>0")) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        yield


def test_every_sample_is_read_alike(capsys: pytest.CaptureFixture[str]) -> None:
    manifest = json.loads((SAMPLES / "manifest.json").read_text(encoding="utf-8"))
    files = [str(SAMPLES / entry["file"]) for entry in manifest]
    assert main(["check", "--no-rules", *files]) == 0
    shown = capsys.readouterr()
    lines = shown.out.splitlines()
    assert shown.err == ""
    assert len(lines) == len(files) + 1
    for entry, line in zip(manifest, lines, strict=False):
        records = sum(entry["counts"].values())
        assert line.startswith(f"{SAMPLES / entry['file']}: {records} records (")
        for kind, count in entry["counts"].items():
            assert f"{count} {kind}" in line
        assert line.endswith("): 0 differences")
    total = sum(count for entry in manifest for count in entry["counts"].values())
    assert lines[-1].startswith(f"{len(files)} files, {total} records, tshark ")
    assert lines[-1].endswith(": 0 differences")


@pytest.mark.usefixtures("wrong_soc")
def test_differences_are_status_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--no-rules", str(CYCLE), str(SAMPLES / "real-sinowealth.pcapng")]) == 1
    shown = capsys.readouterr()
    head, difference, other, total = shown.out.splitlines()
    assert head == f"{CYCLE}: 25 records (25 frame): 1 difference"
    assert difference == "  packet 2  daly.soc: dissector 5, reference 50.0"
    assert other.endswith("real-sinowealth.pcapng: 2 records (2 foreign): 0 differences")
    assert total.startswith("2 files, 27 records, tshark ")
    assert total.endswith(": 1 difference")
    assert shown.err == ""


@pytest.mark.usefixtures("wrong_soc")
def test_the_worst_file_decides_and_many_differences_are_cut(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("nothing here\n", encoding="utf-8")
    many = write(tmp_path / "many.pcapng", [(n * 0.1, (ASK, ANSWER)[n % 2]) for n in range(46)])
    assert main(["check", "--no-rules", "-q", str(text), str(many), str(SAMPLES / "real-sinowealth.pcapng")]) == 2
    shown = capsys.readouterr()
    assert shown.err == f"dalyshark check: {text} is a text file, not a capture; dalyshark import makes one of a log\n"
    lines = shown.out.splitlines()
    assert lines[0] == f"{many}: 46 records (46 frame): 23 differences"
    assert lines[1] == "  packet 2  daly.soc: dissector 3.85, reference 38.5"
    assert len(lines) == 1 + 20 + 1 + 1
    assert lines[-2] == "  and 3 more"
    assert lines[-1].startswith("2 of 3 files, 48 records, ")  # the text file was not compared
    assert lines[-1].endswith(": 23 differences")


def test_a_cut_off_file_is_compared_and_is_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.pcapng"
    cut.write_bytes(CYCLE.read_bytes()[:-60])
    assert main(["check", str(cut), str(CYCLE)]) == 2
    shown = capsys.readouterr()
    first, second, *_ = (line for line in shown.out.splitlines() if " records (" in line)
    records = int(first.removeprefix(f"{cut}: ").split()[0])
    assert 20 <= records <= 25
    assert first.endswith(f"({records} frame): 0 differences, 1 note")  # slot 15 of a pack of 14 cells
    assert second.startswith(f"{CYCLE}: 25 records")
    assert shown.err.startswith(f"dalyshark check: {cut}: cut off in the middle of a block at byte ")
    assert shown.err.endswith("; compared what is there\n")
    assert shown.err.count("\n") == 1


def test_names_and_comments_cannot_steer_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evil = "\x1b]0;owned\x07\x1b[2J\r\n\x9b31m"
    name = "a\x1b[31m[red]\x07\n.pcapng"
    good = write(tmp_path / name, [(0.0, b""), (0.1, ASK)], comment=evil, interfaces=[f"dalyshark bus=main {evil}"])
    bad = tmp_path / f"bad{name}"
    bad.write_bytes(b"\0\1\2")
    with_bytes = os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe.pcapng")
    write(tmp_path / "x", [(0.0, ASK)]).rename(with_bytes)
    for words, status in (
        (["check", str(good), with_bytes], 0),
        (["check", str(bad)], 2),
        (["check", str(tmp_path / f"none{name}")], 2),
        (["decode", str(good), with_bytes], 0),
        (["decode", str(bad)], 2),
        (["simulate", "--replay", str(bad)], 2),
        (["capture", str(bad), "-w", str(tmp_path / "out")], 2),
        (["watch", str(bad)], 2),
    ):
        assert main(words) == status, words
        shown = capsys.readouterr()
        for text in (shown.out, shown.err):
            assert all(character.isprintable() or character == "\n" for character in text), (words, text)
            assert "owned" not in text or words[0] == "decode"  # which shows comments, made harmless
            text.encode()
        if status:
            assert shown.err.count("\n") == 1, (words, shown.err)


def test_what_can_be_read_only_once_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    for name in ("-", str(fifo)):
        assert main(["check", name]) == 2
        assert capsys.readouterr().err == (
            f"dalyshark check: {name} can be read only once, and two readers need it; save it in a file first\n"
        )


def test_constants_reach_both_readings(tmp_path: Path) -> None:
    """At 19200 baud a frame lasts 6.8 ms: the reply begins that much after the request's end, in both."""
    path = tmp_path / "fast.pcapng"
    write(path, [(0.0, ASK), (0.05, ANSWER)])
    with dalytools.tshark.Tshark() as tshark:
        assert compare(tshark, path, options=Options(baud=19200, reply=0.02)).found == 0
        assert compare(tshark, path, options=Options(baud=19200)).found == 0
    slow, fast = (
        [record.fields.get("daly.response_time") for record in decode(read_capture(path), Options(baud))]
        for baud in (9600, 19200)
    )
    assert slow[1] == pytest.approx(0.05 - 13 * 10 / 9600, abs=1e-6)
    assert fast[1] == pytest.approx(0.05 - 13 * 10 / 19200, abs=1e-6)


def test_constants_are_options(capsys: pytest.CaptureFixture[str]) -> None:
    sample = str(SAMPLES / "real-poll-cycle.pcapng")
    assert main(["check", sample, "--baud", "19200", "--silence", "0.1", "--reply", "0.02"]) == 0
    assert "0 differences" in capsys.readouterr().out


def test_what_was_not_compared_has_no_verdict(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["check", str(tmp_path / "none.pcapng")]) == 2
    assert capsys.readouterr().out == ""


def test_the_verdict_stands_when_nobody_reads_the_table(tmp_path: Path) -> None:
    """``check | head`` ended with status 1, which means that something was found, and wrote no --json."""
    report = tmp_path / "found.json"
    for wanted, fail_on in (0, "never"), (1, "note"):
        words = ["check", "--no-dissector", "--fail-on", fail_on, "--json", report, FAULTS]
        reader, writer = os.pipe()
        os.close(reader)
        line = [sys.executable, "-c", "from dalytools.cli import entry; entry()", *map(str, words)]
        done = subprocess.run(line, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
        os.close(writer)
        assert (done.returncode, done.stderr) == (wanted, "")
        assert json.loads(report.read_text("utf-8"))["status"] == wanted
        report.unlink()
