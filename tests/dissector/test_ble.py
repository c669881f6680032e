# SPDX-License-Identifier: GPL-2.0-or-later
"""Bluetooth (docs/wires.md 3): values of a board's attributes in HCI captures."""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, expert, kinds, number, numbers
from tests.dissector.hci_frames import (
    H4,
    H4_DIRECTION,
    INDICATE,
    MONITOR,
    RECEIVED,
    SENT,
    WRITE_REQUEST,
    Radio,
    btsnoop,
)
from tests.dissector.test_doors import ask
from tests.dissector.test_views import Sharkd
from tests.traffic import with_crc

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

WRITES, SPEAKS = 0x000F, 0x0011  # handles of fff2 and fff1, as on old dongles
DISCOVERED = ((WRITES, 0xFFF2), (SPEAKS, 0xFFF1))

# pack voltage 53.3 V (0x0215), current 0, SOC 56 % (0x0230)
REQUEST, REPLY = a5(0x80, 0x90), a5(1, 0x90, "0215000075300230")
PASSWORD_REQUEST = with_crc(bytes.fromhex("d20300c90003")).hex()
PASSWORD = "d203063132333435364c69"  # real: sys-password

REAL = Path(__file__).resolve().parents[2] / "pcap_samples" / "real-frames.jsonl"


def radio(**with_: Any) -> Radio:
    """Connect, and discover both attributes: three packets."""
    made = Radio(**with_)
    made.complete()
    made.discover(*DISCOVERED)
    return made


def run(dissect: Dissect, made: Radio, **how: Any) -> list[Row]:
    how.setdefault("descriptions", ["bluetooth0"])
    return dissect(made.packets, link_type=made.link_type, **how)


PASSES: dict[str, dict[str, bool]] = {
    "one": {"two_pass": False},
    "two": {"tree": False},
    "two with a tree": {"tree": True},
}


@pytest.mark.parametrize(
    ("link_type", "passes"),
    [(H4, "one"), (H4, "two"), *((H4_DIRECTION, passes) for passes in PASSES), (MONITOR, "one"), (MONITOR, "two")],
)
def test_request_and_reply(dissect: Dissect, link_type: int, passes: str) -> None:
    made = radio(link_type=link_type)
    made.write(WRITES, REQUEST)
    made.at += 0.04
    made.notify(SPEAKS, REPLY)
    rows = run(dissect, made, **PASSES[passes])
    assert kinds(rows) == ["", "", "", "frame", "frame"]
    asked, answered = rows[3:]
    assert asked["daly.transport"] == answered["daly.transport"] == ["ble"]
    assert asked["daly.dialect"] == answered["daly.dialect"] == ["a5"]
    assert (number(asked, "direction"), number(answered, "direction")) == (1, 2)
    assert (number(answered, "pack.voltage"), number(answered, "soc")) == (53.3, 56.0)
    assert number(answered, "request_in") == 4
    assert number(answered, "response_time") == pytest.approx(0.05, abs=1e-6)
    if passes != "one":
        assert number(asked, "reply_in") == 5


def test_an_android_log(tshark: Tshark, open_folder: Path) -> None:
    made = radio()
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY)
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(btsnoop(made))
    for passes in (), ("-2",):
        rows = ask(tshark, path, *passes, names=["daly.transport", "daly.pack.voltage", "daly.request_in"])
        assert rows == [["", "", ""]] * 3 + [["ble", "", ""], ["ble", "53.3", "4"]]
        listed = tshark.run(*passes, "-r", str(path)).stdout.decode().splitlines()
        assert "Daly" in listed[4]
        assert "Reply board 1  0x90 Pack: 53.3 V" in listed[4]


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize("way", ["type", "information"])
@pytest.mark.parametrize("link_type", [H4, H4_DIRECTION, MONITOR])
def test_attributes_by_discovery(dissect: Dissect, link_type: int, way: str, passes: str) -> None:
    short = ((0x21, 0xFFF1), (0x23, 0xFFF2), (0x29, 0xFFF3))
    long = ((0x25, 0xFF01), (0x27, 0xFF02), (0x2B, 0x2A19))  # of 16 bytes
    found = (*short[:2], *long[:2], short[2], long[2])
    made = Radio(link_type=link_type)
    made.complete()
    if way == "type":
        made.discover(*short)
        made.discover(*long, wide=True)
    else:
        made.find_information(*short)
        made.find_information(*long, wide=True)
    quiet = len(made.packets)
    for handle, _ in found:
        made.notify(handle, REPLY)
        made.write(handle, REQUEST, opcode=WRITE_REQUEST)
    seen = kinds(run(dissect, made, **PASSES[passes]))
    assert seen[:quiet] == [""] * quiet
    # What the monitor found before the first value of any attribute came by is known in a second pass.
    missed = way == "information" and passes == "one" and link_type == MONITOR
    assert seen[quiet:] == ([""] * 12 if missed else ["frame"] * 8 + [""] * 4)


