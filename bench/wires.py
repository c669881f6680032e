# SPDX-License-Identifier: GPL-2.0-or-later
"""tshark with our dissector on CAN and Modbus against one of its own (C) for the same wire, on the same capture.

    CAN       a poll cycle on SocketCAN      J1939, by Decode As: the other protocol of 29-bit identifiers
    Modbus    62 registers of D2, polled     Modbus RTU, by the user's DLT table

The packet list, without a tree. User CPU time of the whole program, its start included, median; the sides take turns.
"""

from __future__ import annotations

import itertools
import subprocess
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bench import poll_cycle
from bench.child import wait
from bench.modbus_crc import with_crc
from bench.table import Goal, Result, spread
from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalytools.problem import Problem
from dalytools.simulator.scenario import Scenario
from dalytools.simulator.wire_can import CanWire
from dalytools.tshark import Tshark, lua_complaint

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bench.options import Options

MOST = 4.0  # as a multiple of the peer
CELLS, REGISTERS = 16, 62

#        wire      peer       what makes tshark use it
WIRES = (
    ("CAN", "j1939", ("-d", "can.subdissector,j1939")),
    ("Modbus", "mbrtu", ("-o", 'uat:user_dlts:"User 0 (DLT=147)","mbrtu","0","","0",""')),
)


def write_can(path: Path, count: int) -> None:
    """Write so many frames of the poll cycle, as can0 shows them."""
    wire = CanWire(Scenario())
    with open_writer(path) as writer:
        writer.add_interface(wire.interface)
        for sent in poll_cycle.frames(count):
            for packet in wire.feed(sent):
                writer.write_packet(packet.time_ns, packet.data)


def _reply(number: int) -> bytes:
    """Cells, their count (31) and sum (28), current (29), SOC (2A), sensors (32); values move with the number."""
    values = [0] * REGISTERS
    values[:CELLS] = [3290 + (number + cell) % 9 for cell in range(CELLS)]
    values[0x28:0x2B] = [round(sum(values[:CELLS]) / 100), 30000 + number, 600]
    values[0x31:0x33] = [CELLS, 2]
    values[0x20:0x22] = [60, 61]
    return with_crc(bytes((0xD2, 3, 2 * REGISTERS)) + b"".join(value.to_bytes(2) for value in values))


def write_modbus(path: Path, count: int) -> None:
    """Write so many frames, requests and replies in turn."""
    asked = with_crc(bytes.fromhex("d2030000") + REGISTERS.to_bytes(2))
    replies = [_reply(number) for number in range(64)]
    with open_writer(path) as writer:
        writer.add_interface(tap("made"))
        for number in range(count):
            data = replies[number // 2 % len(replies)] if number % 2 else asked
            writer.write_packet(poll_cycle.EPOCH_NS + number * 180_000_000, data)


def _user_s(child: subprocess.Popen[bytes], messages: Path) -> float:
    cost = wait(child)
    said = messages.read_text(errors="replace")
    if cost.status or lua_complaint(said):
        raise Problem(f"tshark failed: {said[:200]}")
    return cost.user_s


def _protocols(tshark: Tshark, path: Path, arguments: Sequence[str], ours: bool) -> str:
    words = ["-c", "2", *arguments, "-r", str(path), "-T", "fields", "-e", "frame.protocols"]
    start = tshark.start if ours else tshark.start_bare
    with start(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        return child.communicate()[0].decode()


def measure(options: Options) -> list[Result]:
    """Measure the packet list of both wires."""
    result = Result("", ("wire", "peer", "peer, s", "ours, s", "ratio", "us a frame"))
    with Tshark() as tshark, tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        result.title = f"Dissector on other wires: {options.frames} frames, tshark {tshark.version}"
        for (wire, peer, choice), write in zip(WIRES, (write_can, write_modbus), strict=True):
            path = folder / f"{wire}.pcapng"
            write(path, options.frames)
            path.chmod(0o644)
            sides = {"daly": (), peer: choice}
            for protocol, words in sides.items():
                seen = _protocols(tshark, path, words, protocol == "daly").split()
                if not seen or not all(protocol in each.split(":") for each in seen):
                    raise Problem(f"tshark does not read these frames as {protocol}: {seen}")
            taken: dict[str, list[float]] = {side: [] for side in sides}
            for _, side in itertools.product(range(options.repeat), (peer, "daly")):
                said = folder / "messages"
                with said.open("wb") as messages:
                    start = tshark.start if side == "daly" else tshark.start_bare
                    child = start(
                        ["-r", str(path), *sides[side]],
                        stdin=subprocess.DEVNULL,
                        stdout=subprocess.DEVNULL,
                        stderr=messages.fileno(),
                    )
                    taken[side].append(_user_s(child, said))
            ratio = median(taken["daly"]) / median(taken[peer])
            each = f"{median(taken['daly']) / options.frames * 1e6:.2f}"
            result.rows.append((wire, peer, spread(taken[peer]), spread(taken["daly"]), f"{ratio:.2f}", each))
            result.goals.append(Goal(f"{wire}, ours / {peer}", ratio, MOST))
    return [result]
