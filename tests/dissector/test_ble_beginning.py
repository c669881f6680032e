# SPDX-License-Identifier: GPL-2.0-or-later
"""Where Daly begins on a connection (docs/wires.md 3): other makers' devices have fff1, fff2, ff01 and ff02 too."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from tests.dissector.dissection import DESTINATION, SOURCE, Dissect, Row, info, kinds, number
from tests.dissector.hci_frames import H4, H4_DIRECTION, MONITOR, Radio, btsnoop
from tests.dissector.test_ble import (
    DISCOVERED,
    PASSES,
    PASSWORD,
    PASSWORD_REQUEST,
    REPLY,
    REQUEST,
    SPEAKS,
    WRITES,
    radio,
    run,
)
from tests.dissector.test_doors import ask
from tests.dissector.test_views import Sharkd
from tests.traffic import with_crc

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalytools.tshark import Tshark

ASK, TELL = True, False
Talk = list[tuple[bool, str]]  # by the host or not, value as hex


def text(*lines: str) -> Talk:
    """What a host asks and a device answers by turns."""
    return [(at % 2 == 0, line.encode().hex()) for at, line in enumerate(lines)]


# An adapter for a car's diagnosis: words of modems, and hexadecimal digits as text.
ELM327 = text("ATZ\r", "\r\rELM327 v1.5\r\r>", "ATE0\r", "OK\r\r>", "010C\r", "41 0C 1A F8 \r\r>", "0105\r", "+OK\r\n>")
# A board of JBD: its own frames, DD .. 77; the replies of 03 and 04 are longer than a value.
JBD: Talk = [
    (ASK, "dda50300fffd77"),
    (TELL, "dd03001b14e6002f2710271000002b5e00000000"),
    (TELL, "00001057031002010b9a0b8afc7377"),
    (ASK, "dda50400fffc77"),
    (TELL, "dd0400080d050d060d070d08ff9577"),
]
# Nearly Daly's: a wrong checksum; a whole reply with a wrong CRC; heads of no reply that there is, and too short.
NEARLY: Talk = [
    (ASK, REQUEST[:-2] + "00"),
    (TELL, PASSWORD[:-2] + "00"),
    (TELL, REPLY[:6]),
    (TELL, "a5019007" + "00" * 4),
    (TELL, "00" + REPLY[:20]),
    (TELL, "d203"),
    (TELL, "d2030500"),  # an odd number of bytes
    (TELL, "d2030000"),  # none
    (TELL, "d203fe00"),  # 254
    (TELL, "6103" + "4000"),
    (TELL, "5003" + "4000"),
    (ASK, "8103" + "4000"),
    (TELL, "d2060007"),
    (TELL, "d210000a"),
    (ASK, with_crc(bytes.fromhex("81100f05000200000000")).hex()),  # the module's own
    (TELL, with_crc(bytes.fromhex("51100f05aaaa")).hex()),
    (TELL, with_crc(bytes.fromhex("01030200ab")).hex()),  # Modbus of another maker
    (TELL, ""),
]


def talk(made: Radio, words: Talk, *, asks: int = WRITES, tells: int = SPEAKS) -> None:
    for by_host, value in words:
        made.write(asks, value) if by_host else made.notify(tells, value)


def silent(rows: Sequence[Row]) -> bool:
    """No field of ours, no word of ours in a column."""
    columns = [value for row in rows for value in (info(row), *row.get(SOURCE, []), *row.get(DESTINATION, []))]
    return not any(name.startswith("daly.") for row in rows for name in row) and not any(
        word in value for value in columns for word in ("Daly", "Reply", "module", "junk", "Short", "bytes")
    )


@pytest.mark.parametrize(
    ("link_type", "passes"),
    [(H4, "one"), (H4, "two"), *((H4_DIRECTION, passes) for passes in PASSES), (MONITOR, "one"), (MONITOR, "two")],
)
def test_other_makers_devices_are_nobodys(dissect: Dissect, link_type: int, passes: str) -> None:
    made = Radio(link_type=link_type)
    for words, uuids in (ELM327, (0xFFF2, 0xFFF1)), (JBD, (0xFF02, 0xFF01)), (NEARLY, (0xFFF2, 0xFFF1)):
        made.complete()
        made.discover(*zip((WRITES, SPEAKS), uuids, strict=True))
        talk(made, words)
        made.connection += 1
    assert silent(run(dissect, made, **PASSES[passes]))


@pytest.mark.parametrize("passes", PASSES)
def test_from_the_first_frame_on_all_is_taken(dissect: Dissect, passes: str) -> None:
    """The module's text and junk before the first request are nobody's; behind it they are shown, on both sides."""
    made = radio()
    noise: Talk = [(ASK, b"AT+VER=?\r\n".hex()), (TELL, b"+VER:1\r\n".hex()), (TELL, "000102")]
    talk(made, noise)  # 4, 5, 6
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY)
    talk(made, noise)
    rows = run(dissect, made, **PASSES[passes])
    assert silent(rows[:6])
    assert kinds(rows[6:]) == ["frame", "frame", "foreign", "foreign", "junk"]
    assert number(rows[7], "request_in") == 7
    assert number(rows[7], "pack.voltage") == 53.3


LONGEST = with_crc(bytes.fromhex("5103fc" + "00" * 252)).hex()
SHORT = with_crc(bytes.fromhex("60030400010002")).hex()
FIRST = [
    (REPLY[:8], REPLY[8:], "pack.voltage", 53.3),
    (REPLY[:24], REPLY[24:], "pack.voltage", 53.3),
    (PASSWORD[:6], PASSWORD[6:], "modbus.address", 0xD2),
    (LONGEST[:40], LONGEST[40:], "board", 1),
    (SHORT[:16], SHORT[16:], "board", 16),
]


@pytest.mark.parametrize("passes", PASSES)
def test_the_head_of_a_frame_that_goes_on_begins(dissect: Dissect, passes: str) -> None:
    made = Radio()
    for head, rest, _, _ in FIRST:
        made.complete()
        made.discover(*DISCOVERED)
        talk(made, [(TELL, "00"), (TELL, head), (TELL, rest)])  # 4, 5, 6
        made.connection += 1
    rows = run(dissect, made, **PASSES[passes])
    held = "short" if passes == "one" else ""  # for now
    assert kinds(rows) == ["", "", "", "", held, "frame"] * len(FIRST)
    for at, (_, _, name, expected) in enumerate(FIRST):
        assert number(rows[6 * at + 5], name) == expected
        assert silent(rows[6 * at : 6 * at + 4])


def test_a_frame_anywhere_in_the_value_begins_with_the_value(dissect: Dissect) -> None:
    made = radio()
    made.notify(SPEAKS, "0001" + REPLY + "02")
    made.notify(SPEAKS, "03")
    assert kinds(run(dissect, made)) == ["", "", "", "junk+frame+junk", "junk"]


@pytest.mark.parametrize("by_host", [True, False])
def test_one_attribute_and_direction_begins_all(dissect: Dissect, by_host: bool) -> None:
    made = Radio()
    made.complete()
    made.discover(*DISCOVERED, (0x20, 0xFF01), (0x22, 0xFF02), (0x24, 0x2A19))
    others: list[tuple[int, Talk]] = [
        (handle, [(ASK, "0102"), (TELL, "0304")]) for handle in (WRITES, SPEAKS, 0x20, 0x22, 0x24)
    ]
    for handle, words in others:
        talk(made, words, asks=handle, tells=handle)
    talk(made, [(by_host, REQUEST if by_host else REPLY)], asks=0x20, tells=0x22)
    for handle, words in others:
        talk(made, words, asks=handle, tells=handle)
    rows = run(dissect, made)
    assert silent(rows[:13])
    assert kinds(rows)[13:] == ["frame", *["junk"] * 8, "", ""]


@pytest.mark.parametrize("passes", PASSES)
def test_a_new_connection_begins_anew(dissect: Dissect, passes: str) -> None:
    made = radio()
    made.write(WRITES, REQUEST)  # 4
    made.complete()
    made.discover(*DISCOVERED)
    talk(made, ELM327)  # 8 to 15
    made.notify(SPEAKS, REPLY)
    rows = run(dissect, made, **PASSES[passes])
    assert kinds(rows) == ["", "", "", "frame", *[""] * 11, "frame"]
    assert silent(rows[4:15])


@pytest.mark.parametrize("passes", PASSES)
def test_each_connection_begins_by_itself(dissect: Dissect, passes: str) -> None:
    """An adapter for cars and a board at the same time."""
    made = radio()
    made.connection = 0x41
    made.complete()
    made.discover(*DISCOVERED)
    made.write(WRITES, REQUEST)  # 7
    made.connection = 0x40
    talk(made, ELM327)  # 8 to 15
    made.connection = 0x41
    made.notify(SPEAKS, REPLY)  # 16
    rows = run(dissect, made, **PASSES[passes])
    assert [at for at, kind in enumerate(kinds(rows), 1) if kind] == [7, 16]
    assert silent(rows[7:15])


@pytest.mark.parametrize("passes", PASSES)
def test_a_handle_of_the_users_is_dalys_at_once(dissect: Dissect, passes: str) -> None:
    """And its connection with it; until then what is known by its UUID alone is nobody's."""
    made = radio()
    talk(made, ELM327[:2])  # 4, 5
    made.notify(0x30, "")  # no value: begins nothing
    talk(made, ELM327[:2])  # 7, 8
    made.notify(0x30, b"OK".hex())  # 9
    made.notify(0x30, "0102")
    talk(made, [(ASK, "03"), (TELL, REPLY)])
    rows = run(dissect, made, options=["daly.ble_handles:48"], **PASSES[passes])
    assert silent(rows[:8])
    assert kinds(rows[8:]) == ["foreign", "junk", "junk", "frame"]
    made.complete()
    made.discover(*DISCOVERED)
    talk(made, ELM327)
    assert silent(run(dissect, made, options=["daly.ble_handles:48"], **PASSES[passes])[12:])


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")])
def test_decode_as_begins_too(tshark: Tshark, open_folder: Path, passes: tuple[str, ...]) -> None:
    made = radio()
    made.notify(SPEAKS, "01")
    made.notify(SPEAKS + 1, "02")
    made.notify(SPEAKS, "03")
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(btsnoop(made))
    rows = ask(tshark, path, *passes, "-d", f"btatt.handle=={SPEAKS + 1},daly", names=["daly.kind"])
    assert [row[0] for row in rows] == ["", "", "", "", "junk", "junk"]
    rows = ask(tshark, path, *passes, "-d", f"btatt.handle=={SPEAKS},daly", names=["daly.kind"])
    assert [row[0] for row in rows] == ["", "", "", "junk", "", "junk"]


