# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN, classic dialect and everybody's: docs/wires.md 2. Expected values are by hand or those of the sources."""

from __future__ import annotations

import re
import struct
import sys
from typing import TYPE_CHECKING, Any, cast

import pytest
from tests.dissector.can_frames import SOCKETCAN, can, canfd, keep_alive, reply, request
from tests.dissector.dissection import (
    DESTINATION,
    EPOCH_NS,
    SOURCE,
    Dissect,
    P,
    Row,
    expert,
    info,
    kinds,
    number,
    numbers,
)
from tests.dissector.test_real_frames import NAMES, OF_REQUESTS, ROWS, WORDS
from tests.dissector.test_views import Sharkd

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalytools.tshark import Tshark

REAL = {row["id"]: row for row in ROWS if row["transport"] == "can"}
DALY = {key: row for key, row in REAL.items() if row.get("kind") != "foreign"}
PACK = "01070000753002bc"  # can212-90: 26.3 V, 0.0 A, 70.0 %
STATUS = "0802000000000040"  # can212-94: 8 cells, 2 sensors
CELLS = ("010ce00cdf0cdf00", "020cde0ce00cdf00", "030cde0ce00cdf00")  # can212-95: 3296 3295 3295, ...


@pytest.fixture
def see(dissect: Dissect) -> Dissect:
    """``see(frames)``: what a SocketCAN capture of these frames shows."""

    def run(frames: Sequence[P], **more: Any) -> list[Row]:
        return dissect(frames, link_type=SOCKETCAN, **({"descriptions": ("can0",)} | more))

    return run


def real(key: str, at: float = 0.0, interface: int = 0) -> P:
    identifier = REAL[key]["can_id"]
    return can(
        int(identifier, 16),
        REAL[key]["hex"],
        flags="extended" if len(identifier) == 8 else "",
        at=at,
        interface=interface,
    )


@pytest.fixture(scope="module")
def alone(dissect: Dissect) -> dict[str, Row]:
    """Every real frame of Daly on an interface, so on a bus, of its own; a reply before each, so that it is known."""
    frames = [
        frame for i, key in enumerate(DALY) for frame in (reply(0x98, "00" * 8, at=i, on=i), real(key, i + 0.5, i))
    ]
    rows = dissect(frames, link_type=SOCKETCAN, descriptions=["can"] * len(DALY))
    return dict(zip(DALY, rows[1::2], strict=True))


@pytest.mark.parametrize("key", DALY)
def test_real_frames_have_the_values_of_their_source(alone: dict[str, Row], key: str) -> None:
    row, expected = alone[key], DALY[key]["expect"]
    identifier = int(DALY[key]["can_id"], 16)
    assert kinds([row]) == ["frame"]
    assert row["daly.transport"] == ["can"]
    assert row["daly.dialect"] == ["a5"]
    assert number(row, "can.priority") == 0x18
    assert number(row, "data_id") == identifier >> 16 & 0xFF == int(expected["data_id"], 16)
    assert number(row, "can.destination") == identifier >> 8 & 0xFF
    assert number(row, "can.source") == identifier & 0xFF
    assert number(row, "direction") == (1 if "direction" in expected else 2)
    assert number(row, "board") == expected["bms"] == 1
    assert row["daly.data"] == [DALY[key]["hex"]]
    assert not {"daly.address", "daly.start", "daly.length", "daly.checksum", "daly.checksum.status"} & row.keys()
    for name, value in expected.items():
        if name in NAMES:
            wanted = cast("list[float]", value if isinstance(value, list) else [value])
            assert numbers(row, NAMES[name]) == pytest.approx(wanted), name
        else:
            assert name in WORDS | OF_REQUESTS | {"bms", "host"}, name


def test_the_boards_own_output_to_an_inverter_is_named(see: Dissect) -> None:
    """Issue 212: Victron's 11-bit frames on the bus that is polled; before Daly is seen, nobody knows."""
    foreign = [key for key in REAL if key not in DALY]
    rows = see([real(foreign[0]), real("can212-90", 1), *(real(key, 2 + i) for i, key in enumerate(foreign))])
    assert kinds(rows) == ["", "frame"] + ["foreign"] * len(foreign)
    for key, row in zip(foreign, rows[2:], strict=True):
        assert row["daly.foreign"] == ["Victron/Pylontech"]
        assert row["daly.undecoded"] == [REAL[key]["hex"]]
        assert not {"daly.data", "daly.can.source", "daly.dialect", "daly.pack.voltage"} & row.keys()
    assert info(rows[2]) == "Not Daly: Victron/Pylontech"


