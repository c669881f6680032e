# SPDX-License-Identifier: GPL-2.0-or-later
"""tshark with our dissector against the same tshark with its own Modbus RTU dissector (C), on as many frames.

    ours     a poll cycle on USER0, 13 bytes a frame             the sniffer's file
    mbrtu    query 8 bytes, reply 13 bytes, in turn, on USER1    01 03 0000 0004 crc, 01 03 08 .. crc
    data     the poll cycle, on USER0, given to "data"           what reading and listing alone costs

User CPU time of the whole program, its start included, median; the sides take turns.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bench import poll_cycle
from bench.child import Cost, wait
from bench.modbus_crc import with_crc
from bench.table import Goal, Result, spread
from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.problem import Problem
from dalytools.tshark import Tshark, lua_complaint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from bench.options import Options

OURS, MBRTU, DATA = "ours", "mbrtu", "data"

FIELDS = {
    OURS: ("daly.data_id", "daly.board", "daly.pack.voltage", "daly.soc", "daly.cell.voltage"),
    MBRTU: ("mbrtu.unit_id", "modbus.func_code", "modbus.word_cnt", "modbus.regval_uint16", "mbrtu.crc16"),
    DATA: ("frame.number", "frame.len", "frame.protocols", "data.data", "data.len"),
}

#        what              arguments of tshark              most it may be, as a multiple of mbrtu
MODES = (
    ("packet list", (), 7.0),
    ("-T fields, 5 fields", ("-T", "fields"), 12.0),
    ("-2 -T fields, 5 fields", ("-2", "-T", "fields"), None),
)


def _modbus(count: int) -> Iterator[tuple[int, bytes]]:
    query = with_crc(bytes.fromhex("010300000004"))
    replies = [
        with_crc(b"\x01\x03\x08" + b"".join((3000 + n + k).to_bytes(2, "big") for k in range(4))) for n in range(256)
    ]
    for number in range(count):
        data = replies[number // 2 % 256] if number % 2 else query
        yield poll_cycle.EPOCH_NS + number * 38_000_000, data


def _write_modbus(path: Path, count: int) -> None:
    with open_writer(path) as writer:
        writer.add_interface(Interface(name="made", link_type=148))
        for time_ns, data in _modbus(count):
            writer.write_packet(time_ns, data)


class _Runs:
    """Starts tshark on the two captures."""

    def __init__(self, tshark: Tshark, folder: Path, frames: int) -> None:
        self._tshark = tshark
        daly, modbus = folder / "daly.pcapng", folder / "modbus.pcapng"
        poll_cycle.write(daly, frames)
        _write_modbus(modbus, frames)
        self._files = {OURS: daly, DATA: daly, MBRTU: modbus}
        for path in (daly, modbus):
            path.chmod(0o644)
        self._prove()

    def _start(self, side: str, arguments: Sequence[str], **streams: int) -> subprocess.Popen[bytes]:
        arguments = ["-r", str(self._files[side]), *arguments]
        if side == OURS:
            return self._tshark.start(arguments, stdin=subprocess.DEVNULL, **streams)
        user = {DATA: 0, MBRTU: 1}[side]
        entry = f'uat:user_dlts:"User {user} (DLT={147 + user})","{side}","0","","0",""'
        return self._tshark.start_bare(["-o", entry, *arguments], stdin=subprocess.DEVNULL, **streams)

    def _prove(self) -> None:
        """See to it that each side is read by the dissector it is named for."""
        for side, protocol in ((OURS, "daly"), (MBRTU, "mbrtu"), (DATA, "data")):
            arguments = ("-c", "2", "-T", "fields", "-e", "frame.protocols")
            with self._start(side, arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
                said, complaint = child.communicate()
            seen = said.decode().split()
            if len(seen) != 2 or not all(protocol in protocols.split(":") for protocols in seen):
                raise Problem(f"tshark does not read these frames as {protocol}: {seen} {complaint.decode()[:200]}")

    def cost(self, side: str, arguments: Sequence[str]) -> Cost:
        """Read the whole capture once."""
        with tempfile.TemporaryFile() as messages:
            cost = wait(self._start(side, arguments, stdout=subprocess.DEVNULL, stderr=messages.fileno()))
            messages.seek(0)
            said = messages.read(10_000).decode(errors="replace")
        complaint = lua_complaint(said)
        if cost.status or complaint:
            raise Problem(f"tshark failed on the {side} frames: {complaint or said}")
        return cost


def _arguments(mode: Sequence[str], side: str) -> list[str]:
    if "fields" not in mode:
        return list(mode)
    return [*mode, *(word for name in FIELDS[side] for word in ("-e", name))]


def measure(options: Options) -> list[Result]:
    """Measure the three modes on ``options.frames`` frames each."""
    result = Result(
        "", ("user CPU", "mbrtu, s", "ours, s", "ratio", "us a frame", "data, s", "memory, MiB", "above data")
    )
    with Tshark() as tshark, tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        runs = _Runs(tshark, folder, options.frames)
        result.title = f"Dissector: {options.frames} frames, tshark {tshark.version}"
        for what, mode, limit in MODES:
            costs: dict[str, list[Cost]] = {MBRTU: [], OURS: [], DATA: []}
            for turn in range(options.repeat):
                for side in (MBRTU, OURS, DATA) if turn == 0 else (MBRTU, OURS):
                    costs[side].append(runs.cost(side, _arguments(mode, side)))
            user = {side: [cost.user_s for cost in taken] for side, taken in costs.items()}
            ratio = median(user[OURS]) / median(user[MBRTU])
            peak = max(cost.peak_mib for cost in costs[OURS])
            result.rows.append(
                (
                    what,
                    spread(user[MBRTU]),
                    spread(user[OURS]),
                    f"{ratio:.2f}",
                    f"{median(user[OURS]) / options.frames * 1e6:.2f}",
                    spread(user[DATA]),
                    f"{peak:.0f}",
                    f"{peak - costs[DATA][0].peak_mib:.0f}",
                )
            )
            if limit is not None:
                result.goals.append(Goal(f"{what}, ours / mbrtu", ratio, limit))
    return [result]
