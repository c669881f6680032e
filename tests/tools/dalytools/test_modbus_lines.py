# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus frames in words: the article's examples, a refusal, what fits two requests."""

from __future__ import annotations

from dalyref.decoder import decode
from dalyref.modbus import crc
from dalyref.packet import Packet
from dalytools.record_lines import line

READ_13 = bytes.fromhex("d203000c000157aa")  # the article's
WRITE_13 = bytes.fromhex("d206000c00019baa")


def frame(text: str) -> bytes:
    data = bytes.fromhex(text)
    return data + crc(data).to_bytes(2, "little")


def said(*packets: tuple[float, bytes]) -> list[str]:
    fed = (Packet(number, round(time * 1e9), data) for number, (time, data) in enumerate(packets, 1))
    return ["".join(line(record).pieces()[1:]) for record in decode(fed)]


def words(text: str) -> str:
    return " ".join(text.split())


def test_the_articles_write_is_told_for_what_it_is() -> None:
    request, reply = said((0.0, WRITE_13), (0.05, WRITE_13))
    assert words(request).startswith("host > D2 WRITE to 000C 0001 ! 000C is cell 13")
    assert "no reply" not in request
    assert words(reply) == "D2 wrote 000C 0001 (42 ms) ! write confirmed"  # 50 ms less 8 characters at 9600 baud


def test_a_switch_is_set_and_refused() -> None:
    request, reply = said((0.0, frame("d20600a50000")), (0.05, frame("d28602")))
    assert words(request) == "host > D2 WRITE to 00A5 setting.mos_charge off"
    assert words(reply).startswith("D2 refuses a write code 02")
    assert "write denied" in reply


def test_a_read_nobody_answers() -> None:
    request, last = said((0.0, READ_13), (2.0, READ_13))
    assert words(request) == "host > D2 read 000C x 1? ! no reply"
    assert words(last) == "host > D2 read 000C x 1?"  # the capture ends before its second is over


def test_a_reply_that_fits_two_requests_names_nothing() -> None:
    *_, reply = said((0.0, frame("d20300280001")), (0.02, frame("d203002a0001")), (0.1, frame("d203020203")))
    assert words(reply) == "D2 read 0203 ! two requests fit: its registers can't be named"


def test_every_number_has_its_unit() -> None:
    """Limits of D2, as the paper's scales give them: 8B and 8F, 93 and 97."""
    for register, value, told in (
        (0x8B, 3650, "setting.cell_high_1 3650 mV"),
        (0x8F, 584, "setting.pack_high_1 58.4 V"),
        (0x93, 28000, "setting.charge_current_1 -200.0 A"),
        (0x97, 95, "setting.charge_temp_high_1 55 C"),
        (0x2F, 2, "state discharging"),
        (0xCF, 1, "setting.balancer on"),
    ):
        asked, answered = frame(f"d203{register:04x}0001"), frame(f"d20302{value:04x}")
        *_, reply = said((0.0, asked), (0.1, answered))
        assert words(reply) == f"D2 read {register:04X} x 1 {told} (92 ms)"  # 100 ms less 8 characters at 9600 baud