def test_other_extended_frames_are_named_or_left_alone(see: Dissect) -> None:
    others = (0x4210, 0x18F00180, 0x18F10180, 0x18EEFF80, 0x18FEF100, 0x18DAF110, 0x4300, 0x1890_0102)
    rows = see(
        [reply(0x90, PACK)] + [can(identifier, "0102030405060708", at=1 + i) for i, identifier in enumerate(others)]
    )
    assert [row.get("daly.foreign") for row in rows[1:4]] == [["Pylontech-HV"], ["Deye"], ["Deye"]]
    assert (number(rows[2], "can.destination"), number(rows[2], "can.source")) == (1, 0x80)
    assert kinds(rows[4:]) == [""] * 5


def test_ids_outside_the_paper_count_once_daly_was_seen(see: Dissect) -> None:
    """0x18DA4001 is also UDS (ISO 15765-2 normal fixed addressing): the same frame before and after."""
    switch = can(0x18DA0140, "01" + "00" * 7)
    rows = see([switch, P(request(0x90, at=1).hex, 1), P(switch.hex, 2), can(0x18DA4001, "01" + "00" * 7, at=2.1)])
    assert kinds(rows) == ["", "frame", "frame", "frame"]
    assert number(rows[2], "write") == 1
    assert info(rows[2]) == "WRITE board 1  0xDA Charge MOS: switches the charge MOS on"
    assert rows[3]["daly.write_result"] == ["confirmed"]
    assert number(rows[3], "request_in") == 3


def test_every_bus_is_known_by_itself(see: Dissect) -> None:
    frames = [
        request(0x90),
        request(0x50, at=0.5, on=1),
        request(0x50, at=1),
        request(0x90, at=2, on=1),
        request(0x50, at=3, on=1),
    ]
    assert kinds(see(frames, descriptions=("can0", "can1"))) == ["frame", "", "frame", "frame", "frame"]


def test_requests_and_replies(see: Dissect) -> None:
    rows = see(
        [
            request(0x94, data="", at=0),
            reply(0x94, STATUS, at=0.011),
            request(0x95, at=0.02),
            *(reply(0x95, cells, at=0.03 + i / 100) for i, cells in enumerate(CELLS)),
        ]
    )
    assert numbers(rows[0], "reply_in") == [2]
    assert "daly.data" not in rows[0]
    assert number(rows[1], "response_time") == pytest.approx(0.011, abs=2e-6)
    assert [numbers(row, "request_in") for row in rows[3:]] == [[3]] * 3
    assert [numbers(row, "reassembled_in") for row in rows[3:]] == [[6], [6], []]
    assert numbers(rows[5], "cells.voltage") == [3296, 3295, 3295, 3294, 3296, 3295, 3294, 3296]
    assert rows[5]["daly.reserved"] == ["0cdf00"]
    assert [(row[SOURCE][0], row[DESTINATION][0]) for row in rows[:2]] == [
        ("PC 0x40", "Board 1"),
        ("Board 1", "PC 0x40"),
    ]
    assert info(rows[0]) == "Request board 1  0x94 Status"
    assert info(rows[1]).startswith("Reply board 1  0x94 Status: 8 cells  2 sensors")


def test_a_request_takes_the_reply_of_the_board_it_names_alone(see: Dissect) -> None:
    rows = see([request(0x90, board=2), reply(0x90, PACK, board=1, at=0.01), reply(0x90, PACK, board=2, at=0.02)])
    assert number(rows[0], "board") == 2
    assert number(rows[1], "unasked") == number(rows[1], "other_board") == 1
    assert number(rows[2], "request_in") == 1


def test_a_request_again_is_a_retry_and_never_an_echo(see: Dissect) -> None:
    """Within the echo time of a serial line, from the other side, and without bytes."""
    rows = see(
        [
            request(0x90),
            P(request(0x90).hex, 0.01, direction=2),
            request(0x90, data="", at=0.02),
            can(0x18900140, flags="extended+remote_transmission_request", at=0.03),
        ]
    )
    assert [number(row, "direction") for row in rows] == [1] * 4
    assert [number(row, "retry") for row in rows] == [None, 1, None, 1]
    assert [number(row, "can.remote") for row in rows] == [None, None, None, 1]


