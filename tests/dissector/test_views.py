# SPDX-License-Identifier: GPL-2.0-or-later
"""The same capture however it is looked at: one pass, two, filtered, in shuffled order; and other programs' files."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.dissector.dissection import EPOCH_NS, Dissect, P, a5, in_a_row, kinds, number

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalytools.field_names import FIELD_NAMES

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

SAMPLES = sorted(Path(__file__).resolve().parents[2].joinpath("pcap_samples").glob("*.pcap*"))
WIRES = sorted(Path(__file__).resolve().parents[2].joinpath("pcap_samples", "wires").glob("*.pcap*"))
LATER = {
    f"daly.{name}" for name in ("reply_in", "unanswered", "burst.cut_off", "reassembled_in")
}  # known in the second pass only; without a 0x94 the table of all cells is, too (DESIGN 3)
HELD = {"daly.kind", "daly.transport", "daly.undecoded"}  # bytes that are held show provisionally in the first pass
TABLE = {
    name
    for name in FIELD_NAMES
    if re.match(r"daly\.(cells\.|sensors\.|cell\.\d\d$|.*_(version|name|code|number)$)", name)
}


def fields(tshark: Tshark, sample: Path, *words: str, without: set[str]) -> list[list[str]]:
    names = [word for name in FIELD_NAMES if name not in without for word in ("-e", name)]
    link_types = "daly.link_types:147,148,150-162"
    done = tshark.run(*words, "-o", link_types, "-r", str(tshark.readable(sample)), "-T", "fields", *names)
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.decode().splitlines()]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.stem)
def test_one_pass_equals_two(tshark: Tshark, sample: Path) -> None:
    without = LATER | TABLE
    if "raw-chunked" in sample.stem:
        without |= HELD
    once = fields(tshark, sample, without=without)
    assert once == fields(tshark, sample, "-2", "-Y", "frame", without=without)
    assert any(any(row) for row in once)


def test_a_filter_finds_the_moment(tshark: Tshark) -> None:
    sample = next(path for path in SAMPLES if path.stem == "made-faults")
    done = tshark.run(
        "-r", str(tshark.readable(sample)), "-Y", "daly.fault_raised", "-T", "fields", "-e", "frame.number"
    )
    assert 1 <= len(done.stdout.split()) < len(list(read_capture(sample)))


def test_doubles_compare_as_written(tshark: Tshark) -> None:
    """53.3 must be found by == 53.3: a float field would find nothing."""
    sample = next(path for path in SAMPLES if path.stem == "real-poll-cycle")
    done = tshark.run("-r", str(tshark.readable(sample)), "-Y", "daly.pack.voltage == 52.8 && daly.soc == 50")
    assert len(done.stdout.splitlines()) == 1


def sharkd() -> str:
    program = os.environ.get("DALYSHARK_SHARKD") or shutil.which("sharkd")
    assert program, "sharkd comes with Debian's tshark package; DALYSHARK_SHARKD names another"
    return program


class Sharkd:
    """Wireshark's server for single packets: the stand-in for somebody who clicks about in the window."""

    def __init__(self, tshark: Tshark, sample: Path) -> None:
        self.process = tshark.start_program(
            [sharkd(), "-"],
            environment={"WIRESHARK_PLUGIN_DIR": str(tshark.home / "lua")},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self.ids = 0
        assert self.ask("load", file=str(tshark.readable(sample))) is not None

    def ask(self, method: str, **params: Any) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.ids += 1
        question = {"jsonrpc": "2.0", "id": self.ids, "method": method, "params": params}
        self.process.stdin.write(json.dumps(question).encode() + b"\n")
        self.process.stdin.flush()
        answer = json.loads(self.process.stdout.readline())
        assert "result" in answer, answer
        return answer["result"]

    def tree(self, packet: int) -> Any:
        return self.ask("frame", frame=packet, proto=True)["tree"]

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(10)


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.stem)
def test_any_order_shows_the_same(tshark: Tshark, sample: Path) -> None:
    packets = [packet.number for packet in read_capture(sample)]
    server = Sharkd(tshark, sample)
    try:
        # The first packet that is not Daly's, in a file that does not say it is ours, is where the dissector finds out
        # whether the user has a setting of their own for the link type.
        server.tree(1)
        in_order = {packet: server.tree(packet) for packet in packets}
        shuffled = packets[:]
        random.Random(7).shuffle(shuffled)
        for packet in shuffled:
            assert server.tree(packet) == in_order[packet], packet
    finally:
        server.close()


