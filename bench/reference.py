# SPDX-License-Identifier: GPL-2.0-or-later
"""The reference decoder against the PyPI package dalybms: the same replies, from eight data bytes to values.

dalybms's functions take the data bytes of a reply in place of asking for one (0x95 and 0x96: a list of frames). They
leave out what they do not need (reserved bytes, gather voltage, life, the balance mask, faults that are not set); ours
gives every field. Then what a whole capture costs: bytes to records, and packets to decoded records.
"""

from __future__ import annotations

import importlib
import logging
from typing import TYPE_CHECKING, Any

from bench import poll_cycle
from bench.in_turn import in_turn
from bench.table import Goal, Result
from dalyref import payload
from dalyref.a5 import build
from dalyref.decoder import decode
from dalyref.packet import Packet
from dalyref.records import Splitter

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.options import Options

CYCLES = 400
FRAMES = 100_000

#     data ID  dalybms's function
PEER = (
    (0x90, "get_soc"),
    (0x91, "get_cell_voltage_range"),
    (0x92, "get_temperature_range"),
    (0x93, "get_mosfet_status"),
    (0x94, "get_status"),
    (0x95, "get_cell_voltages"),
    (0x96, "get_temperatures"),
    (0x97, "get_balancing_status"),
    (0x98, "get_errors"),
)
IN_FRAMES = frozenset((0x95, 0x96))
FAULTS = bytes(
    (0x05, 0x00, 0x20, 0x01, 0x00, 0x04, 0x00, 0x00)
)  # five bits that the paper names; dalybms fails on a fault code


def _replies(cycles: int) -> dict[int, list[list[bytes]]]:
    """Collect by data ID the data bytes of each reply of a poll cycle: a list of frames."""
    found: dict[int, list[list[bytes]]] = {data_id: [] for data_id, _ in PEER}
    for sent in poll_cycle.frames(25 * cycles):
        data = sent.data
        if data[2] in found:
            if data[1] >= 0x20:
                found[data[2]].append([])
            else:
                found[data[2]][-1].append(data[4:12])
    return found


def _ours(data_id: int, replies: list[list[bytes]]) -> Callable[[], None]:
    def parse() -> None:
        decode_reply = payload.decode
        for reply in replies:
            for data in reply:
                decode_reply(data_id, data)

    return parse


def _theirs(function: Callable[[Any], object], data_id: int, replies: list[list[bytes]]) -> Callable[[], None]:
    arguments = replies if data_id in IN_FRAMES else [reply[0] for reply in replies]

    def parse() -> None:
        for argument in arguments:
            function(argument)

    return parse


def _against_dalybms(options: Options) -> Result:
    dalybms: Any = importlib.import_module("dalybms")
    silent = logging.Logger("dalybms", logging.CRITICAL)
    client = dalybms.DalyBMS(logger=silent)
    replies = _replies(CYCLES)
    client.get_status(replies[0x94][0][0])
    result = Result(
        f"Reference decoder: replies of {CYCLES} poll cycles, ours and dalybms",
        ("reply", "frames", "dalybms, us", "ours, us", "dalybms / ours"),
        note="us of CPU time a reply (all its frames).",
    )
    rows = [(f"0x{data_id:02X}", data_id, name, replies[data_id]) for data_id, name in PEER]
    rows.append(("0x98, five faults", 0x98, "get_errors", [[FAULTS]] * CYCLES))
    whole = {"theirs": 0.0, "ours": 0.0}
    for label, data_id, name, these in rows:
        ways = {"theirs": _theirs(getattr(client, name), data_id, these), "ours": _ours(data_id, these)}
        cost = in_turn(ways, 4 * options.repeat)
        if these is replies[data_id]:
            whole = {side: whole[side] + cost[side] for side in whole}
        result.rows.append(_row(label, len(these[0]), cost, len(these)))
    result.rows.append(_row("whole cycle", sum(len(these[0]) for these in replies.values()), whole, CYCLES))
    ratio = whole["theirs"] / whole["ours"]
    result.goals.append(Goal("whole cycle, speed of ours / dalybms", ratio, 1.0, at_least=True))
    return result


def _row(label: str, frames: int, cost: dict[str, float], count: int) -> tuple[str, ...]:
    theirs, ours = cost["theirs"] / count * 1e6, cost["ours"] / count * 1e6
    return (label, str(frames), f"{theirs:.2f}", f"{ours:.2f}", f"{theirs / ours:.2f}")


def _whole_captures(options: Options) -> Result:
    packets = [
        Packet(number, sent.time_ns, sent.data) for number, sent in enumerate(poll_cycle.frames(FRAMES), start=1)
    ]
    stream = b"".join(packet.data for packet in packets)
    pieces = [stream[at : at + 64] for at in range(0, len(stream), 64)]
    damaged = [_damaged(number, packet.data) for number, packet in enumerate(packets)]

    def split(parts: list[bytes]) -> Callable[[], None]:
        def run() -> None:
            splitter = Splitter()
            for part in parts:
                splitter.feed(part)
            splitter.flush()

        return run

    def whole() -> None:
        for _ in decode(packets):
            pass

    ways = {
        "splitter, a frame a time": split([packet.data for packet in packets]),
        "splitter, 64 bytes a time": split(pieces),
        "splitter, one frame in 50 damaged": split(damaged),
        "whole decoder": whole,
    }
    cost = in_turn(ways, options.repeat)
    result = Result(f"Reference decoder: {FRAMES} records of a poll cycle", ("what", "records/s", "us a record"))
    for name, seconds in cost.items():
        result.rows.append((name, f"{FRAMES / seconds:.0f}", f"{seconds / FRAMES * 1e6:.2f}"))
    return result


def _damaged(number: int, data: bytes) -> bytes:
    if number % 50:
        return data
    return (data[:5], data[:4] + b"\xa5" + data[4:], build(1, 0xA5)[:-1] + b"\x00")[number // 50 % 3]


def measure(options: Options) -> list[Result]:
    """Measure both."""
    return [_against_dalybms(options), _whole_captures(options)]
