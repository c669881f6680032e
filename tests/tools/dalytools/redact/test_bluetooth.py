# SPDX-License-Identifier: GPL-2.0-or-later
"""Bluetooth: the secrets of the line, and those of the link; the shape of things stays."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import a5
from tests.tools.dalytools.redact import planted_bluetooth as made
from tests.tools.dalytools.redact.planted import EPOCH_NS, left, texts
from tests.tools.dalytools.redact.planted_bluetooth import DONGLE, KEY, OTHER, PHONE, RECEIVED, SENT, Row

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalyref.options import Options
from dalytools.cli import main
from dalytools.redact.copy import redact

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

LINK = (DONGLE, OTHER, PHONE, KEY, b"jane", b"Jane")

CAPTURES: dict[str, Callable[[Path], Path]] = {
    "whole": made.capture,
    "in parts": lambda path: made.capture(path, size=11),
    "without the discovery": lambda path: made.capture(path, discovered=False),
    "btsnoop": made.btsnoop,
    "monitor": made.monitor,
}


@pytest.fixture(scope="module", params=CAPTURES)
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    name: str = request.param
    folder = tmp_path_factory.mktemp("bluetooth")
    before, after = CAPTURES[name](folder / "in"), folder / "out.pcapng"
    redact(str(before), str(after), Options(), frozenset())
    return before, after


def test_nothing_is_left(pair: tuple[Path, Path]) -> None:
    before, after = (path.read_bytes() for path in pair)
    assert len(left(before)) > 50
    assert left(after) == []
    for secret in LINK:
        assert secret not in after, secret
        assert secret[::-1] not in after, secret
    assert DONGLE[::-1] in before


def test_packets_times_and_lengths_stay(pair: tuple[Path, Path]) -> None:
    old, new = (list(read_capture(path)) for path in pair)
    assert [(p.time_ns, len(p.data), p.number) for p in old] == [(p.time_ns, len(p.data), p.number) for p in new]


def test_check_finds_nothing_new(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    before, after = made.capture(tmp_path / "in.pcapng", size=11), tmp_path / "out.pcapng"
    before.chmod(0o644)
    assert main(["redact", str(before), "-w", str(after)]) == 0
    after.chmod(0o644)
    assert main(["check", "--fail-on", "note", "--baseline", str(before), str(after)]) == 0


def redacted(folder: Path, rows: list[Row]) -> list[bytes]:
    before, after = folder / "in.pcapng", folder / "out.pcapng"
    with open_writer(before, application="test") as writer:
        writer.add_interface(Interface("", "", 201))
        for number, (direction, kind, packet) in enumerate(rows):
            writer.write_packet(EPOCH_NS + number * 40_000_000, struct.pack(">IB", direction, kind) + packet)
    redact(str(before), str(after), Options(), frozenset())
    return [packet.data[5:] for packet in read_capture(after)]


@pytest.mark.parametrize("size", [255, 11, 5])
def test_frames_over_several_values(size: int, tmp_path: Path) -> None:
    """A request, and 39 bytes of replies in two values, these in data packets of so many bytes: all sums are right."""
    ask, replies = a5(0x80, 0x57), b"".join(texts(0x57, b"ABCDEFGHIJKLMNOPQRST"))
    expected = b"".join(a5(1, 0x57, bytes((at,)) + b"X" * (7 if at < 3 else 6)) for at in (1, 2, 3))
    start = [made.connected(DONGLE), *made.discovery()]

    def values(content: bytes) -> list[Row]:
        parts = (ask, SENT), (content[:20], RECEIVED), (content[20:], RECEIVED)
        return [row for part, side in parts for row in made.value(side, part, size=size)]

    out = redacted(tmp_path, [*start, *values(replies)])
    assert out[len(start) :] == [packet for _, _, packet in values(expected)]


def test_the_link_keeps_its_shape(tmp_path: Path) -> None:
    """That a connection began and ended, discovery, and who asked what, are as they were; addresses are new ones."""
    end: Row = (RECEIVED, made.EVENT, b"\x05\x04\x00\x40\x00\x13")
    error = made.l2cap(RECEIVED, b"\x01\x08\x11\x00\x0a")
    old = [made.connected(DONGLE), *made.discovery(), *error, end]
    out = redacted(tmp_path, old)
    new = bytes.fromhex("020000000001")
    assert out == [packet.replace(DONGLE[::-1], new[::-1]) for _, _, packet in old]


@pytest.mark.parametrize(("subevent", "length"), [(0x0A, 31), (0x29, 34)])
def test_enhanced_events_tell_of_a_connection_too(subevent: int, length: int, tmp_path: Path) -> None:
    """Address of the peer from byte 6 of the parameters on; the copy's reader has to see the connection begin."""
    head = b"\x3e" + bytes((length, subevent)) + b"\x00\x40\x00\x00\x01"
    rest = bytes(length - 12)
    out = redacted(tmp_path, [(RECEIVED, made.EVENT, head + DONGLE[::-1] + rest)])
    assert out == [head + bytes.fromhex("010000000002") + rest]


