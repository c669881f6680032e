# SPDX-License-Identifier: GPL-2.0-or-later
"""What the commands that read a file cost: each a program of its own, from start to end, tshark's share included.

    tshark -T fields    the peer: the file to text, our dissector, five fields
    plain decoder       the peer within: the file to records with all fields (dalycapture and dalyref), nothing written

``import`` reads the same frames from a text log, a frame in hex digits a line. Where more than one program runs, as
with check, the memory is that of the largest.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from bench import poll_cycle
from bench.bulk import FIELDS
from bench.child import Cost, wait
from bench.table import Result
from dalytools.problem import Problem
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from bench.options import Options

PART = 50_000
_PLAIN = (
    "import sys; from dalycapture.reader import read_capture; from dalyref.decoder import decode; "
    "[None for _ in decode(read_capture(sys.argv[1]))]"
)
_PROGRAM = str(Path(sys.executable).with_name("dalyshark"))


def _write_log(path: Path, count: int) -> None:
    """Write the frames as a hex dump with times of day, as terminals do."""
    with path.open("w", encoding="ascii") as log:
        for sent in poll_cycle.frames(count):
            seconds, ns = divmod(sent.time_ns, 10**9)
            hour, rest = divmod(seconds % 86400, 3600)
            log.write(f"{hour:02d}:{rest // 60:02d}:{rest % 60:02d}.{ns // 10**6:03d} {sent.data.hex(' ')}\n")


def _python(*words: str) -> Callable[[], subprocess.Popen[bytes]]:
    return lambda: subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _ways(tshark: Tshark, path: Path, log: Path, folder: Path) -> dict[str, Callable[[], subprocess.Popen[bytes]]]:
    told = ["-r", str(path), "-T", "fields", *(word for field in FIELDS for word in ("-e", field))]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def ours(*words: str) -> Callable[[], subprocess.Popen[bytes]]:
        return _python(_PROGRAM, *words)

    return {
        "tshark -T fields": lambda: tshark.start(told, **quiet),
        "plain decoder": _python(sys.executable, "-c", _PLAIN, str(path)),
        "decode --format jsonl": ours("decode", "--format", "jsonl", str(path), "-o", str(folder / "x.jsonl")),
        "decode --format csv": ours("decode", "--format", "csv", str(path), "-o", str(folder / "x.csv")),
        "decode --format parquet": ours("decode", "--format", "parquet", str(path), "-o", str(folder / "x.parquet")),
        "decode --format parquet, two --fields": ours(
            *("decode", "--format", "parquet", "--fields", "daly.pack.voltage,daly.soc"),
            *(str(path), "-o", str(folder / "y.parquet")),
        ),
        "survey": ours("survey", str(path)),
        "report": ours("report", str(path), "-o", str(folder / "x.html")),
        "import": ours("import", str(log), "-w", str(folder / "x.pcapng")),
        "check --no-dissector": ours("check", "--no-dissector", str(path)),
        "check": ours("check", str(path)),
    }


def _s(costs: Sequence[Cost]) -> float:
    return median(cost.user_s + cost.system_s for cost in costs)


def measure(options: Options) -> list[Result]:
    """Measure all, in turn; CPU time, user and system."""
    count = min(PART, options.frames)
    result = Result(
        f"Commands: {count} records of a poll cycle, each command a program of its own",
        ("command", "records/s", "us a record", "it / tshark", "memory, MiB"),
        note="CPU time, user and system, from start to end.",
    )
    costs: dict[str, list[Cost]] = {}
    with Tshark() as tshark, tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        path, log = folder / "part.pcapng", folder / "part.log"
        poll_cycle.write(path, count)
        path.chmod(0o644)
        _write_log(log, count)
        ways = _ways(tshark, path, log, folder)
        for _ in range(options.repeat):
            for way, start in ways.items():
                cost = wait(start())
                if cost.status:
                    raise Problem(f"{way} failed")
                costs.setdefault(way, []).append(cost)
    peer = _s(costs["tshark -T fields"])
    for way, each in costs.items():
        taken = _s(each)
        memory = median(cost.peak_mib for cost in each)
        row = (way, f"{count / taken:.0f}", f"{taken / count * 1e6:.1f}", f"{taken / peer:.2f}", f"{memory:.0f}")
        result.rows.append(row)
    return [result]