def test_a_remote_frame_with_a_length_has_no_bytes(see: Dissect) -> None:
    """Its bytes are filling; a tree tells, so a pass without one reads it again."""
    frames = [can(0x18900140, "00" * 8, flags="extended+remote_transmission_request"), request(0x90, data="", at=0.01)]
    for tree in (True, False):
        rows = see(frames, tree=tree)
        assert number(rows[0], "can.remote") == 1
        assert "daly.data" not in rows[0]
        assert number(rows[1], "retry") == 1


def test_a_remote_frame_cut_off_is_not_ours(see: Dissect) -> None:
    """Its length says eight; a capture holds so many bytes of filling, unless the snap length took them."""
    whole = bytes.fromhex(can(0x18900140, "00" * 8, flags="extended+remote_transmission_request").hex)
    rows = see([P(whole[:8].hex()), P(whole[:12].hex(), 0.1), P(whole.hex(), 0.2)])
    assert kinds(rows) == ["", "", "frame"]


def test_hosts(see: Dissect) -> None:
    """40 and 41 are one host, 80 is another."""
    rows = see([request(0x90), request(0x91, host=0x41, board=2, at=0.1), request(0x92, host=0x80, at=0.2)])
    assert [number(row, "second_host") for row in rows] == [None, None, 1]
    assert [number(row, "board") for row in rows] == [1, 2, 1]
    assert [row[SOURCE][0] for row in rows] == ["PC 0x40", "PC 0x41", "App 0x80"]


def test_a_short_reply_answers_and_says_nothing(see: Dissect) -> None:
    rows = see(
        [
            request(0x90),
            reply(0x90, PACK[:8], at=0.01),
            request(0x95, at=0.1),
            reply(0x95, CELLS[0], at=0.11),
            reply(0x93, "0001", at=0.12),
            reply(0x95, CELLS[1], at=0.13),
            can(0x18D90140, "01" + "00" * 7, at=0.2),
            can(0x18D94001, "01", at=0.21),
            can(0x18DA0140, "01", at=0.3),
            can(0x18DA4001, "01" + "00" * 7, at=0.31),
        ]
    )
    assert number(rows[1], "request_in") == 1
    assert "daly.pack.voltage" not in rows[1]
    assert rows[1]["daly.data"] == [PACK[:8]]
    assert number(rows[4], "unasked") == 1
    assert numbers(rows[5], "request_in") == [3]  # the burst goes on
    assert "daly.burst.missing" not in rows[5]
    assert number(rows[7], "request_in") == 7
    assert number(rows[9], "request_in") == 9
    assert "daly.write_result" not in rows[7].keys() | rows[9].keys()
    assert info(rows[8]) == "WRITE board 1  0xDA Charge MOS: not of eight bytes"


def switch(at: float, host: int, byte: int, *, asks: bool) -> P:
    return (request if asks else reply)(0xD9, data=f"{byte:02x}" + "00" * 7, host=host, at=at)


def test_a_reply_belongs_to_the_request_of_the_host_that_it_is_sent_to(see: Dissect) -> None:
    """The identifier says who is answered (field notes c.1): host 40 switches off, host 80 on, both as they wanted."""
    rows = see(
        [
            request(0x90),
            request(0x90, host=0x80, at=0.001),
            reply(0x90, PACK, at=0.003),
            reply(0x90, PACK, host=0x80, at=0.004),
            switch(0.1, 0x40, 0, asks=True),
            switch(0.101, 0x80, 1, asks=True),
            switch(0.103, 0x40, 0, asks=False),
            switch(0.104, 0x80, 1, asks=False),
        ]
    )
    assert [numbers(row, "reply_in") for row in rows[:2]] == [[3], [4]]
    assert [number(row, "request_in") for row in (rows[2], rows[3], rows[6], rows[7])] == [1, 2, 5, 6]
    assert [number(row, "response_time") for row in rows[2:4]] == pytest.approx([0.003, 0.003], abs=2e-6)
    assert [row["daly.write_result"] for row in rows[6:]] == [["confirmed"], ["confirmed"]]


