# SPDX-License-Identifier: GPL-2.0-or-later
"""The dissector's tests, and `dalyshark check` over all samples (also with the dissector of one file), in several
versions of Wireshark: `make matrix`.

    python tests/matrix/run.py [MEMBER ...]

    installed       this machine's own tshark
    trixie, sid,    a Debian release's, fetched into .cache/wireshark/NAME by make_wireshark.sh when it isn't there
      bookworm ..   (remove the folder to fetch a newer one)
    wiregasm        Wireshark 4.4.5 in WebAssembly, held against this machine's own by test_wiregasm.py

Prints a table, a line a member. A member that could not be had (no Debian mirror, no network) is a line that says so.
Exit status 0: all members that could be had passed; 1: one failed, or none could be had; 2: the command line is wrong.
"""

import atexit
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CACHE = ROOT / ".cache"
BIN = ROOT / ".venv" / "bin"
USUAL = ("installed", "trixie", "sid", "wiregasm")
LONGEST = 1800  # seconds for one command: beyond it something hangs


class NotHadError(Exception):
    """A member is not to be had on this machine; the text says why."""


@dataclass(frozen=True)
class Row:
    """One line of the table. `passed` is None where nothing could be run."""

    member: str
    wireshark: str
    lua: str
    tests: str
    check: str
    passed: bool | None


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def run(name: str, command: Sequence[str | Path], environment: Mapping[str, str]) -> tuple[int, str]:
    """Run one command, with all it prints in .cache/matrix/NAME.log. Returns its status and that text."""
    log = CACHE / "matrix" / f"{name}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("wb") as out:
        try:
            status = subprocess.run(
                command,
                cwd=ROOT,
                env={**os.environ, **environment},
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                check=False,
                timeout=LONGEST,
            ).returncode
        except subprocess.TimeoutExpired:
            status = 124
            out.write(f"\nstopped after {LONGEST} s\n".encode())
    return status, log.read_text(encoding="utf-8", errors="replace")


def closing(text: str) -> str:
    """Return pytest's closing line, without its rulers: `12 passed in 3.40s`."""
    found = re.findall(r"^=* ?(\d+ \w+.* in [\d.]+s.*?) ?=*$", text, re.MULTILINE)
    return found[-1] if found else "did not run"


def pytest(member: str, folder: str, environment: Mapping[str, str]) -> tuple[bool, str]:
    status, text = run(f"{member}-tests", [BIN / "python", "-m", "pytest", "-q", folder], environment)
    if status:
        say("\n".join(text.splitlines()[-60:]))
    return status == 0, closing(text)


def check(member: str, environment: Mapping[str, str]) -> tuple[bool, str]:
    samples = sorted((ROOT / "pcap_samples").glob("*.pcapng"))
    if not samples:
        return False, "no samples"
    status, text = run(f"{member}-check", [BIN / "dalyshark", "check", *samples], environment)
    if status:
        say("\n".join(text.splitlines()[-40:]))
    return status == 0, f"{len(samples)} samples " + {0: "clean", 1: "with findings"}.get(status, f"status {status}")


def bundled() -> str:
    """Make the dissector of one file; return its path."""
    run("dist", [BIN / "python", ROOT / "tools" / "make_dist.py"], {})
    return str(ROOT / "dist" / "dalyshark.lua")


def programs(member: str) -> dict[str, str]:
    """Return the environment that makes the tests use this member's programs; fetches the member first if need be."""
    if member == "installed":
        named = os.environ.get("DALYSHARK_TSHARK") or shutil.which("tshark")
        if not named:
            raise NotHadError("no tshark on this machine")
        return {"DALYSHARK_TSHARK": named}
    folder = CACHE / "wireshark" / member
    if not (folder / "version").is_file():
        say(f"{member}: fetching its Wireshark")
        status, text = run(f"{member}-fetch", [ROOT / "tests" / "matrix" / "make_wireshark.sh", member, folder], {})
        if status:
            raise NotHadError(text.strip().removeprefix("make_wireshark: "))
    folder = reachable(folder)
    return {"DALYSHARK_TSHARK": str(folder / "tshark"), "DALYSHARK_SHARKD": str(folder / "sharkd")}


def reachable(folder: Path) -> Path:
    """Return the folder, or for root a copy where its own is closed to others: root's tests start tshark as nobody."""
    if os.geteuid() != 0 or all(above.stat().st_mode & stat.S_IXOTH for above in folder.parents):
        return folder
    place = Path(tempfile.mkdtemp(prefix="dalyshark-matrix-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    place.chmod(0o755)
    return Path(shutil.copytree(folder, place / folder.name, symlinks=True))


def versions(environment: Mapping[str, str]) -> tuple[str, str]:
    """Return Wireshark's and Lua's version, as `tshark --version` has them."""
    command = [environment["DALYSHARK_TSHARK"], "--version"]
    text = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL).stdout
    wireshark = re.search(r"^TShark \(Wireshark\) ([\d.]*\d)", text)
    lua = re.search(r"(?:with\s+|\+)Lua\s+([\d.]*\d)", text)
    return wireshark[1] if wireshark else "?", lua[1] if lua else "none"


def row(member: str) -> Row:
    if member == "wiregasm":
        passed, tests = pytest(member, "tests/matrix/test_wiregasm.py", {})
        return Row(member, "4.4.5", "5.4", tests, "-", passed)
    try:
        environment = programs(member)
    except NotHadError as why:
        return Row(member, "-", "-", f"not had: {why}", "-", None)
    wireshark, lua = versions(environment)
    tested, tests = pytest(member, "tests/dissector", environment)
    checked, findings = check(member, environment)
    in_one, one_file = check(f"{member}-one-file", {**environment, "DALYSHARK_DISSECTOR": bundled()})
    return Row(member, wireshark, lua, tests, f"{findings}; in one file {one_file}", tested and checked and in_one)


def main(named: Sequence[str]) -> int:
    """Run the members and print the table; see the head of this file."""
    if wrong := [name for name in named if not re.fullmatch(r"[a-z]+", name)]:
        sys.stderr.write(f"matrix: {wrong[0]} is no member: say installed, wiregasm or a Debian release\n")
        return 2
    rows: list[Row] = []
    for member in named or USUAL:
        say(f"{member}: running")
        rows.append(row(member))
    word = {True: "passed", False: "FAILED", None: "not had"}
    table = [("member", "Wireshark", "Lua", "result", "dissector tests", "check")]
    table += [(r.member, r.wireshark, r.lua, word[r.passed], r.tests, r.check) for r in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    say("")
    for line in table:
        say("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())
    outcomes = {r.passed for r in rows}
    return 0 if True in outcomes and False not in outcomes else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
