# SPDX-License-Identifier: GPL-2.0-or-later
"""Rebuild every sample in this folder, its manifest and its table, byte for byte the same each time.

    python pcap_samples/make_samples.py [FOLDER]

Real samples hold bytes that public material shows from real devices (real-frames.jsonl); how they are lined up in time
is made here: 37 ms from a request to its reply, frames of a burst back to back, as field notes have it. Made samples
come from the simulated bus. No file holds both; the one that comes near is made-modbus-mixed: real frames and the
papers' examples on one port, which they never shared.

The expected counts are what was put in, counted by hand; they are not taken from any decoder.
"""

from __future__ import annotations

import json
import random
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.interface import tap
from dalycapture.output import open_output
from dalycapture.pcap import PcapWriter
from dalycapture.pcapng import CRC_ERROR, TOO_SHORT, PcapngWriter
from dalyref.records import Kind, Splitter
from dalytools.simulator.bus import Bus
from dalytools.simulator.scenario import Board, Event, Habits, Host, Pack, Scenario
from dalytools.simulator.sent import Sent

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

HERE = Path(__file__).parent
EPOCH_NS = 1_767_225_600 * 10**9  # 2026-01-01 00:00:00 UTC; no sample says when anything happened
CHAR_NS = 10 * 10**9 / 9600
SILENCE_NS = 250_000_000  # docs/records.md, section 1
REPLY_NS = 37_000_000
GAP_NS = 60_000_000
ERROR_FLAGS = {Kind.BAD_CHECKSUM: CRC_ERROR, Kind.SHORT: TOO_SHORT}


@dataclass(frozen=True, slots=True)
class Real:
    """One entry of real-frames.jsonl: its bytes, and whether a host sent them."""

    id: str
    data: bytes
    request: bool
    synthetic: bool


def _real_frames() -> dict[str, Real]:
    entries: dict[str, Real] = {}
    for line in (HERE / "real-frames.jsonl").read_text(encoding="utf-8").splitlines():
        entry: dict[str, str] = json.loads(line)
        data = bytes.fromhex(entry["hex"])
        entries[entry["id"]] = Real(entry["id"], data, entry.get("dir") == "req", "synthetic" in entry)
    return entries


REAL = _real_frames()


def _named(start: str, *but: str) -> list[str]:
    """Ids of the real frames whose name starts so, in the order of the file; none that a test's author made up."""
    return [name for name, entry in REAL.items() if name.startswith(start) and name not in but and not entry.synthetic]


TANO = _named("tano-", "tano-95-seq")  # the burst once more, in one piece
CPY = _named("cpy-")
# The papers' examples; the reply to a write of one register is the request again.
DOC = ["doc-rd-req", "doc-rd-rsp", "doc-wr-req", "doc-wr-req", "doc-wm-req", "doc-wm-rsp"]
ESS = _named("ess-")
SYS = _named("sys-")


def lined_up(ids: list[str], *, gap_ns: int = GAP_NS, reply_ns: int = REPLY_NS) -> list[Sent]:
    """Give real frames made times: a reply 37 ms after its request, its burst back to back, then a gap."""
    sent: list[Sent] = []
    now = 0
    before = None
    for entry in (REAL[name] for name in ids):
        burst = before is not None and before.data[:3] == entry.data[:3] and entry.data[:2] == b"\xa5\x01"
        if before is not None and not burst:
            now += reply_ns if before.request and not entry.request else gap_ns
        sent.append(Sent(now, "host" if entry.request else "board", entry.data))
        now += int(len(entry.data) * CHAR_NS)
        before = entry
    return sent


def polled(scenario: Scenario, polls: int) -> list[Sent]:
    """Let the scenario's host send so many requests."""
    bus = Bus(scenario)
    return [sent for _ in range(polls) for sent in bus.poll()]


def one_board(cells: int, sensors: int, *, address: int | None = None, sensor_frames: int = 1) -> Scenario:
    """Make a scenario with board 1 alone."""
    board = Board(1, Pack(cells=cells, sensors=sensors), Habits(sensor_frames=sensor_frames))
    return Scenario(boards=(board,), host=Host(address=address))


def faults() -> list[Sent]:
    """Poll state and faults while faults come and go: both levels of one, two others at once, then none."""
    events = (
        Event(0.5, "fault", name="cell_volt_high_level_1"),
        Event(1.0, "fault", name="cell_volt_high_level_2"),
        Event(1.5, "clear", name="cell_volt_high_level_2"),
        Event(2.0, "fault", name="short_circuit_protect"),
        Event(2.0, "fault", name="cell_temp_sensor"),
        Event(2.5, "clear"),
    )
    return polled(Scenario(host=Host(plan=(0x93, 0x98)), events=events), 24)