@pytest.mark.parametrize("passes", PASSES)
def test_what_is_lost_before_the_beginning_divides_nothing(dissect: Dissect, passes: str) -> None:
    made = radio()
    made.notify(SPEAKS, "00" * 6, pieces=(10,))
    del made.packets[-1]
    made.notify(SPEAKS, REPLY[:20], pieces=(9,))
    made.notify(SPEAKS, REPLY[20:])
    rows = run(dissect, made, **PASSES[passes])
    assert silent(rows[:5])
    assert kinds(rows)[-1] == "frame"
    assert number(rows[-1], "pack.voltage") == 53.3


@pytest.mark.parametrize("passes", PASSES)
def test_found_by_information_before_the_first_value(dissect: Dissect, passes: str) -> None:
    """The monitor's first pass knows of no attribute, and a second reads anew: the beginning is where it was."""
    made = Radio(link_type=MONITOR)
    made.complete()
    made.find_information(*DISCOVERED)
    talk(made, ELM327)  # 4 to 11
    made.write(WRITES, REQUEST)
    talk(made, ELM327[:2])
    rows = run(dissect, made, **PASSES[passes])
    assert silent(rows[:11])
    assert kinds(rows[11:]) == (["", "", ""] if passes == "one" else ["frame", "foreign", "junk"])


