# SPDX-License-Identifier: GPL-2.0-or-later
"""``make soak``: a million records, good and damaged, through both readings; none may differ.

Half of them a bus as it could be (the simulator, with damage), half of them trouble (tests/traffic.py), in captures of
50,000 packets each. In every Wireshark there is: this machine's own, and those that ``make matrix`` fetched.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from tests.traffic import DESCRIPTIONS, EPOCH_NS, Made, Traffic

from bench import wiresharks
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.comparison import compare
from dalytools.simulator.bus import traffic
from dalytools.simulator.scenario import Board, Damage, Host, Pack, Scenario

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.tshark import Tshark

PACKETS_A_FILE = 50_000


def likely_bus(seed: int) -> Iterator[Made]:
    """A bus with three boards, damaged here and there, a packet a frame."""
    scenario = Scenario(
        boards=(Board(1, pack=Pack(cells=16)), Board(2, pack=Pack(cells=14, sensors=8)), Board(3, pack=Pack(cells=48))),
        host=Host(),
        damage=Damage(drop=0.0005, flip=0.0005, insert=0.0005, cut=0.002),
        seed=seed,
    )
    for sent in traffic(scenario):
        yield Made(0, 0, EPOCH_NS + sent.time_ns, sent.data)


def trouble(seed: int) -> Iterator[Made]:
    """Return traffic near every rule's borders (tests/traffic.py)."""
    return Traffic(seed).packets()


def write(path: Path, packets: Iterator[Made]) -> None:
    """Write packets to a pcapng file with the interfaces they name."""
    with open_writer(path) as writer:
        for description in DESCRIPTIONS:
            writer.add_interface(Interface(name="made", description=description))
        for packet in packets:
            writer.write_packet(packet.time_ns, packet.data, interface=packet.interface, flags=packet.direction)


def soak(tshark: Tshark, args: argparse.Namespace) -> int:
    """Compare file after file until there are enough records. Return how many differences there were."""
    records = found = packets = 0
    kinds: dict[str, int] = {}
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="dalyshark-soak-") as folder:
        for seed in itertools.count(args.seed):
            if records >= args.records:
                break
            make = trouble if seed % 2 else likely_bus
            path = Path(folder) / f"{make.__name__}-{seed}.pcapng"
            write(path, itertools.islice(make(seed), min(PACKETS_A_FILE, max(1000, args.records - records))))
            result = compare(tshark, path)
            records += result.records
            packets += result.packets
            found += result.found
            for kind, count in result.kinds.items():
                kinds[kind] = kinds.get(kind, 0) + count
            print(f"{path.name}: {result.records} records, {result.found} differences", flush=True)
            for difference in result.differences[:10]:
                print(f"  {difference}")
            if result.found and args.keep:
                args.keep.mkdir(parents=True, exist_ok=True)
                (args.keep / path.name).write_bytes(path.read_bytes())
            path.unlink()
    told = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    print(
        f"tshark {tshark.version}: {records} records ({told}) in {packets} packets, "
        f"{time.monotonic() - started:.0f} s: {found} differences",
        flush=True,
    )
    return found


def main() -> int:
    """Soak in every Wireshark there is. Return 1 when anything differed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=1_000_000, help="records a Wireshark (%(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="keep captures that differ in this folder")
    args = parser.parse_args()
    return 1 if sum(soak(tshark, args) for tshark in wiresharks.each()) else 0


if __name__ == "__main__":
    sys.exit(main())