def test_a_reply_to_an_address_that_did_not_ask_answers_the_newest(see: Dissect) -> None:
    """40 and 41 are one host; and a board may answer to 40 whoever asks."""
    rows = see(
        [
            request(0x90, host=0x41),
            reply(0x90, PACK, at=0.01),
            request(0x90, host=0x80, at=0.1),
            reply(0x90, PACK, at=0.11),
        ]
    )
    assert [number(rows[n], "request_in") for n in (1, 3)] == [1, 3]


def test_bursts_of_two_boards_run_side_by_side(see: Dissect) -> None:
    frames = [reply(0x94, STATUS, board=board) for board in (1, 2)]
    frames += [request(0x95, board=board, at=0.01) for board in (1, 2)]
    for i, cells in enumerate(CELLS):
        at = 0.02 + i / 100
        frames += [reply(0x95, cells, at=at), reply(0x95, cells, board=2, at=at + 0.002)]
        frames.append(reply(0x90, PACK, board=3, at=at + 0.004))
    rows = see(frames)
    parts = [rows[n] for n in (4, 5, 7, 8, 10, 11)]
    assert [number(row, "request_in") for row in parts] == [3, 4] * 3
    assert [numbers(row, "reassembled_in") for row in parts] == [[11], [12], [11], [12], [], []]
    for row in parts[4:]:
        assert numbers(row, "cells.voltage") == [3296, 3295, 3295, 3294, 3296, 3295, 3294, 3296]
    assert not any("daly.burst.cut_off" in row or "daly.burst.missing" in row for row in rows)


def test_bursts_of_one_board_to_two_hosts_run_side_by_side(see: Dissect) -> None:
    frames = [reply(0x94, STATUS), request(0x95, at=0.01), request(0x95, host=0x80, at=0.011)]
    for i, cells in enumerate(CELLS):
        frames += [reply(0x95, cells, host=host, at=0.02 + i / 100) for host in (0x40, 0x80)]
    rows = see(frames)
    assert [number(row, "request_in") for row in rows[3:]] == [2, 3] * 3
    assert [numbers(row, "reassembled_in") for row in rows[3:]] == [[8], [9], [8], [9], [], []]
    assert not any("daly.burst.repeat" in row or "daly.unanswered" in row for row in rows)


def test_a_burst_is_cut_off_by_its_own_board_alone(see: Dissect) -> None:
    """Board 1 stops after one frame of three and says 0x90; board 2 stops too, and half a second goes by."""
    rows = see(
        [
            *(reply(0x94, STATUS, board=board) for board in (1, 2)),
            reply(0x95, CELLS[0], at=0.1),
            reply(0x95, CELLS[0], board=2, at=0.11),
            reply(0x90, PACK, at=0.12),
            reply(0x98, "00" * 8, board=3, at=0.7),
        ]
    )
    assert [number(row, "burst.cut_off") for row in rows] == [None, None, 1, 1, None, None]


def test_only_a_request_to_its_board_makes_the_same_number_a_new_burst(see: Dissect) -> None:
    sensors = "01323200000000ff"
    rows = see(
        [
            request(0x96),
            reply(0x96, sensors, at=0.01),
            request(0x96, board=2, at=0.02),
            reply(0x96, sensors, at=0.03),
            request(0x96, at=0.04),
            reply(0x96, sensors, at=0.05),
        ]
    )
    assert [number(rows[n], "burst.repeat") for n in (1, 3, 5)] == [None, 1, None]
    assert number(rows[5], "request_in") == 5


def test_what_boards_remember_and_contradict(see: Dissect) -> None:
    """0x90 says 26.3 V; three cells of 3.3 V sum up to 9.9 V. Two boards are two memories."""
    rows = see(
        [
            reply(0x94, "0301000000000000"),
            reply(0x95, CELLS[0], at=0.1),
            reply(0x90, PACK, board=2, at=0.2),
            reply(0x90, PACK, at=0.3),
            reply(0x93, "0101010000000000", at=0.4),
            reply(0x93, "0201010000000000", at=0.5),
        ]
    )
    assert numbers(rows[1], "cells.voltage") == [3296, 3295, 3295]
    assert "daly.contradiction" not in rows[2]
    assert rows[3]["daly.contradiction"] == ["pack_voltage"]
    assert rows[5]["daly.changed"] == ["state"]
    assert "Changed since packet 5: state" in expert(rows[5])


