# SPDX-License-Identifier: GPL-2.0-or-later
"""``make fuzz``: a million packets of mutated samples through the dissector, in every Wireshark that is there.

    mutations    bits flipped, bytes cut, two samples spliced, lengths changed, packets snapped short, random bytes
    carriers     USER0 packets; the same in TCP segments of a serial server; CAN and Bluetooth (tests/traffic_wires.py)

No Lua error, no abort, no hang may come of it. The tsharks: this machine's own, and those that ``make matrix`` fetched.
"""

from __future__ import annotations

import argparse
import itertools
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from tests import traffic_wires

from bench import wiresharks
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalytools.tshark import lua_complaint

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.tshark import Tshark

ROOT = Path(__file__).resolve().parents[1]
SAMPLES = sorted(ROOT.joinpath("pcap_samples").glob("*.pcap*"))
PACKETS_A_FILE = 50_000
LONGEST_S = 600
EPOCH_NS = 1_700_000_000_000_000_000
LINK_TYPES = {"user0": 147, "tcp": 101, "can": 227, "ble": 201}
TURNS = ("user0", "can", "user0", "user0", "tcp", "ble", "user0")
WIRE_PACKETS = 1000
SHORTEST = 8  # bytes of a CAN or HCI packet that Wireshark does not refuse with the whole file

WAYS = (("-T", "fields"), ("-2", "-T", "fields"), ("-V",), ())
"""How a file is looked at, in turn: all fields, two passes, the whole tree as text, the packet list."""


def corpus() -> list[bytes]:
    """All packets of all samples."""
    return [packet.data for sample in SAMPLES for packet in read_capture(sample) if packet.data]


def mutate(r: random.Random, known: list[bytes]) -> bytes:
    """One packet that goes looking for trouble."""
    data = bytearray(r.choice(known))
    match r.randrange(8):
        case 0:
            for _ in range(r.choice((1, 2, 8))):
                data[r.randrange(len(data))] ^= 1 << r.randrange(8)
        case 1:
            del data[r.randrange(len(data)) :]
        case 2:
            other = r.choice(known)
            data = data[: r.randrange(len(data) + 1)] + other[r.randrange(len(other)) :]
        case 3:
            data = bytearray(b"".join(r.choice(known) for _ in range(r.choice((2, 3, 20)))))
        case 4:
            if len(data) > 3:
                data[3] = r.randrange(256)
        case 5:
            data = bytearray(r.randbytes(r.choice((0, 1, 4, 13, 60, 300))))
        case 6:
            if len(data) == 13:  # a good frame of any address, ID and data
                data[1:12] = bytes((r.randrange(256), r.randrange(256), 8)) + r.randbytes(8)
                data[12] = sum(data[:12]) & 0xFF
        case _:
            pass
    return bytes(data)


def tcp(r: random.Random, payload: bytes, sequence: int) -> bytes:
    """Lay a payload into an IPv4 packet with a TCP segment from or to port 4001; checksums are left out."""
    ports = (4001, 51234) if r.random() < 0.7 else (51234, 4001)
    head = b"".join(port.to_bytes(2, "big") for port in ports)
    segment = head + sequence.to_bytes(4, "big") + bytes(4) + bytes((0x50, 0x18, 0x20, 0, 0, 0, 0, 0)) + payload
    total = 20 + len(segment)
    addresses = bytes((10, 0, 0, 1, 10, 0, 0, 2)) if ports[0] == 4001 else bytes((10, 0, 0, 2, 10, 0, 0, 1))
    return bytes((0x45, 0)) + total.to_bytes(2, "big") + bytes((0, 1, 0, 0, 64, 6, 0, 0)) + addresses + segment


