# SPDX-License-Identifier: GPL-2.0-or-later
"""Which values begin a connection (docs/wires.md, 3). Bytes of other makers: from their public papers."""

from __future__ import annotations

import pytest

from dalyref.beginning import begins

ASK, ANSWER = "a5409008" + 8 * "00" + "7d", "a501900800f80000753001815d"
"""As in real frame cpy-90."""


@pytest.mark.parametrize(
    "value",
    [
        ASK,
        ANSWER + "a501950801",
        "ffff" + ANSWER,
        "d203000c000157aa",  # the vendor's article: a read request, its reply, a write
        "d203020001fc56",
        "d206000c00019baa",
        "81100140000274" + "3073f02ca9",  # the vendor's app writes
        "a5019508",
        "a5019508010ce40ce50ce600",  # twelve bytes
        "d2037c",  # 62 registers in 129 bytes
        "d2037c" + 125 * "00",  # 128 of them
        "5103fa0ce4",
        "d203fc0ce4",  # the WiFi module's 126 registers
        "600302000c0a",  # six of seven
    ],
)
def test_a_frame_or_the_head_of_a_longer_one_begins(value: str) -> None:
    assert begins(bytes.fromhex(value))


@pytest.mark.parametrize(
    "value",
    [
        "",
        "a5",
        "a50195",
        "a5019507",
        ANSWER[:-2] + "5e",  # whole, and damaged
        "ff" + ANSWER[:-2],  # a head, but not at the beginning
        "d203",
        "d20300",
        "d203030000",  # odd
        "d203fe0000",  # no reply is that long
        "d203020001fc57",  # whole, and damaged
        "d2037c" + 126 * "00",
        "d206000c",  # the head of a write
        "50037c0000",
        "61037c0000",
        "81037c0000",  # 81 only asks
        "8110 0f05 0002 00000000 876a",  # the app asks the module itself
    ],
)
def test_other_bytes_do_not(value: str) -> None:
    assert not begins(bytes.fromhex(value))


@pytest.mark.parametrize(
    "value",
    [
        b"ATZ\r",  # ELM327: reset, who it is, echo off; speed and temperature
        b"\r\rELM327 v1.5\r\r>",
        b"ATE0\r",
        b"010C\r",
        b"41 0C 1A F8 \r\r>",
        b"AT+VER=?\r\n",  # a board's module
        b"+VER:HLK-B40(b.2.02.1202305041115)\r\n",
        bytes.fromhex("dda50300fffd77"),  # JBD: asks for basics, cells, name
        bytes.fromhex("dda50400fffc77"),
        bytes.fromhex("dda50500fffb77"),
        bytes.fromhex("dd03001b17000000 02d003e8000020780000000000"),  # basics, over two notifications
        bytes.fromhex("001048030f020b760b82fbff77"),
        bytes.fromhex("dd0400080d060d0a0d0c0d0eff9d77"),  # four cells
    ],
)
def test_other_makers_do_not(value: bytes) -> None:
    assert not begins(value)
