# SPDX-License-Identifier: GPL-2.0-or-later
"""What is kept, what is blanked, and with what: small captures, expected bytes by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import a5
from tests.tools.dalytools.redact.planted import (
    CODE,
    PASSWORD,
    one,
    read,
    reply,
    texts,
    write_many,
    write_serial,
    wrote,
)
from tests.traffic import with_crc, with_crc8

from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalyref.options import Options
from dalytools.redact.copies import Copies
from dalytools.redact.copy import redact
from dalytools.redact.fill import Fill, filled
from dalytools.redact.labels import Labels, comment
from dalytools.redact.what import What, named

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

PACK = bytes.fromhex("0210000075300329")


def redacted(folder: Path, pieces: Sequence[bytes], *, apart_ms: int = 40, link_type: int = 147) -> list[bytes]:
    before, after = folder / "in.pcapng", folder / "out.pcapng"
    write_serial(before, pieces, apart_ms=apart_ms, link_type=link_type)
    redact(str(before), str(after), Options(), frozenset())
    return [packet.data for packet in read_capture(after)]


def test_values_of_the_paper_stay(tmp_path: Path) -> None:
    pieces = [a5(1, 0x90, PACK), a5(1, 0x93, b"\1\1\1\x20\0\1\xd4\xc0"), a5(1, 0x98, b"\1\2\3\4\5\6\7\3")]
    assert redacted(tmp_path, pieces) == pieces


def test_stale_bytes_by_what_was_there_before(tmp_path: Path) -> None:
    """Bytes 6 and 7 of a 91 are those of the reply before: of nobody knows what, of a 90, of a code, of a 90 again."""
    extremes = bytes.fromhex("0cf8030cee07")
    code, pack = texts(0x57, b"ABCDEFG")[0], a5(1, 0x90, PACK)
    out = redacted(
        tmp_path,
        [
            a5(1, 0x91, extremes + b"??"),
            pack,
            a5(1, 0x91, extremes + PACK[6:]),
            code,
            a5(1, 0x91, extremes + b"FG"),
            a5(2, 0x91, extremes + b"FG"),
            pack,
            a5(1, 0x91, extremes + PACK[6:]),
        ],
    )
    blanked, kept = a5(1, 0x91, extremes), a5(1, 0x91, extremes + PACK[6:])
    assert out == [blanked, pack, kept, a5(1, 0x57, b"\1XXXXXXX"), blanked, a5(2, 0x91, extremes), pack, kept]


def test_slots_behind_the_last_cell_may_be_stale(tmp_path: Path) -> None:
    """Four cells: slots 2 and 3 of frame 2 hold what frame 1 had there; byte 7 is still the code's."""
    status = a5(1, 0x94, bytes((4, 1)) + bytes(6))
    first, second = b"\1" + b"\x0c\xe4" * 3, b"\2\x0c\xe5" + b"\x0c\xe4" * 2
    out = redacted(
        tmp_path,
        [status, *texts(0x57, b"ABCDEFG"), a5(1, 0x95, first + b"G"), a5(1, 0x95, second + b"G"), a5(1, 0x90, PACK)],
    )
    assert out[2:4] == [a5(1, 0x95, first + b"\0"), a5(1, 0x95, second + b"\0")]


def test_sensors_that_are_none(tmp_path: Path) -> None:
    """One sensor by 94: the other six bytes are the code's. Without a 94 nobody knows, and they go as well."""
    for status in ([a5(1, 0x94, b"\x04\1")], []):
        out = redacted(tmp_path, [*status, *texts(0x57, b"ABCDEFG"), a5(1, 0x96, b"\1\x41BCDEFG")])
        assert out[-1] == a5(1, 0x96, b"\1\x41")


def test_what_is_written_is_told_apart(tmp_path: Path) -> None:
    """Two clocks, a second apart, are two requests, and the same one again is a retry: as before."""
    clocks = [bytes((26, 10, 17, 21, 43, 58 + at)) + b"\x03\x20" for at in (0, 1, 1)]
    pieces = [a5(0x40, 0x21, clock) for clock in clocks]
    out = redacted(tmp_path, pieces, apart_ms=300)
    assert [frame[4:12] for frame in out] == [bytes(6) + b"\x03\x20"] + [bytes(5) + b"\1\x03\x20"] * 2
    assert [bool(r.fields.get("daly.retry")) for r in decode(read_capture(tmp_path / "out.pcapng"))] == [0, 0, 1]


def test_a_confirmed_write_stays_confirmed(tmp_path: Path) -> None:
    frame = texts(0x57, CODE)[0][4:12]
    redacted(tmp_path, [a5(0x40, 0x17, frame), a5(1, 0x17, frame)])
    fields = [r.fields for r in decode(read_capture(tmp_path / "out.pcapng"))]
    assert fields[1]["daly.write_result"] == "confirmed"


