# SPDX-License-Identifier: GPL-2.0-or-later
"""From bytes to records: docs/records.md 1 to 4, by small examples worked out by hand."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import FRAME_S, Dissect, P, a5, kinds, numbers
from tests.traffic import with_crc

ASK = a5(0x40, 0x90)
ANSWER = "a501900802100000753001f4ea"  # tano-90-1: 52.8 V, 0 A, 50 %
READ = "d203000c000157aa"  # doc-rd-req
FOREIGN = "010300000002c40b"  # read two registers of slave 1; CRC as any Modbus manual has it
SINO = "0a01020d03fd"  # sino-0: request and reply
PYLONTECH = b"~20024600800800000000FC22\r".hex()  # pylon, pace, jbd-req of more-real-frames.jsonl
PACE = b"~250F46900000FD90\r".hex()
JBD = "dda50300fffd77"

# A good A5 frame in whose data another one begins: W = A5 40 90 08 .. A5 01 90 08 .. | sum, V from the inner A5 on.
# What lies behind W makes V good: a cut-off request and the real reply behind it, whose sums are right by accident.
INNER = "a501900802100000753001f4ea"


def wrapped() -> tuple[str, str]:
    """Return W and what must follow it to make the inner frame good: W holds the first 6 bytes of INNER."""
    head = bytes.fromhex("a5409008 0000")
    inside = bytes.fromhex(INNER)[:6]
    # W's sum byte is INNER's seventh byte: the data before it is chosen so that it fits.
    wanted = bytes.fromhex(INNER)[6]
    first = (wanted - sum(head) - sum(inside)) & 0xFF
    w = bytes.fromhex("a5409008") + bytes((first, 0)) + inside + bytes((wanted,))
    assert sum(w[:12]) & 0xFF == w[12]
    return w.hex(), INNER[14:]


CASES = {
    # name: (packets, kinds of all records in order)
    "a frame": ([ASK], ["frame"]),
    "two frames in a packet": ([ASK + ANSWER], ["frame+frame"]),
    "a frame over two packets": ([ASK[:10], ASK[10:]], ["", "frame"]),
    "a frame over four packets": ([ASK[:2], ASK[2:8], ASK[8:24], ASK[24:]], ["", "", "", "frame"]),
    "end of one, whole, beginning of another": (
        [ASK[:8], ASK[8:] + ANSWER + ASK[:4], ASK[4:]],
        ["", "frame+frame", "frame"],
    ),
    "junk before": (["00ff" + ASK], ["junk+frame"]),
    "junk behind": ([ASK + "00ff"], ["frame+junk"]),
    "checksum wrong": (["a5409008000000000000000099"], ["bad_checksum"]),
    "length wrong": (["a5409009000000000000000000"], ["junk"]),
    "wrong checksum, then good": (["a5409008000000000000000099" + ASK], ["bad_checksum+frame"]),
    "cut off by a frame": (["a54090080000" + ANSWER], ["short+frame"]),
    "cut off, three bytes: no beginning": (["a54090" + ANSWER], ["junk+frame"]),
    "cut off by the end": (["a54090080000"], ["short"]),
    "Modbus read": ([READ], ["frame"]),
    "Modbus and A5 mixed": ([READ + ASK + "d203020001fc56"], ["frame+frame+frame"]),
    "Modbus write without byte count": (["d210000c0002000100027d65"], ["frame"]),
    "Modbus reply of a write": (["d210000c00029268"], ["frame"]),
    "Modbus, a zero more checks again": ([READ + "00"], ["frame+junk"]),
    "Modbus CRC wrong": (["d203000c000157ab"], ["junk"]),
    "Modbus cut off": (["d203000c" + ASK], ["short+frame"]),
    "Modbus reply, odd byte count: no beginning": (["510303"], ["junk"]),
    "80+N never replies": (["8183020000"], ["junk"]),
    "another maker's Modbus": ([FOREIGN], ["foreign"]),
    "another maker's Modbus, twice": ([FOREIGN + FOREIGN], ["foreign"]),
    "another maker's Modbus and something": ([FOREIGN + "77"], ["junk"]),
    "the Bluetooth module's own (field notes e)": (["81100f05000200000000876a"], ["foreign"]),
    "the module's own between frames": ([ASK + "81100f05000200000000876a" + ANSWER], ["frame+foreign+frame"]),
    "a write of another register is a board's": (["811001400002743073f02ca9"], ["frame"]),
    "Sinowealth": ([SINO], ["foreign"]),
    "Sinowealth request": (["0a0102"], ["foreign"]),
    "Sinowealth with a wrong CRC-8": (["0a01020d03fe"], ["junk"]),
    "Pylontech": ([PYLONTECH], ["foreign"]),
    "Pylontech, twice": ([PYLONTECH + PACE], ["foreign"]),
    "Pylontech between frames": ([ASK + PYLONTECH + ANSWER], ["frame+foreign+frame"]),
    "Pylontech in two packets": ([PACE[:20], PACE[20:]], ["", "foreign"]),
    "Pylontech with a wrong sum": ([PACE[:-4] + "310d"], ["junk"]),
    "Pylontech without its end": ([PACE[:-2]], ["junk"]),
    "Pylontech, other end": ([PACE[:-2] + "0a"], ["junk"]),
    "Pylontech, longer than it says": ([PACE[:-10] + "30" + PACE[-10:]], ["junk"]),
    "JBD": ([JBD], ["foreign"]),
    "JBD, asked and answered": ([JBD + "dd0300024849ff6d77"], ["foreign"]),
    "JBD between frames": ([ASK + JBD + ANSWER], ["frame+foreign+frame"]),
    "JBD with a wrong sum": (["dda50300fffc77"], ["junk"]),
    "JBD without its end": ([JBD[:-2]], ["junk"]),
    "JBD, other end": ([JBD[:-2] + "78"], ["junk"]),
    "JBD, a frame of Daly inside": (["dd03000d" + ASK + "fdf977"], ["junk+frame+junk"]),
    "two makers in one gap": ([JBD + PACE], ["junk"]),
    "another maker's Modbus between frames": ([ASK + FOREIGN + ANSWER], ["frame+foreign+frame"]),
    "a frame whose sum is A5, alone": ([a5(0x40, 0x90, "28")], ["frame"]),
    "a frame whose sum is A5, and another": ([a5(0x40, 0x90, "28"), ANSWER], ["frame", "frame"]),
    "a frame in a frame, nothing behind": ([wrapped()[0]], ["frame"]),
    "a frame in a frame, the inner one good": (["".join(wrapped())], ["short+frame"]),
    "a frame in a frame, the inner one good, cut": ([*wrapped()], ["short", "frame"]),
    "an event": ([""], ["event"]),
    "an event within a frame": ([ASK[:6], "", ASK[6:]], ["", "event", "frame"]),
    "an event within junk": (["7777", "", "7777"], ["junk", "event", "junk"]),
}


@pytest.fixture(scope="module")
def seen(dissect: Dissect) -> dict[str, list[str]]:
    """Kinds of every case, all cases in one run of tshark, each on an interface of its own."""
    packets: list[P] = []
    for interface, (pieces, _) in enumerate(CASES.values()):
        at = interface * 10.0
        for piece in pieces:
            packets.append(P(piece, at, interface))
            at += len(piece) / 2 * 10 / 9600
    rows = dissect(packets, descriptions=["dalyshark"] * len(CASES))
    found: dict[str, list[str]] = {}
    for name, (pieces, _) in CASES.items():
        found[name] = kinds(rows[: len(pieces)])
        del rows[: len(pieces)]
    return found


def test_the_inner_frame_example_is_one() -> None:
    w, rest = wrapped()
    assert (w + rest)[12:] == INNER
    assert len(bytes.fromhex(w)) == 13


@pytest.mark.parametrize("name", CASES)
def test_kinds(seen: dict[str, list[str]], name: str) -> None:
    assert seen[name] == CASES[name][1]


def test_a_frame_in_a_frame_is_taken_when_a_frame_follows(dissect: Dissect) -> None:
    """W holds the beginning of V, and both are good; but a good frame F begins where W ends, so W stands.

    W  A5 40 90 08 00 00 A5 01 90 08 00 00 sum
    V                    A5 01 90 08 00 00 sum A5 01 91 08 00 d1    d1 is V's sum
    F                                          A5 01 91 08 00 d1 ..
    """
    head = bytes.fromhex("a54090080000a50190080000")
    w = head + bytes((sum(head) & 0xFF,))
    v = w[6:] + bytes.fromhex("a501910800")
    f = bytes.fromhex(a5(0x01, 0x91, f"00{sum(v) & 0xFF:02x}0108"))
    assert sum((w + f)[6:18]) & 0xFF == (w + f)[18]
    rows = dissect([P((w + f).hex()), P((w + f[:6]).hex(), 10)])
    assert kinds(rows) == ["frame+frame", "short+frame"]
    assert numbers(rows[0], "data_id") == [0x90, 0x91]
    assert numbers(rows[1], "address") == [0x01]


def test_of_two_windows_that_end_together_the_one_that_begins_first(dissect: Dissect) -> None:
    """A read reply whose end is an exception, byte for byte: the two bytes before it bring the CRC back to its start.

    51 03 08 | a b 00 00 00 | 51 83 02 | crc of both
    """
    tail = with_crc(bytes.fromhex("518302"))
    for guess in range(1 << 16):
        head = bytes.fromhex("510308000000") + guess.to_bytes(2, "big")
        if with_crc(head)[-2:] == b"\xff\xff":
            break
    else:
        pytest.fail("no such pair of bytes")
    both = head + tail
    assert with_crc(both[:-2]) == both
    rows = dissect([P(both.hex()), P(tail.hex(), 10)])
    assert kinds(rows) == ["frame", "frame"]
    assert numbers(rows[0], "modbus.function") == [0x03]
    assert numbers(rows[1], "modbus.function") == [0x83]


@pytest.mark.parametrize(("quiet", "expected"), [(0.24, ["", "frame"]), (0.26, ["short", "junk"])])
def test_silence_gives_an_incomplete_frame_up(dissect: Dissect, quiet: float, expected: list[str]) -> None:
    """250 ms, counted from the end of the bytes before (4 bytes last 4.2 ms)."""
    rows = dissect([P(ASK[:8]), P(ASK[8:], at=4 * 10 / 9600 + quiet)])
    assert kinds(rows) == expected


def test_silence_counts_from_the_last_bytes_end(dissect: Dissect) -> None:
    """A reply of 125 registers takes 266 ms by itself: no silence between its first byte and the frame behind it."""
    long_reply = "d203fa" + "00" * 249
    rows = dissect([P(long_reply), P("00" + "1234" + ASK, at=252 * 10 / 9600 + 0.24)])
    assert kinds(rows) == ["junk", "junk+frame"]
    first = dissect([P(long_reply[:20]), P(long_reply[20:], at=10 * 10 / 9600 + 0.24)])
    assert kinds(first) == ["short", "short"]


def test_interfaces_and_directions_are_streams_of_their_own(dissect: Dissect) -> None:
    rows = dissect(
        [
            P(ASK[:8], 0.000, 0),
            P(ANSWER[:10], 0.001, 1),
            P("a5409108", 0.002, 0, 1),
            P(ASK[8:], 0.005, 0),
            P(ANSWER[10:], 0.006, 1),
            P("00000000000000007e", 0.007, 0, 1),
        ],
        descriptions=["dalyshark", "dalyshark"],
    )
    assert kinds(rows) == ["", "", "", "frame", "frame", "frame"]
    assert numbers(rows[3], "data_id") == [0x90]
    assert numbers(rows[4], "soc") == [50.0]
    assert numbers(rows[5], "data_id") == [0x91]


def test_parts_name_the_packet_in_which_the_record_ends(dissect: Dissect) -> None:
    rows = dissect([P(ASK[:10]), P(ASK[10:14], 0.01), P(ASK[14:] + ASK, 0.02)])
    assert [row.get("daly.continued_in") for row in rows] == [["3"], ["3"], None]
    assert rows[2]["daly.began_in"] == ["1"]
    assert numbers(rows[2], "data_id") == [0x90, 0x90]


def test_every_byte_of_a_long_stretch_of_junk_is_shown(dissect: Dissect) -> None:
    junk = "77" * 5000
    rows = dissect([P(junk + ASK)])
    undecoded = rows[0]["daly.undecoded"]
    assert "".join(undecoded) == junk
    assert max(map(len, undecoded)) == 2 * 4096
    assert kinds(rows) == ["junk+junk+frame"]


def test_a_stream_of_junk_packets_is_shown_packet_by_packet(dissect: Dissect) -> None:
    packets = [P("00" * 13, index * FRAME_S) for index in range(700)]
    rows = dissect(packets)
    assert kinds(rows) == ["junk"] * 700
    assert all(row["daly.undecoded"] == ["00" * 13] for row in rows)