HIGHEST = [(0x00FF, 0x0100), (0x0211, 0x020F), (0xFFFF, 0xFFFD)]  # handles of fff1 and fff2


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize("link_type", [H4, H4_DIRECTION, MONITOR])
@pytest.mark.parametrize(("speaks", "writes"), HIGHEST)
def test_any_handle(dissect: Dissect, speaks: int, writes: int, link_type: int, passes: str) -> None:
    made = Radio(link_type=link_type)
    made.complete()
    made.discover((writes, 0xFFF2), (speaks, 0xFFF1))
    made.write(writes, REQUEST)
    made.notify(speaks, REPLY)
    rows = run(dissect, made, **PASSES[passes])
    assert kinds(rows) == ["", "", "", "frame", "frame"]
    assert (number(rows[4], "pack.voltage"), number(rows[4], "request_in")) == (53.3, 4)


def test_indications_count_as_notifications(dissect: Dissect) -> None:
    made = radio()
    made.notify(SPEAKS, REPLY, opcode=INDICATE)
    assert number(run(dissect, made)[3], "pack.voltage") == 53.3


def test_without_discovery_nothing_is_ours(dissect: Dissect) -> None:
    made = Radio()
    made.complete()
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY)
    assert kinds(run(dissect, made)) == [""] * 3


@pytest.mark.parametrize(
    ("handles", "passes"), [*(("17,15,48", passes) for passes in PASSES), ("12-20", "one"), ("837,12-20", "two")]
)
def test_attributes_by_preference(dissect: Dissect, handles: str, passes: str) -> None:
    made = Radio()
    made.notify(0x0345, REPLY)
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY)
    made.notify(0x100, REPLY)
    rows = run(dissect, made, options=[f"daly.ble_handles:{handles}"], **PASSES[passes])
    assert kinds(rows) == ["frame" if "837" in handles else "", "frame", "frame", ""]
    assert number(rows[2], "request_in") == 2


@pytest.mark.parametrize(
    ("handle", "passes"), [(SPEAKS, ()), (SPEAKS, ("-2",)), (0x0345, ()), (0x0345, ("-2", "-Y", "frame"))]
)
def test_attributes_by_decode_as(tshark: Tshark, open_folder: Path, handle: int, passes: tuple[str, ...]) -> None:
    made = Radio()
    made.complete()
    made.notify(handle, REPLY[:10])
    made.notify(handle, REPLY[10:])
    made.notify(handle + 1, REPLY)
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(btsnoop(made))
    words = [*passes, "-d", f"btatt.handle=={handle},daly"]
    rows = ask(tshark, path, *words, names=["daly.pack.voltage", "btatt.value"])
    assert [row[0] for row in rows] == ["", "", "53.3", ""]
    assert rows[2][1] == REPLY[10:]  # Wireshark's own view stays


def test_a_reply_in_values_cut_anywhere(dissect: Dissect) -> None:
    """A real D2 reply in values of 20 bytes; several frames in one value; half a frame behind them."""
    made = radio()
    made.write(WRITES, PASSWORD_REQUEST)
    both = PASSWORD + REPLY + a5(1, 0x93, "01010005")
    for start in range(0, len(both), 40):
        made.notify(SPEAKS, both[start : start + 40])
    rows = run(dissect, made)
    assert kinds(rows) == ["", "", "", "frame", "frame", "frame+frame"]
    assert rows[4]["daly.password"] == ["123456"]
    assert number(rows[4], "continued_in") == 6
    assert (number(rows[5], "pack.voltage"), number(rows[5], "life")) == (53.3, 5)
    assert number(rows[4], "request_in") == 4
    assert rows[4]["daly.dialect"] == ["d2"]