def test_characteristics_asked_for_in_the_long_form_stay(tmp_path: Path) -> None:
    """Else nothing in the copy tells which attributes are Daly's."""
    long = struct.pack("<BHH", 8, 1, 0xFFFF) + bytes.fromhex("fb349b5f8000008000100000" + "03280000")
    old = [*made.l2cap(SENT, long), *made.discovery()[1:]]
    assert redacted(tmp_path, old) == [packet for _, _, packet in old]


def test_what_the_module_says(tmp_path: Path) -> None:
    """Its words stay, what they are about does not."""
    start = [made.connected(DONGLE), *made.discovery()]
    out = redacted(tmp_path, [*start, *made.value(SENT, b"AT+MAC?\r\n"), *made.value(RECEIVED, b"+MAC:a4:c1:38\r\nOK")])
    assert out[-2] == made.value(SENT, b"AT+MAC?\r\n")[0][2]
    assert out[-1] == made.value(RECEIVED, b"+MAC:XX:XX:XX\r\nXX")[0][2]


@pytest.mark.parametrize(
    ("pdu", "new"),
    [
        (b"\x0b" + b"name", b"\x0b" + bytes(4)),
        (b"\x11\x06\x01\x00\x05\x00\x0a\x18", b"\x11\x06\x01\x00\x05\x00\x0a\x18"),
        (b"\x16\x0f\x00\x00\x00" + b"name", b"\x16\x0f\x00\x00\x00" + bytes(4)),
        (b"\xd2\x0f\x00" + b"name", b"\xd2\x0f\x00" + bytes(4)),
        (b"\x06\x01\x00\xff\xff\x00\x28\xf0\xff", b"\x06\x01\x00\xff\xff\x00\x28\xf0\xff"),
        (b"\x06\x01\x00\xff\xff\x00\x2a" + b"name", b"\x06\x01\x00\xff\xff\x00\x2a" + bytes(4)),
        (b"\x09\x04\x03\x00NA\x05\x00ME", b"\x09\x04\x03\x00\0\0\x05\x00\0\0"),
        (b"\x7f" + b"name", b"\x7f" + bytes(4)),
        (b"", b""),
    ],
)
def test_attribute_packets(pdu: bytes, new: bytes, tmp_path: Path) -> None:
    assert redacted(tmp_path, made.l2cap(RECEIVED, pdu)) == [made.l2cap(RECEIVED, new)[0][2]]


@pytest.mark.parametrize("length", range(30))
def test_packets_cut_off_anywhere(length: int, tmp_path: Path) -> None:
    """By a snap length: nothing of the name is left, nothing breaks."""
    rows = [made.advertising(DONGLE, b"secretname"), *made.value(RECEIVED, b"secretname"), made.connected(DONGLE)]
    out = redacted(tmp_path, [(side, kind, packet[:length]) for side, kind, packet in rows])
    assert [len(packet) for packet in out] == [min(length, len(packet)) for _, _, packet in rows]
    assert not any(part in packet for packet in out for part in (b"sec", b"ret", b"name", DONGLE[::-1][:4]))
