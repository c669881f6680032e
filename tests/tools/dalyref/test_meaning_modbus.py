# SPDX-License-Identifier: GPL-2.0-or-later
"""The table of tests/meaning_modbus.py through the reference decoder."""

from __future__ import annotations

from dataclasses import replace

import pytest
from tests.meaning_modbus import CASES, watched
from tests.tools.dalyref.test_meaning import EPOCH_NS, single

from dalyref.decoder import Decoded, Decoder, decode
from dalyref.options import Options
from dalyref.packet import Packet


def packets(name: str) -> list[Packet]:
    return [
        Packet(number, EPOCH_NS + round(heard.at * 1e9), bytes.fromhex(heard.frame), direction=heard.side)
        for number, heard in enumerate(CASES[name], 1)
    ]


def seen(record: Decoded) -> dict[str, object]:
    return {name: record.fields[name] for name in watched(record.fields["daly.dialect"]) if name in record.fields}


@pytest.mark.parametrize("name", CASES)
def test_meaning(name: str) -> None:
    records = list(decode(packets(name)))
    for number, (heard, record) in enumerate(zip(CASES[name], records, strict=True), 1):
        assert seen(record) == {f"daly.{key}": single(value) for key, value in heard.expect.items()}, f"packet {number}"


@pytest.mark.parametrize("name", CASES)
def test_requests_and_replies_name_each_other(name: str) -> None:
    records = {record.number: record for record in decode(packets(name))}
    for number, record in records.items():
        request = record.fields.get("daly.request_in")
        if request is not None:
            assert isinstance(request, int)
            assert records[request].fields["daly.reply_in"] == number
            waited = record.time_ns / 1e9 - CASES[name][request - 1].at - EPOCH_NS / 1e9
            took = len(records[request].data) * 10 / 9600
            assert record.fields["daly.response_time"] == pytest.approx(waited - took, abs=1e-6)
        else:
            assert "daly.response_time" not in record.fields
        reply = record.fields.get("daly.reply_in")
        if reply is not None:
            assert isinstance(reply, int)
            assert records[reply].fields["daly.request_in"] == number


@pytest.mark.parametrize("name", CASES)
def test_a_record_is_held_no_longer_than_it_must(name: str) -> None:
    """Two and a half seconds later nothing more can be said of it."""
    decoder = Decoder()
    given = packets(name)
    out = [record for packet in given for record in decoder.feed(packet)]
    latest = max(packet.time_ns for packet in given)
    later = replace(given[-1], number=len(given) + 1, time_ns=latest + 2_500_000_000, data=b"")
    out += decoder.feed(later)
    assert len(out) == len(given) + 1


@pytest.mark.parametrize(
    ("name", "options", "number"),
    [
        ("SOC: D2 against the only A5 board", Options(soc_tolerance=2), 5),
        ("SOC: D2 against the only A5 board", Options(age=0.01), 5),
        ("late: nobody knows which registers", Options(late=0.5), 2),
    ],
)
def test_limits_are_options(name: str, options: Options, number: int) -> None:
    record = list(decode(packets(name), options))[number - 1]
    assert not {"daly.contradiction", "daly.late_to"} & record.fields.keys()