def test_byte_by_byte_with_any_quiet_between(dissect: Dissect) -> None:
    """Silence divides nothing."""
    made = radio(step=0.6)
    made.write(WRITES, REQUEST)  # 4: Daly begins
    for at in range(0, len(REPLY), 2):
        made.notify(SPEAKS, REPLY[at : at + 2])
    rows = run(dissect, made)
    assert number(rows[-1], "pack.voltage") == 53.3
    assert kinds(rows) == ["", "", "", "frame", *[""] * 12, "frame"]
    assert numbers(rows[4], "continued_in") == [17]


@pytest.mark.parametrize("passes", PASSES)
def test_a_value_in_several_acl_packets(dissect: Dissect, passes: str) -> None:
    made = radio()
    for pieces in (6,), (2, 3), (12, 1, 1):
        made.notify(SPEAKS, REPLY, pieces=pieces)
    rows = run(dissect, made, **PASSES[passes])
    assert kinds(rows) == ["", "", "", "", "frame", "", "", "frame", "", "", "", "frame"]
    assert [numbers(row, "pack.voltage") for row in rows if "daly.kind" in row] == [[53.3]] * 3


def test_a_lost_piece_divides(dissect: Dissect) -> None:
    """The end of a value is missing: what stands before and after it is no frame by accident."""
    made = radio()
    made.notify(SPEAKS, REPLY[:10])
    made.notify(SPEAKS, "00" * 6, pieces=(10,))
    del made.packets[-1]
    made.notify(SPEAKS, REPLY[10:])
    assert kinds(run(dissect, made)) == ["", "", "", "short", "", "junk"]


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize("link_type", [H4, H4_DIRECTION])
def test_a_lost_piece_divides_its_own_side_alone(dissect: Dissect, link_type: int, passes: str) -> None:
    """Also where the capture tells no directions (H4): the operation does."""
    made = radio(link_type=link_type)
    made.write(WRITES, REQUEST)  # 4
    made.notify(SPEAKS, REPLY[:10])  # 5
    made.att(SENT, bytes((0x52, WRITES, 0)) + bytes.fromhex(REQUEST), pieces=(10,))  # 6 and a lost one
    del made.packets[-1]
    made.notify(SPEAKS, REPLY[10:])  # 7
    made.write(WRITES, REQUEST[:12])  # 8
    made.notify(SPEAKS, REPLY, pieces=(10,))  # 9 and a lost one
    del made.packets[-1]
    made.write(WRITES, REQUEST[12:])  # 10
    rows = run(dissect, made, **PASSES[passes])
    held = "short" if passes == "one" else ""  # for now
    assert kinds(rows) == ["", "", "", "frame", held, "", "frame", held, "", "frame"]
    assert number(rows[6], "pack.voltage") == 53.3


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize("link_type", [H4, H4_DIRECTION])
@pytest.mark.parametrize("from_board", [True, False])
def test_a_lost_piece_divides_its_own_side(dissect: Dissect, from_board: bool, link_type: int, passes: str) -> None:
    made = radio(link_type=link_type)
    made.write(WRITES, REQUEST)  # 4
    handle, opcode, side, text = (SPEAKS, 0x1B, RECEIVED, REPLY) if from_board else (WRITES, 0x52, SENT, REQUEST)
    for part, pieces in (text[:12], ()), ("00" * 6, (10,)):  # 5; 6 and a lost one
        made.att(side, bytes((opcode,)) + handle.to_bytes(2, "little") + bytes.fromhex(part), pieces=pieces)
    del made.packets[-1]
    if from_board:  # 7: the other side ends the wait in H4
        made.write(WRITES, REQUEST)
    else:
        made.notify(SPEAKS, REPLY)
    made.att(side, bytes((opcode,)) + handle.to_bytes(2, "little") + bytes.fromhex(text[12:]))  # 8
    seen = kinds(run(dissect, made, **PASSES[passes]))
    assert seen[:5] == ["", "", "", "frame", "short"]
    assert seen[5:7] == ["", "frame"]
    assert seen[7] != "frame"