def damaged() -> list[Sent]:
    """Poll three cycles of 25 frames, heard badly: each kind of damage at a known place."""
    sent = polled(one_board(16, 2), 30)
    data = [bytearray(piece.data) for piece in sent]
    data[3][5] ^= 0x04  # a bit of the 0x91 reply: bad checksum
    del data[7][7:]  # the 0x93 reply ends early: short
    del data[13][8:10]  # two bytes of 0x95 frame 3 lost: short
    data[21][:0] = b"\x00\x00\xff\x3c"  # noise before a request: junk
    del data[26][:1]  # the 0x90 reply without its start byte: junk
    data[30][12] ^= 0x80  # a bit of a checksum: bad checksum
    data[33][3] = 0x48  # a bit of the length byte: no frame, no header: junk
    del data[74][5:]  # the last reply, cut off by the end of the capture: short
    return [Sent(piece.time_ns, piece.sender, bytes(heard)) for piece, heard in zip(sent, data, strict=True)]


def sleeping() -> list[Sent]:
    """Poll a board that is silent, then echoes, then wakes up to ten replies of nothing, then answers."""
    bus = Bus(Scenario(boards=(Board(1, Pack(), Habits(), "silence"),)))
    board = bus.boards[1]
    sent = [sent for _ in range(3) for sent in bus.poll()]
    board.asleep = "echo"
    sent += [sent for _ in range(10) for sent in bus.poll()]
    board.wake()
    bus.now_ns += 3_000_000_000
    return sent + [sent for _ in range(20) for sent in bus.poll()]


def two_boards() -> list[Sent]:
    """Poll boards 1 and 2 on one pair, each asked by its own host address."""
    boards = (Board(1, Pack(cells=16, sensors=2)), Board(2, Pack(cells=8, sensors=1, start_soc=58.0)))
    return polled(Scenario(boards=boards), 40)


@dataclass(frozen=True, slots=True)
class Sample:
    """One capture: what it is, what was put in, and how it is cut into packets."""

    file: str
    look: str
    counts: dict[str, int]  # by kind, counted by hand from what was put in
    sent: Callable[[], list[Sent]]
    origin: list[str] = field(default_factory=list[str])  # ids in real-frames.jsonl; none: the simulated bus
    note: str = ""
    link_type: int = 147
    chunked: bool = False
    marks: dict[int, tuple[str, ...]] = field(
        default_factory=dict[int, tuple[str, ...]]
    )  # events after so many records

    @property
    def real(self) -> bool:
        """Whether bytes, and their order, are from real devices."""
        return self.file.startswith("real-")


def _from_real(file: str, look: str, ids: list[str], counts: dict[str, int], **times: int) -> Sample:
    note = "Real bytes, made times"
    return Sample(file, look, counts, lambda: lined_up(ids, **times), list(dict.fromkeys(ids)), note)