def test_error_frames_can_fd_and_snapped_frames_are_not_ours(see: Dissect) -> None:
    daly = bytes.fromhex(reply(0x90, PACK).hex)
    rows = see(
        [
            reply(0x90, PACK),
            can(0x18904001, PACK, flags="error", at=1),
            canfd(0x18904001, PACK, at=2),
            P(daly[:12].hex(), 3),
        ]
    )
    assert kinds(rows) == ["frame", "", "", ""]


@pytest.mark.parametrize("tree", [True, False], ids=["two passes, with a tree", "two passes"])
def test_can_fd_does_not_answer(see: Dissect, tree: bool) -> None:
    rows = see([request(0x90), canfd(0x18904001, PACK, at=0.01), reply(0x90, PACK, at=0.02)], tree=tree)
    assert kinds(rows) == ["frame", "", "frame"]
    assert number(rows[2], "request_in") == 1


MIXED = [
    request(0x90),
    request(0x90, at=0.001, on=1),
    reply(0x90, PACK, at=0.01, on=1),
    reply(0x90, PACK, at=0.02),
    reply(0x93, "0101010000000000", at=0.03, on=1),
    reply(0x93, "0201010000000000", at=0.04),
    can(0x351, "00", flags="", at=0.05),
    keep_alive(at=0.06),
]


@pytest.mark.parametrize("interfaces", [1, 2])
def test_passes_agree(see: Dissect, interfaces: int) -> None:
    frames = [P(frame.hex, frame.at, frame.interface % interfaces) for frame in MIXED]
    descriptions = ("can0", "can1")[:interfaces]
    one, two, blind = (
        see(frames, descriptions=descriptions, two_pass=two_pass, tree=tree)
        for two_pass, tree in ((False, True), (True, True), (True, False))
    )
    later = {"daly.reply_in", "daly.unanswered"}
    plain = [{name: value for name, value in row.items() if name not in later} for row in two]
    assert [{name: value for name, value in row.items() if name not in later} for row in one] == plain
    # On one bus the first reply belongs to the newest request.
    assert [numbers(row, "reply_in") for row in two[:2]] == [[4], [3]]
    if interfaces == 1:
        assert blind == two
    else:
        assert [{name: value for name, value in row.items() if name not in later} for row in blind] == plain


def test_any_order_of_packets(tshark: Tshark, see: Dissect) -> None:
    frames = [P(frame.hex, frame.at) for frame in MIXED]
    see(frames)
    path = max(tshark.home.glob("packets-*.pcapng"), key=lambda made: made.stat().st_mtime_ns)
    server = Sharkd(tshark, path)
    try:
        in_order = [server.tree(n) for n in range(1, len(frames) + 1)]
        for n in (8, 3, 1, 7, 4, 4, 2):
            assert server.tree(n) == in_order[n - 1]
        assert "Request in: 2" in str(in_order[2])
    finally:
        server.close()


def test_the_preference_turns_the_search_off_and_decode_as_on(tshark: Tshark, see: Dissect) -> None:
    frames = [
        can(0x351, "00", flags=""),
        can(0x18500140),
        can(0x04008001, CELLS[0]),
        can(0x18DAF110, "02"),
        reply(0x90, PACK),
    ]
    assert kinds(see(frames, options=("daly.can:FALSE",))) == [""] * 5
    path = max(tshark.home.glob("packets-*.pcapng"), key=lambda made: made.stat().st_mtime_ns)
    words = ("-d", "can.subdissector,daly", "-r", str(path), "-T", "fields", "-e", "daly.kind", "-e", "daly.foreign")
    for options in ((), ("-o", "daly.can:FALSE"), ("-2",)):
        done = tshark.run(*options, *words)
        assert done.returncode == 0, done.stderr
        rows = [line.split("\t") for line in done.stdout.decode().splitlines()]
        assert [row[0] for row in rows] == ["foreign", "frame", "foreign", "", "frame"]
        assert [row[1] for row in rows][::2] == ["Victron/Pylontech", "HKMS or Deye", ""]