def test_both_directions_are_sides(dissect: Dissect) -> None:
    """The same bytes from the board are its echo, whenever; from the host again a retry. D2's write of one likewise."""
    write = with_crc(bytes.fromhex("d206000700ab")).hex()
    made = radio(step=0.3)
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REQUEST)
    made.at += 2
    made.write(WRITES, write)
    made.write(WRITES, write)
    made.notify(SPEAKS, write)
    rows = run(dissect, made)
    assert [number(row, "direction") for row in rows[3:]] == [1, 3, 1, 1, 2]
    assert number(rows[7], "request_in") == 7


TEXTS = ["AT+VER=?\r\n", "+OK\r\n", "OK\r\n", "ERROR", "HiLink", "AT"]


def test_the_modules_own_text(dissect: Dissect) -> None:
    made = radio()
    made.write(WRITES, REQUEST)  # 4: Daly begins
    for text in TEXTS:
        made.write(WRITES, text.encode().hex())
        made.notify(SPEAKS, REPLY)
        made.notify(SPEAKS, text.encode().hex())
    rows = run(dissect, made)
    assert kinds(rows) == ["", "", "", "frame", *["foreign", "frame", "foreign"] * len(TEXTS)]
    for at, text in enumerate(TEXTS):
        for row in rows[3 * at + 4], rows[3 * at + 6]:
            assert row["daly.foreign"] == ["Bluetooth module"]
            assert row["daly.undecoded"] == [text.encode().hex()]


def test_other_text_is_junk(dissect: Dissect) -> None:
    made = radio()
    made.write(WRITES, REQUEST)  # 4: Daly begins
    others = ["A", "hello", "at+ver", " OK", "AT\x01", "AT\x80"]
    for text in others:
        made.notify(SPEAKS, text.encode("latin-1").hex())
    assert kinds(run(dissect, made)) == ["", "", "", "frame", *["junk"] * len(others)]


def test_text_inside_a_frame_is_its_data(dissect: Dissect) -> None:
    """The value OKOKOK in the middle of a frame is no word of the module's."""
    text = b"OKOKOK".hex()
    frame = a5(1, 0x57, "01" + text + "20")
    made = radio()
    made.notify(SPEAKS, frame[:10])
    made.notify(SPEAKS, text)
    made.notify(SPEAKS, frame[22:])
    rows = run(dissect, made)
    assert kinds(rows) == [""] * 5 + ["frame"]
    assert rows[5]["daly.text_part"] == ["OKOKOK "]


def test_text_divides_junk(dissect: Dissect) -> None:
    made = radio()
    made.write(WRITES, REQUEST)  # 4: Daly begins
    made.notify(SPEAKS, "00")
    made.notify(SPEAKS, b"OK".hex())
    made.notify(SPEAKS, "01" + REPLY)
    assert kinds(run(dissect, made)) == ["", "", "", "frame", "junk", "foreign", "junk+frame"]


def test_the_modules_modbus(dissect: Dissect) -> None:
    """Function 10 with register 0F05 is the module's on either side, and no exchange (field notes e)."""
    made = radio()
    made.write(WRITES, REQUEST)  # 4: Daly begins
    made.write(WRITES, with_crc(bytes.fromhex("81100f05000200000000")).hex())
    made.notify(SPEAKS, with_crc(bytes.fromhex("51100f05aaaa")).hex())
    for row in run(dissect, made)[4:]:
        assert row["daly.foreign"] == ["Bluetooth module"]
        assert "daly.write" not in row
        assert "daly.unasked" not in row


@pytest.mark.parametrize(
    ("event", "passes"), list(zip(["complete", "enhanced_complete", "classic_complete"], PASSES, strict=True))
)
def test_a_new_connection_knows_nothing(dissect: Dissect, event: str, passes: str) -> None:
    """Attributes, half a frame, requests: all forgotten with Connection Complete."""
    made = radio()
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY[:10])
    getattr(made, event)()
    made.notify(SPEAKS, REPLY)  # not discovered
    made.discover(*DISCOVERED)
    made.notify(SPEAKS, REPLY[10:] + REPLY)
    rows = run(dissect, made, **PASSES[passes])
    assert kinds(rows) == ["", "", "", "frame", "short", "", "", "", "", "junk+frame"]
    assert "daly.request_in" not in rows[9]
    assert "daly.unasked" not in rows[9]