SAMPLES = (
    _from_real(
        "real-poll-cycle.pcapng",
        "PC software polls a 14S pack, 90 to 98 and D8: stale reserved bytes, cell slot 15 stale, a needless 2nd 0x96",
        TANO,
        {"frame": 25},  # 10 requests; replies 5 + 5 of 0x95 + 2 of 0x96 + 3
    ),
    _from_real(
        "real-8s-cpy.pcapng",
        "replies of an 8S pack, no requests: 0x98 byte 6 bit 4 (MOS off by command), slot 9 stale",
        CPY,
        {"frame": 11},
    ),
    _from_real(
        "real-corrupt-lv165.pcapng",
        "four bytes lost inside 0x95 frame 5, then a 0x90 payload behind a 0x95 header: how cell 13 got -23.3 V",
        ["lv165-stream"],
        {"frame": 5, "short": 1, "bad_checksum": 1},
    ),
    _from_real(
        "real-mos-switch.pcapng",
        "discharge MOS on and off (D9): 01 is on, stale 0x95 bytes behind the new state",
        ["d9-on-req", "d9-on-rsp", "d9-off-req", "d9-off-rsp"],
        {"frame": 4},
        gap_ns=2_000_000_000,
    ),
    _from_real(
        "real-sinowealth.pcapng",
        "two exchanges of a Sinowealth board: foreign, named and not decoded",
        ["sino-0-req", "sino-0-rsp", "sino-1-req", "sino-1-rsp"],
        {"foreign": 2},
        gap_ns=1_000_000_000,
    ),
    _from_real(
        "real-lone-frames.pcapng",
        "single frames of three sources: a first 0x90 reply, a write of clock and SOC (21), a try at 1F",
        ["ff-90", "set-soc", "set-1f-try"],
        {"frame": 3},
        gap_ns=2_000_000_000,
    ),
    Sample(
        "made-poll-cycle.pcapng",
        "four polls of a 16S pack: everything moves a little, nothing is wrong",
        {"frame": 100},  # 4 x (10 requests + 15 replies, 6 of them 0x95)
        lambda: polled(one_board(16, 2), 40),
    ),
    Sample(
        "made-48-cells.pcapng",
        "48 cells in 16 frames, 8 sensors in 2",
        {"frame": 72},  # 2 x (10 + 5 + 16 + 2 + 3)
        lambda: polled(one_board(48, 8), 20),
    ),
    Sample(
        "made-16-cells-stale.pcapng",
        "16 cells asked by 0x40: 6 frames, the last with two stale slots that are no cells 17 and 18; 2 x 0x96",
        {"frame": 52},  # 2 x (10 + 5 + 6 + 2 + 3)
        lambda: polled(one_board(16, 1, address=0x40, sensor_frames=2), 20),
    ),
    Sample(
        "made-app-16-frames.pcapng",
        "the same 16 cells asked by 0x80 (app): 16 frames, ten of them empty",
        {"frame": 70},  # 2 x (10 + 5 + 16 + 1 + 3)
        lambda: polled(one_board(16, 1, address=0x80), 20),
    ),
    Sample(
        "made-faults.pcapng",
        "faults come and go: cell voltage high level 1, level 2, back; short circuit and sensor together; none",
        {"frame": 48},  # 12 x 2 IDs x (request + reply)
        faults,
    ),
    Sample(
        "made-damaged-bus.pcapng",
        "three polls, damaged in eight places: bits, lost bytes, a lost start, noise, a cut end",
        {"frame": 68, "bad_checksum": 2, "short": 3, "junk": 3},  # 75 sent, 7 of them damaged; noise is junk too
        damaged,
    ),
    Sample(
        "made-raw-chunked.pcapng",
        "two polls as a careless reader stores them: frames cut anywhere, several or parts in a packet",
        {"frame": 50},
        lambda: polled(one_board(16, 2), 20),
        chunked=True,
    ),
    Sample(
        "made-two-boards.pcapng",
        "boards 1 (16S) and 2 (8S) on one pair, asked by 0x40 and 0x41",
        {"frame": 94},  # 2 x (25 + 10 + 5 + 3 + 1 + 3)
        two_boards,
    ),
    Sample(
        "made-sleeping.pcapng",
        "asleep: silence (two retries), then echoes; awake: ten replies of nothing (-3000 A), then a good poll",
        {"frame": 73},  # 3 requests; 10 requests and 10 echoes; 25 all zero; 25
        sleeping,
    ),
    Sample(
        "made-modbus-mixed.pcapng",
        "all three dialects on one port: A5 polls, the papers' Modbus examples, real D2 and 81 Modbus frames",
        {"frame": 54},  # 25 + 6 + 14 + 9
        lambda: lined_up([*TANO, *DOC, *ESS, *SYS]),
        list(dict.fromkeys([*TANO, *DOC, *ESS, *SYS])),
        "Real bytes and the papers' examples, never together on one port; made times",
    ),
    Sample(
        "made-mos-payloads.pcapng",
        "replies to D9 with stale 0x94 bytes behind the state; envelopes rebuilt around published payloads",
        {"frame": 2},
        lambda: lined_up(["mos-on-payload", "mos-off-payload"], gap_ns=2_000_000_000),
        ["mos-on-payload", "mos-off-payload"],
        "Real payloads, made envelopes and times",
    ),
    Sample(
        "made-events.pcapng",
        "events between records: the port lost and back, a mark set by the user",
        {"frame": 50, "event": 3},
        lambda: polled(one_board(16, 2), 20),
        marks={25: ("port lost", "port back"), 42: ("mark: charger plugged in",)},
    ),
    Sample(
        "made-link-type-151.pcapng",
        "one poll under link type USER4 (151)",
        {"frame": 25},
        lambda: polled(one_board(16, 2), 10),
        link_type=151,
    ),
    Sample(
        "made-classic.pcap",
        "one poll in classic pcap: no interface, no flags, no comments",
        {"frame": 25},
        lambda: polled(one_board(16, 2), 10),
    ),
)


