# SPDX-License-Identifier: GPL-2.0-or-later
"""``make soak``: a million records, good and damaged, through both readings; none may differ.

In turn a bus as it could be (the simulator, with damage), trouble near every rule's borders (tests/traffic.py), and
that on CAN, Bluetooth and TCP (tests/traffic_wires.py), in captures of 50,000 packets each.

In every Wireshark there is: this machine's own, and those that ``make matrix`` fetched.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from tests import traffic_wires
from tests.traffic import DESCRIPTIONS, EPOCH_NS, Made, Traffic

from bench import wiresharks
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.comparison import compare
from dalytools.simulator.bus import traffic
from dalytools.simulator.scenario import Board, Damage, Habits, Host, Pack, Scenario
from dalytools.wires.choice import Choice, numbers

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dalytools.tshark import Tshark

PACKETS_A_FILE = 50_000
USER0 = 147
WIRES = Choice(tcp_ports=numbers(str(traffic_wires.PORT)), ble_handles=numbers(str(traffic_wires.CHOSEN)))


def likely_bus(seed: int) -> Iterator[Made]:
    """A bus with three boards, damaged here and there, a packet a frame."""
    scenario = Scenario(
        boards=(
            Board(1, pack=Pack(cells=16)),
            Board(2, pack=Pack(cells=14, sensors=8), habits=Habits(frame_base=0)),
            Board(3, pack=Pack(cells=48)),
        ),
        host=Host(),
        damage=Damage(drop=0.0005, flip=0.0005, insert=0.0005, cut=0.002),
        seed=seed,
    )
    for sent in traffic(scenario):
        yield Made(0, 0, EPOCH_NS + sent.time_ns, sent.data)


def trouble(seed: int) -> Iterator[Made]:
    """Return traffic near every rule's borders (tests/traffic.py)."""
    return Traffic(seed).packets()


def on_wire(link_type: int, packets: Iterator[traffic_wires.OnWire]) -> tuple[int, Iterator[Made]]:
    """Return packets of a wire that is captured on one interface."""
    return link_type, (Made(0, 0, packet.time_ns, packet.data) for packet in packets)


# Where each kind of capture comes from: its link type, and its packets by seed.
KINDS: dict[str, Callable[[int], tuple[int, Iterator[Made]]]] = {
    "likely": lambda seed: (USER0, likely_bus(seed)),
    "trouble": lambda seed: (USER0, trouble(seed)),
    "can": lambda seed: on_wire(traffic_wires.SOCKETCAN, traffic_wires.can(seed)),
    "again": lambda seed: (USER0, trouble(seed)),
    "ble": lambda seed: on_wire(traffic_wires.HCI_WITH_DIRECTION, traffic_wires.ble(seed)),
    "tcp": lambda seed: on_wire(traffic_wires.RAW_IP, traffic_wires.tcp(seed)),
    "lossy-tcp": lambda seed: on_wire(traffic_wires.RAW_IP, traffic_wires.lossy_tcp(seed)),
    "lossy-tcp-again": lambda seed: on_wire(traffic_wires.RAW_IP, traffic_wires.lossy_tcp_again(seed)),
}


def write(path: Path, packets: Iterator[Made], link_type: int = USER0) -> None:
    """Write packets to a pcapng file with the interfaces they name."""
    with open_writer(path) as writer:
        for description in DESCRIPTIONS:
            writer.add_interface(Interface(name="made", description=description, link_type=link_type))
        for packet in packets:
            writer.write_packet(packet.time_ns, packet.data, interface=packet.interface, flags=packet.direction)


def soak(tshark: Tshark, args: argparse.Namespace) -> int:
    """Compare file after file until there are enough records. Return how many differences there were."""
    records = found = packets = 0
    kinds: dict[str, int] = {}
    wires = tuple(args.only or KINDS)
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="dalyshark-soak-") as folder:
        for seed in itertools.count(args.seed):
            if records >= args.records:
                break
            turn: int = seed % len(wires)
            wire = wires[turn]
            link_type, made = KINDS[wire](seed)
            path = Path(folder) / f"{wire}-{seed}.pcapng"
            count = min(args.packets, max(1000, args.records - records))
            write(path, itertools.islice(made, count), link_type)
            result = compare(tshark, path, wires=WIRES)
            records += result.records
            packets += result.packets
            found += result.found
            for name, number in result.kinds.items():
                kinds[name] = kinds.get(name, 0) + number
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
    parser.add_argument("--packets", type=int, default=PACKETS_A_FILE, help="packets a capture (%(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=KINDS, help="kinds of captures (all)")
    parser.add_argument("--keep", type=Path, help="keep captures that differ in this folder")
    args = parser.parse_args()
    return 1 if sum(soak(tshark, args) for tshark in wiresharks.each()) else 0


if __name__ == "__main__":
    sys.exit(main())
