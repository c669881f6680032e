# SPDX-License-Identifier: GPL-2.0-or-later
"""The comparison of both readings: no difference where there is none, and every one by name where there is one."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, FRAME_S, SAMPLES, a5, dissector, program, write
from tests.traffic import DESCRIPTIONS, Traffic

import dalytools.comparison
import dalytools.tshark
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalyref.decoder import Decoded, Decoder
from dalytools.comparison import Comparison, Difference, compare
from dalytools.problem import Problem
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from dalyref.packet import Packet

CYCLE = SAMPLES / "real-poll-cycle.pcapng"


@pytest.fixture(scope="module")
def tshark() -> Iterator[Tshark]:
    with Tshark() as one:
        yield one


def in_a_row(*pieces: bytes, pause: float = 0.001) -> list[tuple[float, bytes]]:
    """Packets one behind the other at 9600 baud."""
    at, packets = 0.0, list[tuple[float, bytes]]()
    for piece in pieces:
        packets.append((at, piece))
        at += len(piece) * 10 / 9600 + pause
    return packets


def agree(tshark: Tshark, path: Path) -> Comparison:
    result = compare(tshark, path)
    assert (result.found, [str(each) for each in result.differences], result.broken) == (0, [], "")
    return result


# What must agree


def test_several_records_in_a_packet(tshark: Tshark, tmp_path: Path) -> None:
    path = write(tmp_path / "x.pcapng", [(0.0, ASK + ANSWER + b"\x55\x55" + ASK), (1.0, ANSWER)])
    result = agree(tshark, path)
    assert (result.packets, result.records, result.kinds) == (2, 5, {"frame": 4, "junk": 1})


def test_junk_and_cut_off_frames_divided_otherwise(tshark: Tshark, tmp_path: Path) -> None:
    """The dissector shows what it cannot place at once in its own packet; the reference waits for the whole."""
    pieces = (b"\x11\x22\x33", b"\x44", ASK[:5], ASK[:3], b"\x55" * 5, ASK, b"\x66", ANSWER[:7])
    result = agree(tshark, write(tmp_path / "x.pcapng", in_a_row(*pieces)))
    assert result.kinds["frame"] == 1
    silence = [(float(n), piece) for n, piece in enumerate(pieces)]
    assert agree(tshark, write(tmp_path / "y.pcapng", silence)).kinds["frame"] == 1


@pytest.mark.parametrize("size", [1, 5, 14])
def test_a_stream_cut_anywhere(tshark: Tshark, tmp_path: Path, size: int) -> None:
    stream = b"\x01\x02" + ASK + ANSWER + ANSWER[:9] + ASK + b"\xa5" + ANSWER + b"\xd2\x03"
    pieces = [stream[at : at + size] for at in range(0, len(stream), size)]
    assert agree(tshark, write(tmp_path / "x.pcapng", in_a_row(*pieces, pause=0.0))).kinds["frame"] == 4


def test_events_between_and_inside_records(tshark: Tshark, tmp_path: Path) -> None:
    junk = b"\x77"
    pieces = [(0.0, b""), (0.01, ASK[:6]), (0.02, b""), (0.03, ASK[6:]), (0.06, junk), (0.061, b""), (0.062, junk)]
    result = agree(tshark, write(tmp_path / "x.pcapng", pieces))
    assert (result.kinds["event"], result.kinds["frame"]) == (3, 1)


@pytest.mark.parametrize("last", [ASK[:4], b"\x81\x03\x00", ASK[:12] + b"\x00" + b"\xa5\x40"])
def test_a_last_record_that_is_held(tshark: Tshark, tmp_path: Path, last: bytes) -> None:
    result = agree(tshark, write(tmp_path / "x.pcapng", [(0.0, ASK), (FRAME_S, last)]))
    assert result.kinds["frame"] >= 1
    assert result.records >= 2


def test_several_interfaces_and_buses(tshark: Tshark, tmp_path: Path) -> None:
    names = ("dalyshark bus=one", "dalyshark bus=two", "something else")
    pieces = in_a_row(ASK, ASK, ASK[:6], ANSWER, ANSWER, ASK[6:], b"\x01", b"\x02", b"\x03")
    result = agree(tshark, write(tmp_path / "x.pcapng", pieces, interfaces=names))
    assert result.kinds["frame"] == 5


def test_both_sides_of_a_tap(tshark: Tshark, tmp_path: Path) -> None:
    for flags in (1, 2):
        agree(tshark, write(tmp_path / f"{flags}.pcapng", in_a_row(ASK, ANSWER, b"\x01"), flags=flags))


def test_packets_of_other_link_types_are_passed_over(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with open_writer(path) as writer:
        for link_type in (1, 147, 162):
            writer.add_interface(Interface("made", "dalyshark", link_type))
        for number in range(9):
            writer.write_packet(EPOCH_NS + number * 10**8, ASK if number % 3 else bytes(60), interface=number % 3)
    result = agree(tshark, path)
    assert (result.packets, result.kinds) == (9, {"frame": 6})


def test_a_bus_full_of_trouble(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with open_writer(path) as writer:
        for description in DESCRIPTIONS:
            writer.add_interface(Interface("made", description))
        for packet in islice(Traffic(20).packets(), 3000):
            writer.write_packet(packet.time_ns, packet.data, interface=packet.interface, flags=packet.direction)
    result = agree(tshark, path)
    assert result.packets == 3000
    assert set(result.kinds) == {"frame", "bad_checksum", "short", "junk", "foreign", "event"}


def test_compressed(tshark: Tshark, tmp_path: Path) -> None:
    import gzip

    path = tmp_path / "x.pcapng.gz"
    path.write_bytes(gzip.compress(CYCLE.read_bytes()))
    assert agree(tshark, path).records == 25


# What must differ: errors in the dissector

# Packet, field, dissector's value, reference's value; by hand from the samples' bytes.
ERRORS = {
    "SOC a tenth of itself": (
        (r"(fields\.soc, 6, 2, \(g \* 256 \+ h\) / 10)", r"\g<1>0"),
        "real-poll-cycle.pcapng",
        Difference(2, "daly.soc", "5", "50.0"),
    ),
    "cells in the wrong order": (
        (r"(fields\.cell_voltage,) 1 \+ 2 \* i,", r"\1 1 + 2 * (real - 1 - i),"),
        "real-poll-cycle.pcapng",
        Difference(12, "daly.cell.voltage", "3783, 3778, 3776", "3776, 3778, 3783"),
    ),
    "a fault bit in the wrong place": (
        (r'\{ 0, 4, ("sum_volt_high_level_1")', r"{ 0, 6, \1"),
        "made",
        Difference(2, "daly.fault.sum_volt_high_level_1", "0", "1"),
    ),
    "the first record of a packet left out": (
        (r"for i = 1, (#items do\s+local text)", r"for i = 2, \1"),
        "made",
        Difference(3, "daly.kind", "frame", "frame, frame"),
    ),
    "junk without its first byte": (
        (r"header\(fields\.undecoded, 0, length\)", "header(fields.undecoded, 1, length - 1)"),
        "made",
        Difference(4, "bytes before", "2233", "112233"),
    ),
    "a response time half a second off": (
        (r"request, waited, shown\)", "request, 0.5, shown)"),
        "made",
        Difference(2, "daly.response_time", "0.5", "0.001"),
    ),
    "a damaged frame with a good checksum": (
        (r"show_frame\(0\)", "show_frame(1)"),
        "real-corrupt-lv165.pcapng",
        Difference(7, "daly.checksum.status", "1", "0"),
    ),
    "no board": (
        (r"(?<!out\.)made\(fields\.board, board\)", "local _ = board"),
        "real-poll-cycle.pcapng",
        Difference(25, "daly.board", "absent", "1"),
    ),
    "stale bytes as another cell": (
        (r"math\.max\(0, math\.min\(per_frame, burst\.count - first\)\), first", "per_frame, first"),
        "real-poll-cycle.pcapng",
        Difference(16, "daly.cell.voltage", "3779, 3776, 3780", "3779, 3776"),
    ),
}


def faults_and_junk(path: Path) -> Path:
    """Four packets: a request; its reply, 0x98 with byte 0 bit 4; two requests; three bytes of junk and a request."""
    ask, fault = a5(0x40, 0x98), a5(1, 0x98, b"\x10")
    at = 0.0
    packets: list[tuple[float, bytes]] = []
    for data in (ask, fault, ASK + ASK, b"\x11\x22\x33" + a5(0x40, 0x91)):
        packets.append((at, data))
        at += len(data) * 10 / 9600 + 0.001
    return write(path, packets)


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_in_the_dissector_is_named(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    error, sample, expected = ERRORS[name]
    path = SAMPLES / sample if sample != "made" else faults_and_junk(tmp_path / "x.pcapng")
    with dissector(error) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        with Tshark() as tshark:
            result = compare(tshark, path)
    assert expected in result.differences, "\n".join(map(str, result.differences))
    assert result.found == len(result.differences) > 0


WRAPPED = """\
function daly.dissector(buffer, pinfo, parent)
  local taken = whole(buffer, pinfo, parent)
  if CONDITION then
    error("on purpose")
  end
  return taken
