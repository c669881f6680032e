# SPDX-License-Identifier: GPL-2.0-or-later
"""A fleet's data set, and what the queries of docs/fleet.md cost on it, beside a scan of a CSV and decoding again.

    python -m bench.fleet [--records 5000000] [--folder FOLDER]

Made with `dalyshark simulate` (fleet.toml) and `dalyshark decode --partition`: four sites, three days, two boards each.
What is in FOLDER already is not made again. DuckDB runs in one thread; counted is CPU time.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import duckdb

from bench import child
from bench.in_turn import in_turn
from bench.table import Result

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

ROOT = Path(__file__).parents[1]
SITES = ("harbour", "hill", "mill", "farm")
DAYS = ("2026-03-01", "2026-03-02", "2026-03-03")
RECORDS_A_SECOND = 17.7
"""Of fleet.toml on its bus."""
IN_CSV = (
    "site, board, day, time_UTC, kind, direction, data_id, response_time_s, pack_voltage_V, soc_percent, "
    "cells_spread_mV, cells_min_number, fault_raised"
)
"""What the queries need: a CSV of all columns would be slower by far."""


def queries() -> dict[str, str]:
    """Return the queries of docs/fleet.md, by heading."""
    page = (ROOT / "docs/fleet.md").read_text("utf-8")
    return dict(re.findall(r"^### ([^\n]*)\n+```sql\n(.*?)```", page, re.MULTILINE | re.DOTALL))


def make_captures(
    folder: Path, records: int, sites: Sequence[str] = SITES, days: Sequence[str] = DAYS
) -> Iterator[tuple[str, Path]]:
    """Make the captures that are not there yet; give (site, capture)."""
    scenario = (ROOT / "bench/fleet.toml").read_text("utf-8")
    seconds = records / RECORDS_A_SECOND / len(sites) / len(days)
    for seed, (site, day) in enumerate((site, day) for site in sites for day in days):
        path = folder / f"{site}-{day[-2:]}.pcapng"
        if not path.exists():
            text = folder / "scenario.toml"
            text.write_text(f"start = {day}T06:00:00Z\n{scenario}", encoding="utf-8")
            words = ("--duration", f"{seconds:.0f}", "--seed", str(seed), "-w", str(path))
            _run("simulate", str(text), *words)
        yield site, path


def make_data_set(folder: Path, captures: Sequence[tuple[str, Path]]) -> float:
    """Put the captures into FOLDER/fleet, if that is not there yet; return the CPU time, s."""
    place = folder / "fleet"
    if place.exists():
        return 0.0
    words = ("--format", "parquet", "--partition", "site,board,day", "-o", str(place))
    return sum(
        _run("decode", *(str(path) for of, path in captures if of == site), "--label", f"site={site}", *words)
        for site in SITES
    )


def connect(folder: Path) -> duckdb.DuckDBPyConnection:
    """Open the data set as `fleet`, and the same rows in a CSV as `scanned`, which is made if it is not there yet."""
    base = duckdb.connect()
    base.execute("SET threads = 1; SET TimeZone = 'UTC'; SET enable_progress_bar = false")
    base.execute(f"CREATE VIEW fleet AS SELECT * FROM read_parquet('{folder}/fleet/**/*.parquet')")
    table = folder / "fleet.csv"
    if not table.exists():
        base.execute(f"COPY (SELECT {IN_CSV} FROM fleet) TO '{table}'")
    base.execute(f"CREATE VIEW scanned AS SELECT * FROM read_csv('{table}')")
    return base


def measure(folder: Path, records: int, repeat: int) -> Result:
    """Make what is missing, and time the queries."""
    captures = list(make_captures(folder, records))
    making = make_data_set(folder, captures)
    base = connect(folder)
    ((count,),) = base.execute("SELECT count(*) FROM fleet").fetchall()
    files = list((folder / "fleet").rglob("*.parquet"))
    sizes = {
        "captures": sum(path.stat().st_size for _, path in captures),
        "Parquet": sum(path.stat().st_size for path in files),
        "CSV of 13 columns": (folder / "fleet.csv").stat().st_size,
    }
    first_day = "SELECT count(*) FROM fleet WHERE site = ? AND day = ?"
    ((first,),) = base.execute(first_day, [SITES[0], DAYS[0]]).fetchall()
    again = _run("decode", str(captures[0][1]), "--format", "jsonl", "-o", "/dev/null") * count / first
    result = Result(
        f"Fleet: {count} records in {len(files)} files, DuckDB {duckdb.__version__}, one thread",
        ("query", "Parquet, s", "CSV scan, s", "CSV / Parquet", "decode again / Parquet"),
        note="\n".join(
            (
                f"CPU time. Decoding all captures again takes {again:.0f} s (from one of them)."
                + (f" Making the data set took {making:.0f} s, once." if making else ""),
                "Sizes: " + ", ".join(f"{name} {size / 1e6:.0f} MB" for name, size in sizes.items()) + ".",
            )
        ),
    )
    for name, text in queries().items():
        cost = in_turn({"parquet": _asking(base, text), "csv": _asking(base, over_csv(text))}, repeat)
        result.rows.append(
            (
                name,
                f"{cost['parquet']:.3f}",
                f"{cost['csv']:.2f}",
                f"{cost['csv'] / cost['parquet']:.0f}",
                f"{again / cost['parquet']:.0f}",
            )
        )
    return result


def over_csv(text: str) -> str:
    """Return a query with the CSV in place of the data set."""
    return text.replace("FROM fleet", "FROM scanned")


def _asking(base: duckdb.DuckDBPyConnection, text: str) -> Callable[[], object]:
    return lambda: base.execute(text).fetchall()


def _run(*words: str) -> float:
    """Run a command of ours; return its CPU time, s."""
    program = Path(sys.executable).parent / "dalyshark"
    with subprocess.Popen([program, *words], stdout=subprocess.DEVNULL) as process:
        cost = child.wait(process)
    if cost.status:
        raise SystemExit(f"bench.fleet: dalyshark {words[0]} ended with {cost.status}")
    return cost.user_s + cost.system_s


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(prog="python -m bench.fleet", description=__doc__)
    parser.add_argument("--records", type=int, default=5_000_000, help="how many, about (%(default)s)")
    parser.add_argument("--folder", type=Path, help="where all is made and stays; default: a temporary folder")
    parser.add_argument("--repeat", type=int, default=3, help="times each query runs (%(default)s)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder: Path = args.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        print(measure(folder, args.records, args.repeat))


if __name__ == "__main__":
    main()