def test_a_connection_that_failed_is_none(dissect: Dissect) -> None:
    made = radio()
    made.complete(status=0x3E)
    made.notify(SPEAKS, REPLY)
    assert kinds(run(dissect, made)) == ["", "", "", "", "frame"]


@pytest.mark.parametrize("passes", PASSES)
def test_two_connections_are_two_buses(dissect: Dissect, passes: str) -> None:
    made = radio()
    made.connection = 0x41
    made.complete()
    made.notify(SPEAKS, REPLY)  # 5: not discovered here
    made.discover(*DISCOVERED)
    made.write(WRITES, REQUEST)  # 8
    made.notify(SPEAKS, REPLY[:10])
    made.connection = 0x40
    made.notify(SPEAKS, REPLY)  # 10: nobody asked here
    made.connection = 0x41
    made.notify(SPEAKS, REPLY[10:])  # 11
    rows = run(dissect, made, **PASSES[passes])
    held = [9] if passes == "one" else []  # half a frame, shown provisionally
    assert [at for at, kind in enumerate(kinds(rows), 1) if kind] == sorted([8, 10, 11, *held])
    assert "daly.request_in" not in rows[9]
    assert number(rows[10], "request_in") == 8


@pytest.mark.parametrize("passes", PASSES)
def test_two_adapters_have_handles_of_their_own(dissect: Dissect, passes: str) -> None:
    """The same connection handle on hci0 and hci1."""
    made = radio(link_type=MONITOR)
    made.adapter = 1
    made.complete()
    made.notify(SPEAKS, REPLY)
    made.adapter = 0
    made.notify(SPEAKS, REPLY)
    assert kinds(run(dissect, made, **PASSES[passes])) == ["", "", "", "", "", "frame"]


@pytest.mark.parametrize("passes", PASSES)
def test_two_interfaces_have_handles_of_their_own(dissect: Dissect, passes: str) -> None:
    made = radio()
    made.interface = 1
    made.notify(SPEAKS, REPLY)
    made.interface = 0
    made.notify(SPEAKS, REPLY)
    rows = run(dissect, made, descriptions=["one", "two"], **PASSES[passes])
    assert kinds(rows) == ["", "", "", "", "frame"]


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize(
    ("link_type", "adapters"), [(H4, False), (H4_DIRECTION, False), (MONITOR, False), (MONITOR, True)]
)
def test_two_lines_at_once(dissect: Dissect, link_type: int, adapters: bool, passes: str) -> None:
    """Step by step on both: with a tree in the first pass, the second tells all (replies, ends of what is held)."""
    both = [radio(link_type=link_type, **{"adapter" if adapters else "interface": line}) for line in (0, 1)]
    for one in both:  # 4 to 6 of each
        one.write(WRITES, REQUEST)
        one.notify(SPEAKS, REPLY[:12])
        one.notify(SPEAKS, REPLY[12:])
    packets = [
        P(packet.hex, 2 * packet.at + one.step * line, packet.interface)
        for step in zip(*(one.packets for one in both), strict=True)
        for line, (one, packet) in enumerate(zip(both, step, strict=True))
    ]
    rows = dissect(packets, link_type=link_type, descriptions=["a", "b"], **PASSES[passes])
    final = passes == "two with a tree"
    held = "" if final else "short"
    assert kinds(rows) == [""] * 6 + ["frame"] * 2 + [held] * 2 + ["frame"] * 2
    assert [number(row, "request_in") for row in rows[10:]] == [7, 8]
    assert [number(row, "pack.voltage") for row in rows[10:]] == [53.3, 53.3]
    if final:
        assert [number(row, "reply_in") for row in rows[6:8]] == [11, 12]
        assert [number(row, "continued_in") for row in rows[8:10]] == [11, 12]