def test_modbus_registers(tmp_path: Path) -> None:
    """A block with cells, an unknown register, the code; the CRC is right again, FFFF and zeros stay."""
    known, code = b"\x0c\xe4\x0c\xe5", CODE[:6] + b"\0\0"
    out = redacted(
        tmp_path,
        [
            read(0xD2, 0, 2),
            reply(0xD2, known),
            read(0xD2, 0xB9, 4),
            reply(0xD2, code),
            read(0xD2, 0xC8, 6),
            reply(0xD2, b"ZZ" + PASSWORD + b"\x17\x0b\x1d\0"),
            read(0xD2, 0xE0, 4),
            reply(0xD2, b"\xff\xff\0\0\x12\x34\xff\xff"),
        ],
        apart_ms=100,
    )
    assert out[1] == reply(0xD2, known)
    assert out[3] == reply(0xD2, b"XXXXXX\0\0")
    assert out[5] == reply(0xD2, b"XX" + b"XXXXXX" + bytes(4))
    assert out[7] == reply(0xD2, b"\xff\xff\0\0\0\0\xff\xff")


def test_modbus_writes(tmp_path: Path) -> None:
    """A password written, with its reply; the same register by register, each echoed; cells' limits stay."""
    limit = one(0xD2, 0x8B, b"\x0e\x74")
    out = redacted(
        tmp_path,
        [write_many(0xD2, 0xC9, PASSWORD), wrote(0xD2, 0xC9, 3), one(0xD2, 0xC9, b"73"), one(0xD2, 0xC9, b"73"), limit],
        apart_ms=100,
    )
    assert out == [
        write_many(0xD2, 0xC9, b"AAAAAA"),
        wrote(0xD2, 0xC9, 3),
        one(0xD2, 0xC9, b"AA"),
        one(0xD2, 0xC9, b"AA"),
        limit,
    ]


def test_a_reply_that_may_be_of_two_requests(tmp_path: Path) -> None:
    """Cells, or a part of the code: nobody knows, so nothing is kept."""
    out = redacted(tmp_path, [read(0xD2, 0, 4), read(0xD2, 0xB9, 4), reply(0xD2, CODE[:8])])
    assert out[2] == reply(0xD2, bytes(8))


def test_a_text_where_numbers_should_be(tmp_path: Path) -> None:
    """A late reply taken for the cells; currents of 30 A and more, which look like two letters each, are none."""
    currents = b"\x74\x40\x74\x41\x75\x30\x76\x21"
    out = redacted(
        tmp_path,
        [read(0xD2, 0, 4), reply(0xD2, CODE[:8]), read(0xD2, 0x93, 4), reply(0xD2, currents)],
        apart_ms=100,
    )
    assert out[1] == reply(0xD2, bytes(8))
    assert out[3] == reply(0xD2, currents)


def test_damage_stays_the_damage_it_was(tmp_path: Path) -> None:
    """A sum that was 3 too high stays so (twelve bytes: A5+01+90+08 = 13E hex, so 3E, and 3); heads stay."""
    bad = a5(1, 0x90, b"abcdefgh")
    bad = bad[:-1] + bytes(((bad[-1] + 3) & 0xFF,))
    out = redacted(tmp_path, [bad, b"secret\xff\0", a5(0x40, 0x90)[:7]], apart_ms=1000)
    assert out == [bytes.fromhex("a5019008") + bytes(8) + b"\x41", bytes(6) + b"\xff\0", a5(0x40, 0x90)[:7]]
    code = texts(0x57, b"ABCDEFG")[0]
    (out,) = redacted(tmp_path, [code[:-1] + bytes((code[-1] ^ 0x40,))])
    assert out == bytes.fromhex("a5015708") + bytes(8) + b"\x06"  # 105, and 1


def test_other_peoples_frames(tmp_path: Path) -> None:
    sino = with_crc8(bytes((0x0A, 1, 2)) + b"hi")
    text = with_crc(bytes((7, 3, 4)) + b"text")
    ask = with_crc(bytes((7, 3, 0, 1, 0, 2)))
    out = redacted(tmp_path, [sino, ask + text], apart_ms=1000)
    assert out == [with_crc8(bytes((0x0A, 1, 2, 0, 0))), ask + with_crc(bytes((7, 3, 4, 0, 0, 0, 0)))]


