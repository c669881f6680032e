# SPDX-License-Identifier: GPL-2.0-or-later
"""The table of tests/meaning.py through the reference decoder."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.meaning import CASES, WATCHED

from dalyref.decoder import Decoded, Decoder, decode
from dalyref.options import Options
from dalyref.packet import Packet

EPOCH_NS = 1_700_000_000_000_000_000


def packets(name: str) -> list[Packet]:
    return [
        Packet(number, EPOCH_NS + round(heard.at * 1e9), bytes.fromhex(heard.frame))
        for number, heard in enumerate(CASES[name], 1)
    ]


def seen(record: Decoded) -> dict[str, object]:
    return {name: record.fields[name] for name in WATCHED if name in record.fields}


def single(value: object) -> object:
    """A list of one is that one, as fields have it."""
    return value[0] if isinstance(value, list) and len(value) == 1 else value  # pyright: ignore[reportUnknownVariableType,reportUnknownArgumentType]


@pytest.mark.parametrize("name", CASES)
def test_meaning(name: str) -> None:
    records = list(decode(packets(name)))
    for number, (heard, record) in enumerate(zip(CASES[name], records, strict=True), 1):
        assert seen(record) == {f"daly.{key}": single(value) for key, value in heard.expect.items()}, f"packet {number}"


@pytest.mark.parametrize("name", CASES)
def test_a_record_is_held_no_longer_than_it_must(name: str) -> None:
    """Two and a half seconds later nothing more can be said of it."""
    decoder = Decoder()
    given = packets(name)
    out = [record for packet in given for record in decoder.feed(packet)]
    later = replace(given[-1], number=len(given) + 1, time_ns=given[-1].time_ns + 2_500_000_000, data=b"")
    out += decoder.feed(later)
    assert len(out) == len(given) + 1


@pytest.mark.parametrize(
    ("name", "options", "number"),
    [
        ("91 beyond 20 mV of the cells", Options(cell_tolerance=100), 3),
        ("temperatures", Options(temperature_tolerance=10), 4),
        ("pack voltage within 1 % of the cells", Options(sum_tolerance=5), 5),
        ("the cells against the 91 before", Options(age=0), 3),
        ("late", Options(late=0.5), 2),
    ],
)
def test_limits_are_options(name: str, options: Options, number: int) -> None:
    record = list(decode(packets(name), options))[number - 1]
    assert not {"daly.contradiction", "daly.late_to"} & record.fields.keys()