def packets(seed: int, count: int, carrier: str) -> Iterator[bytes]:
    """Yield mutated packets; the same for the same seed."""
    r = random.Random(seed)
    made = {"can": traffic_wires.can, "ble": traffic_wires.ble}.get(carrier)
    known = [packet.data for packet in itertools.islice(made(seed), WIRE_PACKETS)] if made else corpus()
    sequence = 1
    for _ in range(count):
        data = mutate(r, known)
        if made and r.random() < 0.5:  # good ones between, without which nothing is known of a bus
            yield r.choice(known)
            continue
        if carrier != "tcp":
            yield data.ljust(SHORTEST, b"\0") if made else data
            continue
        yield tcp(r, data, sequence)
        if r.random() < 0.95:  # else: sent again, or lost
            sequence = (sequence + len(data) * r.choice((1, 1, 1, 1, 2))) & 0xFFFFFFFF


def write(path: Path, seed: int, count: int, carrier: str = "user0") -> None:
    """Write a file of mutated packets, at times near the rules' limits."""
    r = random.Random(seed + 1)
    now = EPOCH_NS
    with open_writer(path) as writer:
        writer.add_interface(Interface("fuzz", "dalyshark bus=fuzz", LINK_TYPES[carrier]))
        for data in packets(seed, count, carrier):
            now += r.choice((0, 1, 14, 40, 260, 600, 1100)) * 1_000_000
            writer.write_packet(now, data, flags=r.choice((0, 0, 0, 1, 2)))


def look(tshark: Tshark, path: Path, way: tuple[str, ...]) -> str:
    """Let tshark read a file; return what was wrong, empty: nothing."""
    words = [*way, "-o", "daly.tcp_ports:4001", "-r", str(path)]
    if "fields" in way:
        words += ["-e", "_ws.lua.error", "-e", "daly.kind"]
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as messages:
        child = tshark.start(words, stdin=subprocess.DEVNULL, stdout=out.fileno(), stderr=messages.fileno())
        try:
            status = child.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
            return f"hangs for more than {LONGEST_S} s"
        for stream in (out, messages):
            stream.seek(0)
        complaint = lua_complaint(messages.read(100_000).decode(errors="replace"))
        if status or complaint:
            return complaint or f"exit status {status}"
        for line in out:
            if b"Lua Error" in line or ("fields" in way and not line.startswith(b"\t")):
                return line.decode(errors="replace").strip()[:300]
    return ""


def fuzz(tshark: Tshark, count: int, seed: int) -> list[str]:
    """Read `count` mutated packets. Return what was wrong."""
    wrong: list[str] = []
    done = turn = 0
    while done < count:
        size = min(PACKETS_A_FILE, count - done)
        path = tshark.home / "fuzz.pcapng"
        carrier = TURNS[turn % len(TURNS)]
        write(path, seed + turn, size, carrier)
        path.chmod(0o644)
        if turn % len(TURNS) == 3:
            path = snapped(tshark, path)
        way = WAYS[turn % len(WAYS)]
        said = look(tshark, path, way)
        if said:
            wrong.append(f"seed {seed + turn}, {' '.join(way) or 'packet list'}: {said}")
        done += size
        turn += 1
    return wrong


def snapped(tshark: Tshark, path: Path) -> Path:
    """Cut every packet of a file at 10 bytes, as editcap -s does: what was captured is less than what there was."""
    short = tshark.home / "snapped.pcap"
    header = bytes.fromhex("d4c3b2a1020004000000000000000000ffff000093000000")
    with short.open("wb") as out:
        out.write(header)
        for packet in read_capture(path):
            seconds, rest = divmod(packet.time_ns, 1_000_000_000)
            piece = packet.data[:10]
            for value in (seconds, rest // 1000, len(piece), len(packet.data)):
                out.write(value.to_bytes(4, "little"))
            out.write(piece)
    short.chmod(0o644)
    return short


def main() -> int:
    """Fuzz every member. Return 1 when anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--packets", type=int, default=1_000_000, help="packets a Wireshark (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="the same seed gives the same packets (%(default)s)")
    options = parser.parse_args()
    found = 0
    for tshark in wiresharks.each():
        began = time.monotonic()
        wrong = fuzz(tshark, options.packets, options.seed)
        seconds = time.monotonic() - began
        sys.stdout.write(
            f"tshark {tshark.version}: {options.packets} packets, {seconds:.0f} s, {len(wrong)} files with errors\n"
        )
        for line in wrong:
            sys.stdout.write(f"  {line}\n")
        found += len(wrong)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