@pytest.mark.parametrize("passes", PASSES)
@pytest.mark.parametrize("link_type", [H4, H4_DIRECTION, MONITOR])
def test_discovery_in_several_acl_packets(dissect: Dissect, link_type: int, passes: str) -> None:
    made = Radio(link_type=link_type)
    made.complete()
    made.att(SENT, bytes.fromhex("080100ffff0328"))
    made.att(RECEIVED, bytes.fromhex("0907 0e00 10 0f00 f2ff 1000 10 1100 f1ff"), pieces=(9,))  # 3, 4
    made.write(WRITES, REQUEST)  # 5
    made.notify(SPEAKS, REPLY)
    rows = run(dissect, made, **PASSES[passes])
    if link_type == MONITOR and passes == "one":  # there the first packet that we are shown is the end of the reply
        assert kinds(rows) == [""] * 6
        return
    assert kinds(rows) == ["", "", "", "", "frame", "frame"]
    assert number(rows[5], "request_in") == 5
    if passes == "two with a tree" and link_type != MONITOR:
        assert number(rows[4], "reply_in") == 6


def test_discovery_is_of_characteristics_and_by_the_host(dissect: Dissect) -> None:
    made = Radio()
    made.complete()
    made.discover(*DISCOVERED, asked=0x2800)
    made.notify(SPEAKS, REPLY)
    made.discover(*DISCOVERED, side=RECEIVED)  # what the other side finds on the host
    made.notify(SPEAKS, REPLY)
    made.discover((SPEAKS, 0xFFF1))
    made.notify(SPEAKS, REPLY)
    made.discover((SPEAKS, 0x2A19))  # and now it is something else
    made.notify(SPEAKS, REPLY)
    seen = kinds(run(dissect, made))
    assert [at for at, kind in enumerate(seen, 1) if kind] == [10]


def test_the_other_way_round_is_not_a_board(dissect: Dissect) -> None:
    """A host that plays a board itself: writes come in, notifications go out."""
    made = radio()
    made.write(WRITES, REQUEST, direction=RECEIVED)
    made.att(SENT, bytes((0x1B, SPEAKS, 0)) + bytes.fromhex(REPLY))
    assert kinds(run(dissect, made)) == [""] * 5


def test_other_operations_carry_nothing(dissect: Dissect) -> None:
    made = radio()
    for opcode in 0x0B, 0x0D, 0x16, 0x18, 0xD2:
        made.notify(SPEAKS, REPLY, opcode=opcode)
        made.write(WRITES, REQUEST, opcode=opcode)
    assert kinds(run(dissect, made)) == [""] * 13


def test_empty_values_are_nothing(dissect: Dissect) -> None:
    made = radio()
    made.notify(SPEAKS, "")
    made.notify(SPEAKS, REPLY)
    assert kinds(run(dissect, made)) == ["", "", "", "", "frame"]


def test_beside_a_serial_line(tshark: Tshark, open_folder: Path) -> None:
    """Both in one file: each packet is shown once, by its own door."""
    made = radio()
    made.write(WRITES, REQUEST)
    path = open_folder / "both.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("radio", "bluetooth0", H4_DIRECTION))
        writer.add_interface(Interface("line", "dalyshark bus=main"))
        for at, (which, text) in enumerate([(0, packet.hex) for packet in made.packets] + [(1, REQUEST), (1, REPLY)]):
            writer.write_packet(1_700_000_000_000_000_000 + at * 10_000_000, bytes.fromhex(text), interface=which)
    for passes in (), ("-2",):
        rows = ask(tshark, path, *passes, names=["daly.transport", "daly.request_in"])
        assert rows == [["", ""]] * 3 + [["ble", ""], ["uart", ""], ["uart", "5"]]


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")])
def test_link_types_in_one_file(tshark: Tshark, open_folder: Path, passes: tuple[str, ...]) -> None:
    """Whichever we came in by, each packet is Wireshark's first of all, and the door is shut behind us."""
    path = open_folder / "both.pcapng"
    kinds_of = (MONITOR, H4_DIRECTION, H4)
    with open_writer(path) as writer:
        for link_type in kinds_of:
            writer.add_interface(Interface(f"radio{link_type}", "bluetooth", link_type))
        at = 0
        for which, link_type in enumerate(kinds_of):
            made = radio(link_type=link_type)
            made.write(WRITES, REQUEST)
            for packet in made.packets:
                at += 10_000_000
                writer.write_packet(1_700_000_000_000_000_000 + at, bytes.fromhex(packet.hex), interface=which)
    rows = ask(tshark, path, *passes, names=["bthci_evt.code", "btatt.opcode", "daly.kind"])
    assert [bool(row[0]) for row in rows] == [True, False, False, False] * 3
    assert [bool(row[1]) for row in rows] == [False, True, True, True] * 3
    assert [row[2] for row in rows] == ["", "", "", "frame"] * 3