def test_several_interfaces_are_known_to_their_end_when_all_was_read_again(tshark: Tshark, open_folder: Path) -> None:
    """sharkd's loading tells no interface; after a look at every packet all is known, what came later too."""
    path = open_folder / "two.pcapng"
    with open_writer(path) as writer:
        for name in ("one", "two"):
            writer.add_interface(Interface(name, f"dalyshark bus={name}"))
        for interface, at, packet in (
            (0, 0, a5(0x40, 0x90)),
            (1, 0.01, a5(0x40, 0x90)),
            (1, 0.06, a5(1, 0x90, "020800007530026c")),
            (0, 2, a5(0x40, 0x91)),
        ):
            writer.write_packet(EPOCH_NS + round(at * 1e9), bytes.fromhex(packet), interface=interface)
    path.chmod(0o644)
    server = Sharkd(tshark, path)
    try:
        for packet in (1, 2, 3, 4):
            server.tree(packet)
        assert "No reply" in str(server.tree(1))
        assert "Reply in: 3" in str(server.tree(2))
        assert "No reply" not in str(server.tree(2))
    finally:
        server.close()


@pytest.mark.parametrize("wire", WIRES, ids=lambda path: path.stem)
def test_a_file_that_is_opened_again_shows_the_same(tshark: Tshark, wire: Path) -> None:
    server = Sharkd(tshark, wire)
    try:
        packets = range(1, server.ask("status")["frames"] + 1)
        for packet in packets:
            server.tree(packet)
        server.ask("setconf", name="daly.tcp_ports", value="8899")
        server.ask("load", file=str(tshark.readable(wire)))
        in_order = {packet: server.tree(packet) for packet in packets}
        for packet in (*packets, *random.Random(7).sample(packets, len(packets))):
            assert server.tree(packet) == in_order[packet], packet
    finally:
        server.close()


def test_a_classic_pcap_of_another_sniffer(dissect: Dissect) -> None:
    rows = dissect(in_a_row(a5(0x40, 0x90), a5(1, 0x90)), file_format="pcap")
    assert kinds(rows) == ["frame", "frame"]


@pytest.mark.parametrize("link_type", [148, 150, 162])
def test_other_user_link_types_by_preference(dissect: Dissect, link_type: int) -> None:
    rows = dissect([P(a5(0x40, 0x90))], link_type=link_type, options=["daly.link_types:147-162"])
    assert kinds(rows) == ["frame"]


def test_149_is_left_alone(dissect: Dissect) -> None:
    """A stock Wireshark reads USER2 as PKTAP."""
    rows = dissect([P(a5(0x40, 0x90))], link_type=149, options=["daly.link_types:147-162"])
    assert kinds(rows) == [""]


USERS_OWN = 'uat:user_dlts:"User 0 (DLT=147)","{}","0","","0",""'


def test_a_users_own_setting_keeps_what_is_not_daly(dissect: Dissect) -> None:
    """On a link type of the user's: until a good frame was seen, packets go where DLT_USER says (here: mbrtu)."""
    foreign = "010300000002c40b"
    packets = [P(foreign), P("0a0102", 1), P(a5(0x40, 0x90), 2), P(foreign, 3)]
    rows = dissect(packets, descriptions=["other sniffer"], options=[USERS_OWN.format("mbrtu")])
    assert kinds(rows) == ["", "", "frame", "foreign"]
    assert "Modbus" in rows[0]["_ws.col.Info"][0] or "Query" in rows[0]["_ws.col.Info"][0]


def test_without_a_setting_of_the_user_all_is_shown(dissect: Dissect) -> None:
    rows = dissect([P("a5019508021c000076560286b0"), P("00ff", 1)], descriptions=["other sniffer"])
    assert kinds(rows) == ["bad_checksum", "junk"]


def test_a_file_of_ours_is_ours_from_the_first_byte(dissect: Dissect) -> None:
    rows = dissect([P("00ff")], options=[USERS_OWN.format("mbrtu")])
    assert kinds(rows) == ["junk"]


def test_a_frame_that_begins_before_it_is_known_to_be_one(dissect: Dissect) -> None:
    frame = a5(0x40, 0x90)
    rows = dissect(
        [P(frame[:10]), P(frame[10:], 0.01)], descriptions=["other sniffer"], options=[USERS_OWN.format("mbrtu")]
    )
    assert rows[0]["daly.continued_in"] == ["2"]
    assert number(rows[1], "data_id") == 0x90


def test_snapped_packets_do_not_trip_it(tshark: Tshark, open_folder: Path) -> None:
    sample = next(path for path in SAMPLES if path.stem == "made-poll-cycle")
    for length in (1, 4, 12):
        data = bytearray(b"")
        snapped = open_folder / f"snapped-{length}.pcap"
        data += bytes.fromhex("d4c3b2a1020004000000000000000000ffff000093000000")
        for packet in read_capture(sample):
            seconds, rest = divmod(packet.time_ns, 1_000_000_000)
            piece = packet.data[:length]
            for value in (seconds, rest // 1000, len(piece), len(packet.data)):
                data += value.to_bytes(4, "little")
            data += piece
        snapped.write_bytes(data)
        snapped.chmod(0o644)
        done = tshark.run("-2", "-r", str(snapped), "-V")
        assert done.returncode == 0
        assert b"Lua" not in done.stderr + done.stdout