end
claim()"""


@pytest.mark.parametrize("condition", ["pinfo.number == 5", "pinfo.number == 5 and not pinfo.visited"])
def test_an_error_of_lua_is_a_finding(condition: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Behind all that the packet shows; the second is in the first of two passes only, whose tree nobody sees."""
    renamed = (r"function daly\.dissector\(", "local function whole(")
    wrapped = (r"(?m)^claim\(\)$", WRAPPED.replace("CONDITION", condition))
    with dissector(renamed, wrapped) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        with Tshark() as tshark:
            result = compare(tshark, CYCLE)
    assert [(each.packet, each.field, each.reference) for each in result.differences] == [(5, "_ws.lua.error", "none")]
    assert "on purpose" in result.differences[0].dissector


def test_an_error_of_lua_outside_packets_is_a_finding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Told on standard error alone, by a dissector that goes on working: it passes its proof, on another file."""
    breaks = r'\1\n  if os.getenv("DALYSHARK_TEST_BREAKS") then error("at the start") end\n'
    with dissector((r"(function daly\.init\(\))", breaks)) as folder:
        monkeypatch.setattr(dalytools.tshark, "dissector_folder", lambda: folder)
        with Tshark() as tshark:
            monkeypatch.setenv("DALYSHARK_TEST_BREAKS", "1")
            result = compare(tshark, CYCLE)
    told = [each.dissector for each in result.differences if (each.packet, each.field) == (0, "_ws.lua.error")]
    assert len(told) == 1
    assert "at the start" in told[0]


# What must differ: errors in the reference


def altered(monkeypatch: pytest.MonkeyPatch, alter: Callable[[list[Decoded]], list[Decoded]]) -> None:
    class Altered(Decoder):
        def feed(self, packet: Packet) -> list[Decoded]:
            return alter(super().feed(packet))

        def finish(self) -> list[Decoded]:
            return alter(super().finish())

    monkeypatch.setattr(dalytools.comparison, "Decoder", Altered)


def another_soc(records: list[Decoded]) -> list[Decoded]:
    for record in records:
        if "daly.soc" in record.fields:
            record.fields["daly.soc"] = 50.1
    return records


def no_number_five(records: list[Decoded]) -> list[Decoded]:
    return [record for record in records if record.number != 5]


def another_field(records: list[Decoded]) -> list[Decoded]:
    for record in records:
        if record.number == 1:
            record.fields["daly.colour"] = 7
    return records


def no_life(records: list[Decoded]) -> list[Decoded]:
    for record in records:
        record.fields.pop("daly.life", None)
    return records


def a_cell_less(records: list[Decoded]) -> list[Decoded]:
    for record in records:
        cells = record.fields.get("daly.cell.voltage")
        if record.number == 12 and isinstance(cells, list):
            del cells[-1]
    return records


@pytest.mark.parametrize(
    ("alter", "expected"),
    [
        (another_soc, [Difference(2, "daly.soc", "50", "50.1")]),
        (another_field, [Difference(1, "daly.colour", "not a field of the dissector", "[7]")]),
        (no_life, [Difference(8, "daly.life", "16", "absent")]),
        (a_cell_less, [Difference(12, "daly.cell.voltage", "3776, 3778, 3783", "3776, 3778")]),
    ],
)
def test_an_error_in_the_reference_is_named(
    tshark: Tshark,
    monkeypatch: pytest.MonkeyPatch,
    alter: Callable[[list[Decoded]], list[Decoded]],
    expected: list[Difference],
) -> None:
    altered(monkeypatch, alter)
    assert compare(tshark, CYCLE).differences == expected


def test_a_record_that_the_reference_lacks(tshark: Tshark, monkeypatch: pytest.MonkeyPatch) -> None:
    altered(monkeypatch, no_number_five)
    result = compare(tshark, CYCLE)
    assert result.records == 24
    assert {each.packet for each in result.differences} == {5}
    assert Difference(5, "daly.kind", "frame", "absent") in result.differences


def test_a_record_that_the_dissector_lacks(tshark: Tshark, monkeypatch: pytest.MonkeyPatch) -> None:
    def one_more(records: list[Decoded]) -> list[Decoded]:
        return records + [Decoded(26, 0, each.kind, each.data, {}) for each in records if each.number == 25]

    altered(monkeypatch, one_more)
    assert compare(tshark, CYCLE).differences == [Difference(26, "packet", "nothing after packet 25", "1 more records")]


def test_junk_that_differs_without_a_frame_behind_it(
    tshark: Tshark, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shorter(records: list[Decoded]) -> list[Decoded]:
        for record in records:
            if record.kind == "junk":
                record.data = record.data[:-1]
        return records

    altered(monkeypatch, shorter)
    path = write(tmp_path / "x.pcapng", [(0.0, ASK), (0.02, b"\x11\x22\x33")])
    assert compare(tshark, path).differences == [Difference(2, "bytes before", "112233", "1122")]


def test_only_the_first_thousand_are_kept(tshark: Tshark, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def all_wrong(records: list[Decoded]) -> list[Decoded]:
        for record in records:
            record.fields["daly.address"] = 0
        return records

    altered(monkeypatch, all_wrong)
    result = compare(tshark, write(tmp_path / "x.pcapng", in_a_row(*[ASK] * 1200)))
    assert (result.found, len(result.differences)) == (1200, 1000)


# What cannot be compared


def test_a_tshark_that_dies_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    stops = 'case " $* " in *" -2 "*) REAL "$@" | head -n 3; echo "out of luck" >&2; exit 3;; esac; exec REAL "$@"\n'
    with program(stops) as path:
        monkeypatch.setenv("DALYSHARK_TSHARK", str(path))
        with Tshark() as tshark:
            result = compare(tshark, CYCLE)
    assert result.broken == "tshark ended with status 3: out of luck"
    assert result.differences == [Difference(4, "packet", "nothing after packet 3", "22 more records")]


@pytest.mark.parametrize(
    ("link_type", "says"),
    [
        (
            105,
            "its link type is 105 (IEEE 802.11); what is read is a serial line, as 147 (USER0) to 162 (USER15)",
        ),
        (149, "its link type is 149 (USER2)"),
    ],
)
def test_wrong_link_types(tshark: Tshark, tmp_path: Path, link_type: int, says: str) -> None:
    path = write(tmp_path / "x.pcapng", [(0.0, ASK)], link_type=link_type)
    with pytest.raises(Problem, match=r"x\.pcapng: its link type") as caught:
        compare(tshark, path)
    assert says in str(caught.value)


def test_cut_off_files_are_compared_as_far_as_they_go(tshark: Tshark, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    path.write_bytes(CYCLE.read_bytes()[:-70])
    result = compare(tshark, path)
    assert "cut off in the middle of a block" in result.broken
    assert result.found == 0
    assert 20 <= result.records < 25
