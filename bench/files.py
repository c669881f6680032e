# SPDX-License-Identifier: GPL-2.0-or-later
"""Our pcapng writer and reader against scapy's and python-pcapng's, on the same packets.

Ours hands every block to the system as soon as it is made (a kill loses nothing); the others fill a buffer first.
Time stamps: ours ns, scapy us (all it can write), python-pcapng us.
"""

from __future__ import annotations

import importlib
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench import poll_cycle
from bench.in_turn import in_turn
from bench.table import Result
from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalycapture.reader import read_capture
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.options import Options
    from dalytools.simulator.sent import Sent

PACKETS = 50_000
OURS, SCAPY, PYTHON_PCAPNG, FLOOR = "ours", "scapy", "python-pcapng", "os.write alone"


def _write_ours(path: Path, packets: list[Sent]) -> None:
    with open_writer(path) as writer:
        writer.add_interface(tap("made"))
        for packet in packets:
            writer.write_packet(packet.time_ns, packet.data)


def _write_floor(path: Path, packets: list[Sent]) -> None:
    """Write as many blocks of the same size, ready made: what the system takes for it."""
    block = bytes(48)
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for _ in packets:
        os.write(fd, block)
    os.close(fd)


def _write_scapy(path: Path, packets: list[Sent]) -> None:
    scapy: Any = importlib.import_module("scapy.utils")
    writer = scapy.RawPcapNgWriter(str(path))
    writer.linktype = 147
    writer.write_header(b"")
    for packet in packets:
        writer.write_packet(packet.data, sec=packet.time_ns / 1e9)
    writer.close()


def _write_python_pcapng(path: Path, packets: list[Sent]) -> None:
    blocks: Any = importlib.import_module("pcapng.blocks")
    pcapng: Any = importlib.import_module("pcapng")
    section = blocks.SectionHeader(options={})
    interface = section.new_member(blocks.InterfaceDescription, link_type=147, options={"if_description": "made"})
    with path.open("wb") as file:
        writer = pcapng.FileWriter(file, section)
        for packet in packets:
            block = section.new_member(blocks.EnhancedPacket, interface_id=interface.interface_id)
            block.timestamp = packet.time_ns / 1e9
            block.packet_data = packet.data
            writer.write_block(block)


def _read_ours(path: Path) -> list[bytes]:
    return [packet.data for packet in read_capture(path)]


def _read_scapy(path: Path) -> list[bytes]:
    scapy: Any = importlib.import_module("scapy.utils")
    reader = scapy.RawPcapNgReader(str(path))
    data = [packet[0] for packet in reader]
    reader.close()
    return data


def _read_python_pcapng(path: Path) -> list[bytes]:
    blocks: Any = importlib.import_module("pcapng.blocks")
    pcapng: Any = importlib.import_module("pcapng")
    with path.open("rb") as file:
        return [block.packet_data for block in pcapng.FileScanner(file) if isinstance(block, blocks.EnhancedPacket)]


WRITERS: dict[str, Callable[[Path, list[Sent]], None]] = {
    OURS: _write_ours,
    SCAPY: _write_scapy,
    PYTHON_PCAPNG: _write_python_pcapng,
    FLOOR: _write_floor,
}
READERS: dict[str, Callable[[Path], list[bytes]]] = {
    OURS: _read_ours,
    SCAPY: _read_scapy,
    PYTHON_PCAPNG: _read_python_pcapng,
}


def measure(options: Options) -> list[Result]:
    """Measure writing, then reading our file. First all must agree on what is in the files."""
    packets = list(poll_cycle.frames(PACKETS))
    columns = ("program", "packets/s", "us a packet", "it / ours")
    writing = Result(
        f"Files: {PACKETS} packets of 13 bytes written as pcapng", columns, note="CPU time, user and system."
    )
    reading = Result(f"Files: {PACKETS} packets read from pcapng", columns)
    with tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as folder:
        paths = {name: Path(folder) / f"{name}.pcapng" for name in WRITERS}
        _prove(paths, packets)
        cost = in_turn(
            {name: lambda write=write, name=name: write(paths[name], packets) for name, write in WRITERS.items()},
            options.repeat,
        )
        _fill(writing, cost)
        cost = in_turn({name: lambda read=read: read(paths[OURS]) for name, read in READERS.items()}, options.repeat)
        _fill(reading, cost)
    return [writing, reading]


def _prove(paths: dict[str, Path], packets: list[Sent]) -> None:
    """See to it that all write and read the same packets."""
    some = packets[:100]
    for name in READERS:
        WRITERS[name](paths[name], some)
        for reader, read in READERS.items():
            if read(paths[name]) != [packet.data for packet in some]:
                message = f"{reader} does not read what {name} wrote"
                raise Problem(message)
    _write_ours(paths[OURS], packets)


def _fill(result: Result, cost: dict[str, float]) -> None:
    for name, seconds in cost.items():
        each = seconds / PACKETS
        result.rows.append((name, f"{1 / each:.0f}", f"{each * 1e6:.2f}", f"{seconds / cost[OURS]:.2f}"))
