# SPDX-License-Identifier: GPL-2.0-or-later
"""``make crash``: what is left of a capture after kills, a torn end, a full disk; how fast Wireshark's tool is.

    kills       SIGKILL at random moments, each life appending to the same file; every fourth end is torn by hand
    full disk   a tmpfs of 64 KiB that fills up and is freed again (root only, who may mount)
    extcap      answers, stop on a silent bus, a reader that goes, an error at the start

Exit status 1 where a byte is unaccounted for, or a limit of ``LIMITS_S`` is passed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tests.capture.bus import Bus, numbered

from dalycapture.create import open_writer
from dalycapture.errors import TruncatedError
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.reader import read_capture
from dalycapture.rotation import Keeping
from dalycapture.sniffer import Limits, Side, Sniffer

if TYPE_CHECKING:
    from collections.abc import Callable

LIMITS_S: Final = {"answer": 0.150, "stop": 0.5, "reader gone": 1.0, "start error": 1.0, "space again": 1.0}

# Prints how many records were framed, and when: what is printed must be in the file.
SNIFF: Final = """
import sys, time
from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.rotation import Keeping
from dalycapture.sniffer import Side, Sniffer
side = Side(open_port(sys.argv[1]), tap("x"))
writer = open_writer(sys.argv[2], keeping=Keeping(append=True))
print("open", flush=True)
Sniffer([side], [writer], listener=lambda one: print(one.record.start, flush=True)).run()
"""

EXTCAP: Final = [sys.executable, "-c", "from dalycapture.extcap import entry; entry()"]


def kills(lives: int, folder: Path) -> bool:
    """Kill, tear, append; all that was told to be framed must be there, in its order, and the file be whole."""
    chance = random.Random(20260131)
    path = folder / "kills.pcapng"
    told = torn = sent = 0
    expected: list[bytes] = []
    for life in range(lives):
        with Bus() as bus:
            sniffer = subprocess.Popen([sys.executable, "-c", SNIFF, bus.port, str(path)], stdout=subprocess.PIPE)
            assert sniffer.stdout
            assert sniffer.stdout.readline() == b"open\n"
            end = time.monotonic() + chance.uniform(0.0, 0.15)
            first = sent
            while time.monotonic() < end:
                for _ in range(20):
                    bus.send(numbered(sent))
                    sent += 1
                time.sleep(0.001)
            sniffer.kill()
            sniffer.wait()
            reported = len(sniffer.stdout.read().splitlines())
            sniffer.stdout.close()
        told += reported
        lost = _whole_and_all(path, expected, first, reported)
        if lost:
            print(f"life {life}: {lost}")
            return False
        if life % 4 == 3:
            torn += 1
            with path.open("ab") as file:
                file.write(b"\6\0\0\0\x30\0\0\0\0\0\0\0"[: chance.randint(1, 11)])
    with open_writer(path, keeping=Keeping(append=True)) as writer:
        writer.add_interface(tap("x"))
    got = [p.data for p in read_capture(path) if p.data]
    whole = got == expected
    print(f"kills        {lives} kills, {torn} torn ends: {told} records told, {len(got)} in the file, whole: {whole}")
    return whole


def _whole_and_all(path: Path, expected: list[bytes], first: int, reported: int) -> str:
    """Add what this life has written to what is expected; say what is wrong."""
    got: list[bytes] = []
    with contextlib.suppress(TruncatedError):  # the block that was under way
        got.extend(p.data for p in read_capture(path) if p.data)
    if got[: len(expected)] != expected:
        return "what was there is gone"
    new = got[len(expected) :]
    if new != [numbered(first + n) for n in range(len(new))]:
        return "records are missing in the middle"
    if len(new) < reported:
        return f"{reported} were framed, {len(new)} are there"
    expected.extend(new)
    return ""


def full_disk(rounds: int, folder: Path) -> bool:
    """Fill a tmpfs, free it, and count."""
    if os.geteuid() != 0:
        print("full disk    left out: only root may mount a tmpfs")
        return True
    waits: list[float] = []
    lost = 0
    for turn in range(rounds):
        small = folder / f"small-{turn}"
        small.mkdir()
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", small], check=True)
        try:
            wait, missing = _fill_and_free(small)
        finally:
            subprocess.run(["umount", small], check=True)
        if missing is None:
            return False
        waits.append(wait)
        lost += missing
    worst = max(waits)
    print(
        f"full disk    {rounds} times: {lost} records lost, all counted; on again after at most {worst * 1000:.0f} ms"
    )
    return worst <= LIMITS_S["space again"]


def _fill_and_free(folder: Path) -> tuple[float, int | None]:
    ballast, path, sent = folder / "ballast", folder / "x.pcapng", 1500
    ballast.write_bytes(bytes(40_000))
    freed = again = 0.0
    before = 0
    with Bus() as bus:
        port = open_port(bus.port)
        writer = open_writer(path, keeping=Keeping(wait_when_full=True))
        sniffer = Sniffer([Side(port, tap("x"))], [writer], limits=Limits(packets=sent))

        def feed() -> None:
            nonlocal freed, again, before
            for number in range(sent):
                bus.send(numbered(number))
                if number % 5 == 0:
                    time.sleep(0.002)
                if number == 1000:
                    while not writer.lost:
                        time.sleep(0.002)
                    before = writer.written
                    ballast.unlink()
                    freed = time.monotonic()
                elif freed and not again and writer.written > before:
                    again = time.monotonic()

        feeder = threading.Thread(target=feed)
        feeder.start()
        sniffer.run()
        feeder.join()
    packets = list(read_capture(path))
    records = sum(bool(p.data) for p in packets)
    told = [p.comment for p in packets if not p.data]
    if records + writer.lost != sent or len(told) != 1 or f": {writer.lost} records (" not in told[0]:
        print(f"full disk    {records} in the file and {writer.lost} lost are not {sent}; told: {told}")
        return 0.0, None
    return again - freed, writer.lost


def extcap(rounds: int, folder: Path) -> bool:
    """Time the tool as Wireshark meets it."""
    well = True
    questions = {
        "interfaces": ["--extcap-interfaces", "--extcap-version=4.0"],
        "config": ["--extcap-config", "--extcap-interface", "daly"],
        "dlts": ["--extcap-dlts", "--extcap-interface", "daly"],
    }
    for name, words in questions.items():
        times = [_timed(lambda words=words: subprocess.run([*EXTCAP, *words], check=True, capture_output=True))
                 for _ in range(rounds)]  # fmt: skip
        well &= _told(f"extcap, {name}", times, LIMITS_S["answer"])
    fifo = folder / "fifo"
    os.mkfifo(fifo)
    with Bus() as bus:
        stops = [_timed_end(fifo, bus.port, lambda tool, _: tool.send_signal(signal.SIGTERM)) for _ in range(rounds)]
        gone = [_timed_end(fifo, bus.port, lambda _, fd: os.close(fd)) for _ in range(rounds)]
    errors = [_timed_end(fifo, "/dev/none", lambda _tool, _fd: None) for _ in range(rounds)]
    well &= _told("extcap, stop on a silent bus", stops, LIMITS_S["stop"])
    well &= _told("extcap, reader gone on a silent bus", gone, LIMITS_S["reader gone"])
    return _told("extcap, start error", errors, LIMITS_S["start error"]) and well


def _timed(work: Callable[[], object]) -> float:
    since = time.monotonic()
    work()
    return time.monotonic() - since


def _timed_end(fifo: Path, port: str, end: Callable[[subprocess.Popen[bytes], int], None]) -> float:
    """How long the tool takes to end from this on; with a port that is not there, from its start on."""
    since = time.monotonic()
    words = ["--capture", "--extcap-interface", "daly", "--port", port, "--fifo", str(fifo)]
    tool = subprocess.Popen([*EXTCAP, *words], stderr=subprocess.DEVNULL)
    fd = os.open(fifo, os.O_RDONLY)
    if port != "/dev/none":
        while b"dalyshark bus=" not in os.read(fd, 4096):
            pass
        time.sleep(0.3)  # it sleeps now
        since = time.monotonic()
    end(tool, fd)
    tool.wait(60)
    took = time.monotonic() - since
    with contextlib.suppress(OSError):  # that was the end
        os.close(fd)
    return took


def _told(what: str, times: list[float], limit: float) -> bool:
    median, worst = statistics.median(times) * 1000, max(times) * 1000
    print(f"{what:<36} median {median:.0f} ms, worst {worst:.0f} ms of {len(times)}; limit {limit * 1000:.0f} ms")
    return worst <= limit * 1000


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(prog="python -m bench.crash", description=__doc__)
    parser.add_argument("--lives", type=int, default=200, help="kills (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=20, help="of each of the others (default: %(default)s)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="dalyshark-crash-") as name:
        folder = Path(name)
        well = [kills(args.lives, folder), full_disk(args.rounds, folder), extcap(args.rounds, folder)]
    return 0 if all(well) else 1


if __name__ == "__main__":
    sys.exit(main())