def ble_records() -> dict[str, dict[str, Any]]:
    rows = [json.loads(line) for line in REAL.read_text().splitlines()]
    return {row["id"]: row for row in rows if row["transport"] == "ble"}


def test_real_bytes_mean_the_same_as_on_a_line(dissect: Dissect) -> None:
    """Each in values of 20 bytes, on a connection of its own; the values are those that test_real_frames.py holds."""
    records = ble_records()
    assert len(records) == 33
    made = Radio()
    ends: dict[str, int] = {}
    for at, (key, row) in enumerate(records.items()):
        made.connection = 0x40 + at
        made.discover(*DISCOVERED)
        for start in range(0, len(row["hex"]), 40):
            value = row["hex"][start : start + 40]
            made.write(WRITES, value) if row.get("dir") == "req" else made.notify(SPEAKS, value)
        ends[key] = len(made.packets)
    on_air = run(dissect, made)
    alone = dissect(
        [P(row["hex"], interface=at) for at, row in enumerate(records.values())], descriptions=["dalyshark"] * 33
    )
    for (key, end), line in zip(ends.items(), alone, strict=True):
        ours = {name: value for name, value in on_air[end - 1].items() if name.startswith("daly.")}
        theirs = {name: value for name, value in line.items() if name.startswith("daly.")}
        assert ours.pop("daly.transport") == ["ble"]
        assert theirs.pop("daly.transport") == ["uart"]
        for name in "daly.began_in", "daly.unanswered":
            ours.pop(name, None)
        assert ours == theirs, key
    assert numbers(on_air[ends["sys-settings"] - 1], "setting.rated_capacity") == [105_000]


def test_any_order_shows_the_same(tshark: Tshark, open_folder: Path) -> None:
    made = radio()
    for _ in range(3):
        made.write(WRITES, REQUEST)
        for at in range(0, len(REPLY * 3), 22):
            made.notify(SPEAKS, (REPLY * 3)[at : at + 22])
        made.notify(SPEAKS, "41542b0d0a")
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(btsnoop(made))
    path.chmod(0o644)
    packets = list(range(1, len(made.packets) + 1))
    server = Sharkd(tshark, path)
    try:
        in_order = {packet: server.tree(packet) for packet in packets}
        assert str(in_order).count("Pack voltage") >= 9
        random.Random(7).shuffle(packets)
        for packet in packets:
            assert server.tree(packet) == in_order[packet], packet
    finally:
        server.close()


@pytest.mark.parametrize("length", [9, 13, 20])
def test_snapped_packets_do_not_trip_it(tshark: Tshark, open_folder: Path, length: int) -> None:
    made = radio()
    made.write(WRITES, REQUEST)
    made.notify(SPEAKS, REPLY)
    data = bytearray(btsnoop(made))
    at = 16
    short = bytearray(data[:at])
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        kept = min(size, length) if at > 100 else size
        short += data[at : at + 4] + kept.to_bytes(4, "big") + data[at + 8 : at + 24 + kept]
        at += 24 + size
    path = open_folder / "btsnoop_hci.log"
    path.write_bytes(short)
    path.chmod(0o644)
    done = tshark.run("-2", "-r", str(path), "-V")
    assert b"Lua" not in done.stderr + done.stdout
    assert b"53.3" not in done.stdout


def test_notes_are_made_here_too(dissect: Dissect) -> None:
    made = radio()
    made.write(WRITES, a5(0x80, 0xDA, "00"))
    made.notify(SPEAKS, a5(1, 0xDA, "01"))
    rows = run(dissect, made)
    assert "WRITE" in expert(rows[3])
    assert rows[4]["daly.write_result"] == ["denied"]