COOKED, CAN_PROTOCOL = 113, 0x000C  # link type of Linux' cooked captures, whose CAN identifiers are in the host's order
COOKED_HEADER = struct.pack(">HHHQH", 0, 280, 0, 0, CAN_PROTOCOL).hex()


def cooked(frame: P) -> P:
    """Put a frame as it is in a SocketCAN capture into a cooked one."""
    identifier = int(frame.hex[:8], 16).to_bytes(4, sys.byteorder)
    return P(COOKED_HEADER + identifier.hex() + frame.hex[8:], frame.at)


@pytest.mark.parametrize("link_type", [SOCKETCAN, COOKED], ids=["SocketCAN", "cooked"])
@pytest.mark.parametrize(
    ("first", "shown"),
    [
        (can(0x351, "00", flags=""), "foreign\tVictron/Pylontech\t"),
        (can(0x18500140), "frame\t\t"),
        (can(0x18500140, flags="extended+remote_transmission_request"), "frame\t\t1"),
        (can(0x04008001, CELLS[0]), "foreign\tHKMS or Deye\t"),
        (can(0x18DAF110, "02"), "\t\t"),
    ],
    ids=["standard", "classic", "remote", "HKMS", "not ours"],
)
def test_the_first_frame_counts_where_the_user_chose_us(
    tshark: Tshark, open_folder: Path, link_type: int, first: P, shown: str
) -> None:
    path = open_folder / "chosen.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("made", "can0", link_type))
        for frame in (first, can(0x18510140, at=1)):
            data = (frame if link_type == SOCKETCAN else cooked(frame)).hex
            writer.write_packet(EPOCH_NS + round(frame.at * 1e9), bytes.fromhex(data))
    path.chmod(0o644)
    fields = [word for name in ("kind", "foreign", "can.remote") for word in ("-e", f"daly.{name}")]
    done = tshark.run("-d", "can.subdissector,daly", "-r", str(path), "-T", "fields", *fields)
    assert done.stdout.decode().replace("True", "1").splitlines() == [shown, "frame\t\t"]


CANDUMP = """\
(1700000000.000000) can0 18900140#
(1700000000.010000) can0 18904001#01070000753002BC
(1700000000.020000) can0 351#0011223344556677
(1700000000.030000) can0 18920140#R
(1700000000.040000) can0 18924001##03D023B01FFFFFFFF
(1700000000.050000) can0 18924001#3D023B01FFFFFFFF
"""


@pytest.mark.parametrize("passes", [(), ("-2",), ("-2", "-Y", "frame")], ids=["one", "two", "two with a tree"])
def test_candump_logs(tshark: Tshark, open_folder: Path, passes: tuple[str, ...]) -> None:
    path = open_folder / "candump.log"
    path.write_text(CANDUMP)
    path.chmod(0o644)
    names = (
        "daly.kind",
        "daly.request_in",
        "daly.pack.voltage",
        "daly.temperature.max",
        "daly.can.remote",
        "_ws.lua.error",
    )
    done = tshark.run(*passes, "-r", str(path), "-T", "fields", *(word for name in names for word in ("-e", name)))
    rows = [line.replace("True", "1").split("\t") for line in done.stdout.decode().splitlines()]
    assert rows == [
        ["frame", "", "", "", "", ""],
        ["frame", "1", "26.3", "", "", ""],
        ["foreign", "", "", "", "", ""],
        ["frame", "", "", "", "1", ""],
        ["", "", "", "", "", ""],
        ["frame", "4", "", "21", "", ""],
    ]


def test_statistics_count_by_the_board_that_is_asked(tshark: Tshark, see: Dissect) -> None:
    see([request(0x90, board=2), reply(0x90, PACK, board=2, at=0.02), request(0x94, board=3, at=0.5), keep_alive(at=5)])
    path = max(tshark.home.glob("packets-*.pcapng"), key=lambda made: made.stat().st_mtime_ns)
    text = tshark.run("-q", "-z", "daly,stat", "-r", str(path)).stdout.decode()
    assert re.search(r"^2 +0x90 Pack +1 +1 +0 +0 +0 +0 +20\.0", text, re.M), text
    assert re.search(r"^3 +0x94 Status +1 +0 +1 +0 +0", text, re.M), text