def by_record(sent: list[Sent]) -> Iterator[tuple[int, bytes, Kind]]:
    """Cut what was heard into records, as the sniffer does: (time of the first byte, bytes, kind)."""
    splitter = Splitter()
    starts: list[tuple[int, int]] = []  # stream offset, time
    offset = end_ns = 0

    def timed(start: int) -> int:
        at, time_ns = max(piece for piece in starts if piece[0] <= start)
        return time_ns + int((start - at) * CHAR_NS)

    for piece in sent:
        if piece.time_ns - end_ns > SILENCE_NS:
            for record in splitter.flush():
                yield timed(record.start), record.data, record.kind
        starts.append((offset, piece.time_ns))
        offset += len(piece.data)
        end_ns = piece.time_ns + int(len(piece.data) * CHAR_NS)
        for record in splitter.feed(piece.data):
            yield timed(record.start), record.data, record.kind
    for record in splitter.flush():
        yield timed(record.start), record.data, record.kind


def by_chunk(sent: list[Sent]) -> Iterator[tuple[int, bytes, Kind]]:
    """Cut what was heard anywhere: 1 to 40 bytes, seeded."""
    chance = random.Random("chunks")  # noqa: S311 - the same cuts each time, no secret
    stream = [(piece.time_ns + int(at * CHAR_NS), byte) for piece in sent for at, byte in enumerate(piece.data)]
    while stream:
        size = 1 + int(chance.random() ** 2 * 40)
        yield stream[0][0], bytes(byte for _, byte in stream[:size]), Kind.FRAME
        stream = stream[size:]


def write(sample: Sample, folder: Path) -> None:
    """Write one sample's capture file."""
    output = open_output(folder / sample.file)
    classic = sample.file.endswith(".pcap")
    writer = PcapWriter(output) if classic else PcapngWriter(output, application="dalyshark samples")
    with writer:
        number = writer.add_interface(tap("sample", link_type=sample.link_type))
        comment = sample.note or "Made by the simulated bus"
        cut = by_chunk if sample.chunked else by_record
        last_ns = EPOCH_NS
        for records, (time_ns, data, kind) in enumerate(cut(sample.sent())):
            for text in sample.marks.get(records, ()):
                last_ns += 20_000_000
                writer.write_packet(last_ns, b"", interface=number, comment=text)
            flags = ERROR_FLAGS.get(kind, 0)
            last_ns = EPOCH_NS + time_ns
            writer.write_packet(last_ns, data, interface=number, flags=flags, comment=comment)
            comment = ""


def manifest() -> list[dict[str, object]]:
    """Describe all samples, for programs."""
    return [
        {
            "file": sample.file,
            "real": sample.real,
            "origin": sample.origin or ["simulated bus"],
            "note": sample.note or "Made by the simulated bus",
            "look": sample.look,
            "link_type": sample.link_type,
            "counts": sample.counts,
        }
        for sample in SAMPLES
    ]


def table() -> str:
    """Describe all samples, for people."""
    lines = [
        "# Samples",
        "",
        "Made by `make_samples.py`; do not edit. `real-*` hold bytes of real devices (from `real-frames.jsonl`,",
        "where each names its source); their times are made: 37 ms from request to reply, bursts back to back.",
        "`made-*` come from the simulated bus, or say what else was made. Counts are what was put in, counted by hand.",
        "CAN, Bluetooth, TCP, and all wires in one file: [wires](wires/README.md).",
        "",
        "| capture | what to look at | records | origin | link type |",
        "|---|---|---|---|---|",
    ]
    for sample in SAMPLES:
        counts = ", ".join(f"{count} {kind}" for kind, count in sample.counts.items())
        ids = sample.origin
        origin = (
            "simulated bus" if not ids else ", ".join(ids) if len(ids) < 5 else f"{ids[0]} ... {ids[-1]} ({len(ids)})"
        )
        lines.append(f"| `{sample.file}` | {sample.look} | {counts} | {origin} | {sample.link_type} |")
    return "\n".join(lines) + "\n"


def make(folder: Path) -> None:
    """Write all samples, the manifest and the table to a folder."""
    for sample in SAMPLES:
        write(sample, folder)
    (folder / "manifest.json").write_text(json.dumps(manifest(), indent=1) + "\n", encoding="utf-8")
    (folder / "README.md").write_text(table(), encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
