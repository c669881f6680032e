# SPDX-License-Identifier: GPL-2.0-or-later
"""Nothing of what was planted is left in any byte of the copy; and the copy is the capture, but for that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import a5
from tests.tools.dalytools.redact import planted
from tests.tools.dalytools.redact.planted import AROUND, CODE, PASSWORD, SERIAL, left, texts

from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalyref.options import Options
from dalytools.cli import main
from dalytools.redact.copy import redact
from dalytools.redact.what import DATES, What

if TYPE_CHECKING:
    from pathlib import Path

CUTS = {
    "a frame a packet": ((255,), False),
    "two taps": ((13,), True),
    "anywhere": ((1, 4, 9, 20, 3), False),
    "two taps, byte by byte": ((1,), True),
}
"""After how many bytes packets are cut; whether requests and replies have a tap each."""
ALL = frozenset((What.DAMAGED, What.UNKNOWN, What.FOREIGN, What.OLDER))


@pytest.fixture(scope="module", params=CUTS)
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    name: str = request.param
    cut, two = CUTS[name]
    folder = tmp_path_factory.mktemp("planted")
    before, after = planted.capture(folder / "in.pcapng", cut=cut, direction=two), folder / "out.pcapng"
    redact(str(before), str(after), Options(), frozenset())
    return before, after


def test_nothing_is_left(pair: tuple[Path, Path]) -> None:
    before, after = pair
    assert len(left(before.read_bytes())) > 50  # the search finds what is there
    assert left(after.read_bytes()) == []


def test_packets_times_lengths_and_checks_stay(pair: tuple[Path, Path]) -> None:
    old, new = (list(read_capture(path)) for path in pair)
    kept = [(p.time_ns, len(p.data), p.interface, p.direction, p.flags, p.dropped, p.number) for p in old]
    assert kept == [(p.time_ns, len(p.data), p.interface, p.direction, p.flags, p.dropped, p.number) for p in new]
    kinds = [(r.kind, len(r.data), r.time_ns, r.number) for r in decode(old)]
    assert kinds == [(r.kind, len(r.data), r.time_ns, r.number) for r in decode(new)]


@pytest.mark.parametrize("keep", [ALL, ALL | DATES], ids=["unknown and damaged kept", "dates too"])
def test_texts_go_from_what_is_kept_too(keep: frozenset[What], tmp_path: Path) -> None:
    """Of numbers that nobody explains, and were asked to be kept, more is left: PLACE, and the clocks."""
    before, after = planted.capture(tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    redact(str(before), str(after), Options(), keep)
    data = after.read_bytes()
    assert planted.PLACE in data
    assert (planted.CLOCK in data) == (keep >= DATES)
    texts_left = [text for text in left(data) if not text.startswith(("date", repr(planted.PLACE), *map(repr, CLOCKS)))]
    assert texts_left == []


CLOCKS = (planted.CLOCK, planted.OTHER_CLOCK)


def test_check_finds_nothing_new(tmp_path: Path) -> None:
    before, after = planted.capture(tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    for path in (tmp_path, before):
        path.chmod(0o755)
    assert main(["redact", str(before), "-w", str(after)]) == 0
    after.chmod(0o644)
    assert main(["check", "--baseline", str(before), "--fail-on", "note", str(after)]) == 0


def test_what_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Counted by hand: the code is read in 3 frames, and written in 3 that are answered with the same."""
    before, after = planted.capture(tmp_path / "in.pcapng"), tmp_path / "out.pcapng"
    assert main(["redact", str(before), "-w", str(after)]) == 0
    said = capsys.readouterr().out
    lines = [" ".join(line.split()) for line in said.splitlines()]
    assert lines[0].startswith(f"{after}: ")
    assert f"battery code A5 0x57 3 {len(CODE)}" in lines
    assert f"battery code A5 0x17 6 {2 * len(CODE)}" in lines
    assert f"serial number Modbus 81 1 {len(SERIAL)}" in lines
    assert "production date A5 0x53 1 3" in lines
    assert "2 interfaces renamed" in lines[-1]
    assert "file comments, hardware and system left out" in lines[-1]
    for secret in (CODE, SERIAL, PASSWORD):
        assert secret.decode() not in said


def test_blocks_that_wireshark_numbers_are_counted(tmp_path: Path) -> None:
    """Custom blocks between two packets shift the numbers of those behind; two of AROUND are such."""
    path = planted.capture(tmp_path / "in.pcapng")
    tail = path.read_bytes()
    first = len(b"".join(AROUND))
    packet = planted.block(6, bytes(12) + (13).to_bytes(4, "little") * 2 + a5(0x40, 0x90) + bytes(3))
    path.write_bytes(tail[:-first] + b"".join(AROUND) + packet)
    result = redact(str(path), str(tmp_path / "out.pcapng"), Options(), frozenset())
    assert result.tally.blocks == 2
    assert left((tmp_path / "out.pcapng").read_bytes()) == []


def test_a_text_stays_a_text(tmp_path: Path) -> None:
    """20 letters in three frames: 20 letters X; the padding is as it was."""
    path, out = tmp_path / "in.pcapng", tmp_path / "out.pcapng"
    planted.write_serial(path, [a5(0x40, 0x57), *texts(0x57, CODE), a5(0x40, 0x90)])
    redact(str(path), str(out), Options(), frozenset())
    assert [r.fields["daly.battery_code"] for r in decode(read_capture(out)) if "daly.battery_code" in r.fields] == [
        "X" * 20
    ]
    assert [p.data[4:12] for p in read_capture(out)][1:4] == [
        b"\x01" + b"X" * 7,
        b"\x02" + b"X" * 7,
        b"\x03" + b"X" * 6 + b"\0",
    ]


def test_a_copy_can_be_redacted_again(pair: tuple[Path, Path], tmp_path: Path) -> None:
    """What was blanked is no secret: the second copy has the first's records, and is written at all."""
    once, twice = pair[1], tmp_path / "twice.pcapng"
    redact(str(once), str(twice), Options(), frozenset())
    assert left(twice.read_bytes()) == []
    kinds = [(r.kind, len(r.data), r.time_ns, r.number) for r in decode(read_capture(once))]
    assert kinds == [(r.kind, len(r.data), r.time_ns, r.number) for r in decode(read_capture(twice))]