def test_other_makers_batteries(tmp_path: Path) -> None:
    """Pylontech: four digits of a text, "HI!"; JBD: two bytes. Their heads stay, their sums are right again."""
    out = redacted(
        tmp_path, [b"~20024600C004" + b"4849" + b"FCC2\r", bytes.fromhex("DD0500024849FF6D77")], apart_ms=1000
    )
    assert out == [b"~20024600C004" + b"0000" + b"FCDB\r", bytes.fromhex("DD0500020000FFFE77")]


def test_other_link_types_are_blanked_whole(tmp_path: Path) -> None:
    assert redacted(tmp_path, [b"an Ethernet frame"], link_type=1) == [bytes(17)]


def test_rtac_serial(tmp_path: Path) -> None:
    """Twelve bytes of header stay; so does what is in it."""
    head = bytes(8) + b"\x01" + bytes(3)
    code = texts(0x57, b"ABCDEFG")[0]
    out = redacted(tmp_path, [head + code, head[:8] + b"\x05\0\0\0what was lost"], link_type=250)
    assert out == [head + a5(1, 0x57, b"\1XXXXXXX"), head[:8] + b"\x05\0\0\0" + bytes(13)]


@pytest.mark.parametrize(
    ("raw", "text", "new"),
    [(b"AB C\0\xff", True, b"XX X\0\xff"), (b"AB\0", False, b"\0\0\0"), (b"\xff\xff", False, b"\xff\xff")],
)
def test_fill(raw: bytes, new: bytes, *, text: bool) -> None:
    assert Fill().read(raw, text=text) == new


@pytest.mark.parametrize("text", [b"XXXXXX", b"XX XXX", b"AAAA", b"AAAA C", b"AAAABA"])
def test_what_was_blanked_is_known_again(text: bytes) -> None:
    assert filled(text)


@pytest.mark.parametrize("text", [b"XXXXY", b"AAB", b"AAA1", b"AAAb", b"AAABCD", b"BAAAA"])
def test_what_was_not_is_not(text: bytes) -> None:
    assert not filled(text)


def test_fill_of_writes_numbers_the_values() -> None:
    fill = Fill()
    assert [fill.written(text, text=True) for text in (b"code 1", b"code 2", b"code 1", b"AAAAC")] == [
        b"AAAA A",
        b"AAAA B",
        b"AAAA A",
        b"AAAAD",
    ]
    assert [fill.written(raw, text=False) for raw in (b"\1\2", b"\0\2", b"\1\2", b"\0\0")] == [
        b"\0\0",
        b"\0\1",
        b"\0\0",
        b"\0\0",
    ]


def test_copies_in_every_order() -> None:
    """Six of the eight characters, in order, backward, in swapped pairs of either alignment."""
    copies = Copies()
    copies.learn(b"\0\0abcdefgh  ")
    for text in (b"cdefgh", b"hgfedc", b"dcfehg", b"cbedgf", b"ghefcd"):
        assert copies.find(b"--" + text + b"--") == [(2, 8)], text
    assert copies.find(b"abcdefgh") == [(0, 8)]
    assert not copies.find(b"abcde ghijkl")
    copies.learn(b"\1\0\0\0\0\0\1ABC")  # could be any number
    assert not copies.find(b"\1\0\0\0\0\0\1\0")


def test_labels() -> None:
    labels = Labels()
    made = [
        labels.interface(Interface("/dev/ttyUSB-Jane", description, 147, 9600, "FT232 A50285BI"))
        for description in (
            "dalyshark bus=main 9600 8N1 /dev/ttyUSB-Jane; adapter A50285BI",
            "dalyshark bus=janes-boat side=jane 19200 8E1 /dev/x",
            "dalyshark bus=janes-boat",
            "USB of Jane",
        )
    ]
    assert [each.description for each in made] == [
        "dalyshark bus=main 9600 8N1 tap1",
        "dalyshark bus=private1 19200 8E1 tap2",
        "dalyshark bus=private1 tap3",
        "",
    ]
    assert {(each.name[:3], each.hardware, each.speed) for each in made} == {("tap", "", 9600)}


@pytest.mark.parametrize(
    ("text", "event", "left"),
    [
        ("port lost: /dev/jane", True, "port lost (text removed)"),
        ("user mark 12: jane came", True, "user mark 12 (text removed)"),
        ("jane: overrun", True, "overrun (text removed)"),
        ("jane", True, "(text removed)"),
        ("jane", False, ""),
        ("", True, ""),
    ],
)
def test_comments(text: str, left: str, *, event: bool) -> None:
    assert comment(text, event=event) == left


def test_a_value_that_nobody_has_called_harmless_is_blanked() -> None:
    assert named("soc") is None
    assert named("setting.sleep") is None
    assert named("clock") is What.CLOCK
    assert named("position.of_tomorrow") is What.UNKNOWN
