# SPDX-License-Identifier: GPL-2.0-or-later
"""Rebuild the samples of the other wires (CAN, Bluetooth, TCP) and their manifest, byte for byte the same each time.

    python pcap_samples/make_wire_samples.py [FOLDER]

real-can: bytes of a real pack (real-frames.jsonl, can212-*), its answers and what it sends to an inverter; their times
are made. made-*: two polls of the simulated 16-cell pack of made-poll-cycle, by CAN, through a Bluetooth dongle and
through a serial server (port 8899); and one poll on all wires at once, each an interface of one file. Counts are by
hand.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from make_samples import EPOCH_NS, HERE, one_board, polled
from scapy.compat import raw
from scapy.layers.can import CAN

from dalycapture.interface import Interface
from dalycapture.output import open_output
from dalycapture.pcapng import PcapngWriter
from dalytools.simulator.capture_file import WIRES
from dalytools.simulator.wire import WirePacket
from dalytools.simulator.wire_can import SOCKETCAN

if TYPE_CHECKING:
    from collections.abc import Callable

FRAME_EVERY_NS = 10_000_000
POLL = 10  # requests of a poll: 90 to 98 and D8


@dataclass(frozen=True, slots=True)
class Sample:
    """One capture: what to look at, what was put in by kind, and how its packets are made, interface by interface."""

    file: str
    look: str
    counts: dict[str, int]
    made: Callable[[], list[tuple[Interface, list[WirePacket]]]]
    origin: str = "simulated bus"


def _real_can() -> list[tuple[Interface, list[WirePacket]]]:
    """Line up the real frames of the CAN pack, in the order of their list, 10 ms apart."""
    rows = map(json.loads, (HERE / "real-frames.jsonl").read_text(encoding="utf-8").splitlines())
    frames = [cast("dict[str, str]", row) for row in rows if str(row["id"]).startswith("can212-")]
    packets = [
        WirePacket(
            place * FRAME_EVERY_NS,
            raw(
                CAN(
                    flags="extended" if len(frame["can_id"]) > 3 else 0,  # hexadecimal digits
                    identifier=int(frame["can_id"], 16),
                    length=len(frame["hex"]) // 2,
                    data=bytes.fromhex(frame["hex"]),
                )
            ),
        )
        for place, frame in enumerate(frames)
    ]
    return [(Interface("can0", "Real bytes, made times", SOCKETCAN), packets)]


def _poll(wire: str, polls: int) -> tuple[Interface, list[WirePacket]]:
    scenario = one_board(16, 2)
    carrier = WIRES[wire](scenario)
    sent = polled(scenario, polls * POLL)
    packets = [packet for piece in sent for packet in carrier.feed(piece)]
    return carrier.interface, [*packets, *carrier.finish(sent[-1].time_ns)]


SAMPLES = (
    Sample(
        "real-can.pcapng",
        "answers of an 8S pack on CAN, and the frames it sends to an inverter by itself: foreign, named",
        {"frame": 8, "foreign": 10},
        _real_can,
        "can212-*",
    ),
    Sample("made-can.pcapng", "two polls of a 16S pack on CAN", {"frame": 50}, lambda: [_poll("can", 2)]),
    Sample(
        "made-ble.pcapng",
        "the same through a Bluetooth dongle: connection, discovery, values of 20 bytes",
        {"frame": 50},
        lambda: [_poll("ble", 2)],
    ),
    Sample(
        "made-tcp.pcapng",
        "the same through a serial server, port 8899",
        {"frame": 50},
        lambda: [_poll("tcp", 2)],
    ),
    Sample(
        "made-all-wires.pcapng",
        "one poll on four wires at once, each an interface of one file",
        {"frame": 100},
        lambda: [_poll(wire, 1) for wire in WIRES],
    ),
)


def write(sample: Sample, folder: Path) -> None:
    """Write one sample's capture, packets of all interfaces in order of time."""
    with PcapngWriter(open_output(folder / sample.file), application="dalyshark samples") as writer:
        packets: list[tuple[int, int, WirePacket]] = []
        for interface, made in sample.made():
            number = writer.add_interface(interface)
            packets += [(packet.time_ns, number, packet) for packet in made]
        for time_ns, number, packet in sorted(packets, key=lambda one: one[:2]):
            writer.write_packet(EPOCH_NS + time_ns, packet.data, interface=number, flags=packet.flags)


def table() -> str:
    """Describe all samples, for people."""
    lines = [
        "# Samples of the other wires",
        "",
        "Made by `make_wire_samples.py`; do not edit. `real-can` holds bytes of a real pack (`../real-frames.jsonl`),",
        "with made times. Counts are what was put in, counted by hand. All of them, in both readings:",
        "",
        "    dalyshark check --tcp-ports 8899 pcap_samples/wires/*.pcapng",
        "",
        "| capture | what to look at | records | origin |",
        "|---|---|---|---|",
    ]
    for sample in SAMPLES:
        counts = ", ".join(f"{count} {kind}" for kind, count in sample.counts.items())
        lines.append(f"| `{sample.file}` | {sample.look} | {counts} | {sample.origin} |")
    return "\n".join(lines) + "\n"


def make(folder: Path) -> None:
    """Write all samples, their manifest and their table to a folder."""
    folder.mkdir(exist_ok=True)
    for sample in SAMPLES:
        write(sample, folder)
    manifest = [
        {"file": one.file, "look": one.look, "origin": one.origin, "counts": one.counts, "tcp_ports": "8899"}
        for one in SAMPLES
    ]
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
    (folder / "README.md").write_text(table(), encoding="utf-8")


if __name__ == "__main__":
    make(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "wires")
