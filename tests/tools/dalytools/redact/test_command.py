# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark redact`` as people call it; and whatever a capture holds, the copy has its records."""

from __future__ import annotations

import itertools
import json
import struct
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.tools.dalytools.made import SAMPLES
from tests.tools.dalytools.redact.planted import CODE, block, capture, texts, write_serial
from tests.traffic import DESCRIPTIONS, Traffic

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalyref.options import Options
from dalytools.cli import main
from dalytools.problem import Problem
from dalytools.redact.copy import redact
from dalytools.redact.fill import Fill

if TYPE_CHECKING:
    from pathlib import Path

CYCLE = SAMPLES / "real-poll-cycle.pcapng"


def test_nothing_to_blank(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """25 frames with values of the paper, by the manifest: all of them stay."""
    out = tmp_path / "out.pcapng"
    assert main(["redact", str(CYCLE), "-w", str(out)]) == 0
    assert capsys.readouterr().out.startswith(f"{out}: 25 packets, 25 records; nothing in them had to be blanked\n")
    assert [packet.data for packet in read_capture(out)] == [packet.data for packet in read_capture(CYCLE)]


def test_for_programs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = write_serial(tmp_path / "in.pcapng", texts(0x57, CODE)), tmp_path / "out.pcapng"
    assert main(["redact", str(path), "-w", str(out), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["format"] == "dalyshark-redact"
    assert (told["packets"], told["records"], told["interfaces_renamed"]) == (3, 3, 1)
    assert told["blanked"] == [{"what": "battery code", "where": "A5 0x57", "records": 3, "bytes": 20}]


def test_statistics_without_times_end(tmp_path: Path) -> None:
    """Of an interface, as some programs write them; it must not take for ever, and nothing else is lost."""
    path, out = write_serial(tmp_path / "in.pcapng", texts(0x57, CODE)), tmp_path / "out.pcapng"
    with path.open("ab") as file:
        file.write(block(5, struct.pack("<III", 0, 1, 1)))
    assert main(["redact", str(path), "-w", str(out)]) == 0
    assert len(list(read_capture(out))) == 3


def test_a_capture_cut_off_gives_what_it_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    path.write_bytes(CYCLE.read_bytes()[:-500])
    assert main(["redact", str(path), "-w", str(out)]) == 1
    assert "whole packets; what came before is in the output" in capsys.readouterr().err
    assert len(list(read_capture(out))) > 10


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["IN", "-w", "IN"], "IN and OUT are the same file"),
        (["IN", "-w", "LINK"], "IN and OUT are the same file"),
        (["missing", "-w", "OUT"], "missing: there is no such file"),
        (["IN", "-w", "TEXT"], "is not a capture file, so it is not overwritten"),
        (["TEXT", "-w", "OUT"], "is a text file, not a capture"),
        (["EMPTY", "-w", "OUT"], "the capture holds no packet"),
        (["-", "-w", "OUT"], "reads and proves files"),
        (["IN", "-w", "-"], "reads and proves files"),
        (["IN", "-w", "OUT", "--json", "IN"], "is one of the captures"),
        (["IN", "-w", "missing/OUT"], "there is no directory"),
        (["IN", "-w", "OUT", "--keep", "all"], "invalid choice: 'all'"),
    ],
)
def test_what_can_not_be(words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "TEXT").write_text("three years of work", encoding="utf-8")
    (tmp_path / "IN").write_bytes(CYCLE.read_bytes())
    write_serial(tmp_path / "EMPTY", [])
    (tmp_path / "LINK").symlink_to(tmp_path / "IN")
    try:
        status = main(["redact", *(str(tmp_path / word) if word.isupper() else word for word in words)])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert said in capsys.readouterr().err
    assert (tmp_path / "TEXT").read_text(encoding="utf-8") == "three years of work"
    assert (tmp_path / "IN").read_bytes() == CYCLE.read_bytes()
    assert not (tmp_path / "OUT").exists()


def test_a_copy_that_would_hold_a_secret_is_not_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What proves the copy does not trust what made it."""
    path, out = capture(tmp_path / "in.pcapng"), tmp_path / "out.pcapng"

    def blind(_: object, raw: bytes, *, text: bool) -> bytes:
        return raw

    monkeypatch.setattr(Fill, "read", blind)
    with pytest.raises(Problem, match="is still in the copy"):
        redact(str(path), str(out), Options(), frozenset())
    assert [each.name for each in tmp_path.iterdir()] == ["in.pcapng"]


def test_a_copy_that_would_read_differently_is_not_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, out = write_serial(tmp_path / "in.pcapng", texts(0x57, CODE)), tmp_path / "out.pcapng"

    def headless(_address: int, _id: int, data: bytes) -> bytes:
        return bytes(5) + data

    monkeypatch.setattr("dalyref.a5.build", headless)
    with pytest.raises(Problem, match="come to look like frames"):
        redact(str(path), str(out), Options(), frozenset())
    assert not out.exists()


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 1 << 32))
def test_any_traffic_keeps_its_records(tmp_path: Path, seed: int) -> None:
    """Bursts, damage, Modbus of all kinds, packets cut anywhere: kinds, lengths, numbers and times are as before."""
    path, out = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    with open_writer(path, application="test") as writer:
        for description in DESCRIPTIONS:
            writer.add_interface(Interface("made", description))
        for made in itertools.islice(Traffic(seed).packets(), 60):
            writer.write_packet(made.time_ns, made.data, interface=made.interface, flags=made.direction)
    redact(str(path), str(out), Options(), frozenset())
    old, new = (
        [
            (r.kind, len(r.data), r.number, r.time_ns, r.fields.get("daly.request_in"), r.fields.get("daly.direction"))
            for r in decode(read_capture(each))
        ]
        for each in (path, out)
    )
    assert old == new


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from((0, 1, 101, 113, 147, 187, 201, 227, 250, 254, 276, 999)),
    st.lists(st.binary(max_size=80), min_size=1, max_size=12),
)
def test_any_bytes_under_any_link_type(tmp_path: Path, link_type: int, packets: list[bytes]) -> None:
    """Nothing breaks, and lengths stay."""
    path, out = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    write_serial(path, packets, link_type=link_type)
    redact(str(path), str(out), Options(), frozenset())
    assert [len(packet.data) for packet in read_capture(out)] == [len(packet) for packet in packets]