@pytest.mark.parametrize("passes", PASSES)
def test_without_modbus_only_a5_begins(dissect: Dissect, passes: str) -> None:
    made = radio()
    talk(made, [(ASK, PASSWORD_REQUEST), (TELL, PASSWORD), (TELL, PASSWORD[:10]), (ASK, REQUEST)])
    rows = run(dissect, made, options=["daly.modbus:FALSE"], **PASSES[passes])
    assert silent(rows[:6])
    assert kinds(rows[6:]) == ["frame"]


def test_any_order_shows_the_same(tshark: Tshark, open_folder: Path) -> None:
    """Two connections, one after the other on the same handle, that begin late."""
    made = Radio()
    for _ in range(2):
        made.complete()
        made.discover(*DISCOVERED)
        talk(made, ELM327)
        talk(made, [(TELL, REPLY[:20]), (TELL, REPLY[20:]), (ASK, REQUEST), (TELL, b"OK".hex())])
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(btsnoop(made))
    path.chmod(0o644)
    in_order = range(1, len(made.packets) + 1)
    packets = list(in_order)
    random.Random(7).shuffle(packets)
    server = Sharkd(tshark, path)
    try:
        seen = {packet: server.tree(packet) for packet in packets}
        for packet in in_order:
            assert server.tree(packet) == seen[packet], packet
    finally:
        server.close()
    assert ["Daly BMS" in str(seen[packet]) for packet in in_order] == ([False] * 11 + [True] * 4) * 2
    assert all("Pack voltage" in str(seen[packet]) for packet in (13, 28))
