# SPDX-License-Identifier: GPL-2.0-or-later
"""From a capture file to values: the bulk reader beside our plain decoder, scapy, dalybms and tshark.

    bulk               the file to typed columns of all values (dalytools.bulk), ``frames`` of them
    plain decoder      the file to records with all fields (dalycapture and dalyref)
    scapy              reads the packets, and no more
    scapy + dalybms    the same, and each reply's data bytes through the parser of the PyPI package dalybms
    tshark -T fields   the file to text, our dissector, five fields; its start included
    the file's bytes   read, and no more

The slow ones read a part of it. First all are held to agree on what the pack's voltage was.
"""

from __future__ import annotations

import importlib
import logging
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from bench import poll_cycle
from bench.child import wait
from bench.in_turn import in_turn
from bench.table import Goal, Result
from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalytools.bulk.read import read
from dalytools.problem import Problem
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Callable

    from bench.options import Options

PART = 50_000
PACK = 0x90
FIELDS = ("daly.data_id", "daly.board", "daly.pack.voltage", "daly.soc", "daly.cell.voltage")
_MEMORY = "import sys; from dalytools.bulk.read import read; [None for _ in read(sys.argv[1])]"


def _bulk(path: Path) -> list[float]:
    """Decode everything; return the pack's voltages, V."""
    volts: list[float] = []
    for batch in read(path):
        if pack := batch.replies.get(PACK):
            volts += pack.columns["daly.pack.voltage"].values.tolist()
    return volts


def _plain(path: Path) -> list[float]:
    fields = (record.fields.get("daly.pack.voltage") for record in decode(read_capture(path)))
    return [volt for volt in fields if isinstance(volt, float)]


def _scapy(path: Path) -> list[bytes]:
    utils: Any = importlib.import_module("scapy.utils")
    reader = utils.RawPcapNgReader(str(path))
    data = [packet[0] for packet in reader]
    reader.close()
    return data


def _scapy_and_dalybms(path: Path) -> list[float]:
    """Give each reply to the function of dalybms that knows it; cells and temperatures are lists of frames there."""
    package: Any = importlib.import_module("dalybms")
    client = package.DalyBMS(logger=logging.Logger("dalybms", logging.CRITICAL))
    client.status = {"cells": 16, "temperature_sensors": 1}
    parsers = {
        0x90: client.get_soc,
        0x91: client.get_cell_voltage_range,
        0x92: client.get_temperature_range,
        0x93: client.get_mosfet_status,
        0x94: client.get_status,
        0x97: client.get_balancing_status,
        0x98: client.get_errors,
    }
    lists = {0x95: client.get_cell_voltages, 0x96: client.get_temperatures}
    volts: list[float] = []
    frames: list[bytes] = []
    of = 0
    for data in [*_scapy(path), b"\xa5\x40\x00"]:
        if data[1] >= 0x20:
            if frames:
                lists[of](frames)
                frames = []
            continue
        if data[2] in lists:
            of = data[2]
            frames.append(data[4:12])
        elif parser := parsers.get(data[2]):
            said = parser(data[4:12])
            if data[2] == PACK:
                volts.append(said["total_voltage"])
    return volts


def _bytes(path: Path) -> None:
    with path.open("rb") as file:
        while file.read(1 << 20):
            pass


def _prove(part: Path) -> None:
    """See to it that all read the same."""
    expected = _plain(part)
    for name, read_it in (("bulk", _bulk), ("scapy + dalybms", _scapy_and_dalybms)):
        if read_it(part) != expected:
            raise Problem(f"{name} reads other voltages than the plain decoder")


def _tshark_s(tshark: Tshark, path: Path) -> float:
    words = ["-r", str(path), "-T", "fields", *(word for field in FIELDS for word in ("-e", field))]
    child = tshark.start(words, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    cost = wait(child)
    if cost.status:
        raise Problem("tshark failed")
    return cost.user_s + cost.system_s


def measure(options: Options) -> list[Result]:
    """Measure all, in turn; CPU time, user and system."""
    result = Result(
        f"Bulk: {options.frames} records of a poll cycle, from pcapng to values ({PART} for the slow ones)",
        ("way", "records/s", "us a record", "it / bulk"),
    )
    with Tshark() as tshark, tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        whole, part = folder / "whole.pcapng", folder / "part.pcapng"
        poll_cycle.write(whole, options.frames)
        poll_cycle.write(part, min(PART, options.frames))
        part.chmod(0o644)
        _prove(part)
        quick: dict[str, Callable[[], object]] = {
            "bulk": lambda: [None for _ in read(whole)],
            "the file's bytes": lambda: _bytes(whole),
        }
        slow: dict[str, Callable[[], object]] = {
            "plain decoder": lambda: [None for _ in decode(read_capture(part))],
            "scapy": lambda: _scapy(part),
            "scapy + dalybms": lambda: _scapy_and_dalybms(part),
        }
        cost = {name: taken / options.frames for name, taken in in_turn(quick, options.repeat).items()}
        count = min(PART, options.frames)
        cost |= {name: taken / count for name, taken in in_turn(slow, options.repeat).items()}
        cost["tshark -T fields"] = median(_tshark_s(tshark, part) for _ in range(options.repeat)) / count
        peak = {path: wait(subprocess.Popen([sys.executable, "-c", _MEMORY, str(path)])) for path in (part, whole)}
    for name, each in cost.items():
        result.rows.append((name, f"{1 / each:.0f}", f"{each * 1e6:.3f}", f"{each / cost['bulk']:.2f}"))
    if any(child.status for child in peak.values()):
        raise Problem("the bulk reader failed in a program of its own")
    small, large = (child.peak_mib for child in peak.values())
    result.note = (
        f"CPU time. Memory of a program that reads in bulk: {small:.0f} MiB for {count} records, "
        f"{large:.0f} MiB for {options.frames}."
    )
    result.goals.append(Goal("bulk, million records/s", 1e-6 / cost["bulk"], 5, at_least=True))
    result.goals.append(Goal("plain decoder / bulk", cost["plain decoder"] / cost["bulk"], 20, at_least=True))
    return [result]
