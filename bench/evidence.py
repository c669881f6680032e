# SPDX-License-Identifier: GPL-2.0-or-later
"""What the sniffer promises as an instrument: no byte lost, frames found, times that are right within their bound.

conservation   random streams, cut into random reads: bytes in, bytes in records
frames         a bus of requests and replies, damaged in four ways: intact frames found, frames that were none
times, model   an adapter that holds bytes back (bench.adapter_model) through the sniffer's own framer
times, live    frames fed to a pseudo-terminal a byte at a time, each byte's time noted; the file's times beside them
live           as fast as a pseudo-terminal goes; and a sniffer that is stopped for a while (SIGSTOP)
"""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import tty
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from bench.adapter_model import reads, traffic
from bench.child import resident_mib
from bench.table import Goal, Result
from dalycapture.framing import Framer
from dalycapture.port import Latency
from dalycapture.reader import read_capture
from dalyref.a5 import SIZE, build
from dalyref.kinds import Kind
from dalyref.records import Splitter
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from bench.options import Options

MS = 1_000_000
BYTE_S = 10 / 9600
CONSERVED = 10_000_000
STOPPED_S, FAST_S, START_S = 20.0, 10.0, 20.0
MILLION = 1_000_000
EXCHANGES = 4000


def measure(options: Options) -> list[Result]:
    """Measure all; ``options.seconds`` for the live times."""
    return [_conservation(), _frames(), _model(), _live_times(min(options.seconds, 60.0)), _live_bytes()]


def _conservation() -> Result:
    result = Result("Bytes in and out of the framer", ("streams", "bytes in", "unaccounted"))
    r, total, lost, streams = random.Random(5), 0, 0, 0
    while total < CONSERVED:
        size = r.choice((1_000, 50_000, 200_000))
        noise = r.choice((0.0, 0.01, 0.3))
        stream = b"".join(
            r.randbytes(r.randrange(1, 40)) if r.random() < noise else build(r.choice((1, 0x40)), 0x90, r.randbytes(8))
            for _ in range(size // SIZE)
        )
        splitter, out, at = Splitter(), bytearray(), 0
        while at < len(stream):
            step = r.choice((1, 3, 13, 62, 4095))
            out += b"".join(record.data for record in splitter.feed(stream[at : at + step]))
            at += step
        out += b"".join(record.data for record in splitter.flush())
        lost += 0 if bytes(out) == stream else max(1, abs(len(out) - len(stream)))
        total += len(stream)
        streams += 1
    result.rows.append((str(streams), str(total), str(lost)))
    result.goals.append(Goal("unaccounted bytes", lost, 0))
    return result


def _bus(r: random.Random, hostile: bool) -> Iterator[bytes]:
    """Requests and replies, one in seven of sixteen frames (capture notes, section 2)."""
    for number in range(EXCHANGES):
        data_id = 0x95 if number % 7 == 6 else 0x90 + number % 5
        yield build(0x40, data_id, bytes(8))
        for part in range(16 if data_id == 0x95 else 1):
            payload = bytes(0xA5 if hostile and r.random() < 0.3 else r.randrange(256) for _ in range(7))
            yield build(1, data_id, bytes([part + 1]) + payload)


def _damaged(r: random.Random, frame: bytes, rate: float) -> bytes:
    out = bytearray()
    for byte in frame:
        chance = r.random()
        if chance < rate / 3:
            continue
        if chance < 2 * rate / 3:
            out.append(byte ^ 1 << r.randrange(8))
        else:
            out.append(byte)
            if chance < rate:
                out.append(r.randrange(256))
    return bytes(out)


def _frames() -> Result:
    result = Result(
        f"Frames found in {EXCHANGES} exchanges",
        ("bus", "intact frames", "found", "share", "false"),
        note="False: good frames that were never sent; a damaged one whose sum is right by accident counts.",
    )
    for name, glitch, rate, hostile in (
        ("clean", 0.0, 0.0, False),
        ("glitches between frames", 0.3, 0.0, False),
        ("noise 1e-3", 0.0, 1e-3, False),
        ("hostile: noise 5e-3, 30 % A5 in the data", 0.3, 5e-3, True),
    ):
        r = random.Random(11)
        wire, sent = bytearray(), dict[int, bytes]()
        for frame in _bus(r, hostile):
            if r.random() < glitch:
                wire += r.choice((b"\x00", b"\xff", b"\xff\xff"))
            heard = _damaged(r, frame, rate) if rate else frame
            if (intact := heard.find(frame)) >= 0:  # a byte more behind it does not damage a frame
                sent[len(wire) + intact] = frame
            wire += heard
        splitter = Splitter()
        found = false = 0
        records = itertools.chain.from_iterable(
            splitter.feed(bytes(wire[at : at + 62])) for at in range(0, len(wire), 62)
        )
        for record in (*records, *splitter.flush()):
            if record.kind is Kind.FRAME:
                if sent.get(record.start) == record.data:
                    found += 1
                else:
                    false += 1
        share, wrong = found / len(sent), false / len(sent)
        result.rows.append((name, str(len(sent)), str(found), f"{share:.5f}", str(false)))
        result.goals.append(Goal(f"found, {name}", share, 0.9999 if hostile else 1.0, at_least=True))
        result.goals.append(Goal(f"false, {name}", wrong, 1e-3 if hostile else 0.0))
    return result


def _percentile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def _model() -> Result:
    result = Result(
        f"Times: an adapter that holds bytes back, {EXCHANGES} exchanges",
        ("latency timer", "frames", "p50, ms", "p95, ms", "max, ms", "truth inside the stated bound"),
    )
    for timer_ms in (16, 4, 1):
        sent = traffic(EXCHANGES, 3)
        framer = Framer(latency=Latency(timer_ms, 1.0, "given"))
        got = [one for time_ns, data in reads(sent, timer_ms * MS, 9) for one in framer.feed(data, time_ns, 300_000)]
        got += framer.flush()
        pairs = list(zip(got, sent, strict=True))
        errors = [abs(one.time_ns - truth.time_ns) / MS for one, truth in pairs]
        inside = sum(abs(one.time_ns - truth.time_ns) <= one.bound_ns for one, truth in pairs) / len(pairs)
        p50, p95 = _percentile(errors, 0.5), _percentile(errors, 0.95)
        result.rows.append(
            (f"{timer_ms} ms", str(len(sent)), f"{p50:.2f}", f"{p95:.2f}", f"{max(errors):.2f}", f"{inside:.2%}")
        )
        if timer_ms == 16:
            result.goals.append(Goal("p95, 16 ms", p95, 2.0, " ms"))
            result.goals.append(Goal("inside, 16 ms", 100 * inside, 99.9, " %", at_least=True))
    return result


@contextmanager
def _sniffer(*words: str) -> Generator[tuple[subprocess.Popen[bytes], int, Path]]:
    """Run ``dalyshark capture`` on a pseudo-terminal; gives the process, the terminal's other end, and the file."""
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as folder:
        path = Path(folder) / "sniffed.pcapng"
        program = str(Path(sys.executable).with_name("dalyshark"))
        sniffer = subprocess.Popen([program, "capture", os.ttyname(slave), "-q", "-w", str(path), *words])
        try:
            until = time.monotonic() + START_S
            while not path.exists() or not path.stat().st_size:
                if sniffer.poll() is not None or time.monotonic() > until:
                    raise Problem("the sniffer did not start")
                time.sleep(0.05)
            time.sleep(1)
            yield sniffer, master, path
        finally:
            if sniffer.poll() is None:
                sniffer.send_signal(signal.SIGCONT)
                sniffer.send_signal(signal.SIGINT)
                sniffer.wait()
            os.close(master)
            os.close(slave)


def _end(sniffer: subprocess.Popen[bytes]) -> None:
    time.sleep(1)
    sniffer.send_signal(signal.SIGINT)
    if sniffer.wait(30):
        raise Problem(f"the sniffer ended with status {sniffer.returncode}")


def _live_times(seconds: float) -> Result:
    """Frames a byte at a time, as a UART hands them over: when its last bit has passed. Twenty frames a second."""
    result = Result(
        f"Times: a prompt adapter, live for {seconds:g} s",
        ("frames", "late fed", "p50, ms", "p99, ms", "max, ms"),
        note="Late fed: left out, for the feeder itself was more than 0.2 ms late with a byte of theirs.",
    )
    truth: dict[bytes, int] = {}
    late = 0
    with _sniffer("--latency", "0") as (sniffer, master, path):
        began = time.monotonic()
        for number in itertools.count():
            start = began + number * 0.05
            if start - began > seconds:
                break
            frame = build(1, 0x90, number.to_bytes(8, "big"))
            worst = 0.0
            start_ns = 0
            for index, byte in enumerate(frame):
                due = start + (index + 1) * BYTE_S
                while (wait := due - time.monotonic()) > 0:
                    if wait > 0.0004:
                        time.sleep(wait - 0.0003)
                os.write(master, bytes([byte]))
                worst = max(worst, time.monotonic() - due)
                if not index:
                    start_ns = time.time_ns() - round(BYTE_S * 1e9)
            if worst > 0.0002:
                late += 1
            else:
                truth[frame] = start_ns
        _end(sniffer)
        errors = [
            abs(packet.time_ns - truth[packet.data]) / MS for packet in read_capture(path) if packet.data in truth
        ]
    if len(errors) != len(truth):
        raise Problem(f"{len(truth) - len(errors)} frames are not in the file")
    p50, p99 = _percentile(errors, 0.5), _percentile(errors, 0.99)
    result.rows.append((str(len(errors)), str(late), f"{p50:.3f}", f"{p99:.3f}", f"{max(errors):.3f}"))
    result.goals += [Goal("p50", p50, 0.1, " ms"), Goal("p99", p99, 1.0, " ms")]
    return result


def _live_bytes() -> Result:
    result = Result("Bytes lost live", ("feeding", "bytes", "MB/s", "lost", "memory, MiB", "growth from 25 % on, MiB"))
    with _sniffer() as (sniffer, master, path):
        began, fed, number = time.monotonic(), 0, 0
        early = 0.0
        while time.monotonic() - began < FAST_S or number < MILLION:
            if not early and number > MILLION / 4:
                early = resident_mib(sniffer.pid)
            piece = b"".join(build(1, 0x90, value.to_bytes(8, "big")) for value in range(number, number + 256))
            at = 0
            while at < len(piece):
                at += os.write(master, piece[at:])
            number += 256
            fed += len(piece)
        took = time.monotonic() - began
        until = time.monotonic() + 60
        while time.monotonic() < until and path.stat().st_size < fed / SIZE * 44:
            time.sleep(0.2)
        late = resident_mib(sniffer.pid)
        _end(sniffer)
        heard = sum(len(packet.data) for packet in read_capture(path))
    result.rows.append(
        (
            f"as fast as it goes, {number} records",
            str(fed),
            f"{fed / took / 1e6:.2f}",
            str(fed - heard),
            f"{late:.1f}",
            f"{late - early:.2f}",
        )
    )
    result.goals += [Goal("memory", late, 40, " MiB"), Goal("growth over a million records", late - early, 1, " MiB")]
    result.goals.append(Goal("lost, as fast as it goes", abs(fed - heard), 0))
    result.goals.append(Goal("speed", fed / took / 1e6, 1.0, " MB/s", at_least=True))
    with _sniffer() as (sniffer, master, path):
        began, fed = time.monotonic(), 0
        stopped = False
        for number in itertools.count():
            now = time.monotonic() - began
            if now > STOPPED_S + 4:
                break
            if now > 2 and not stopped:
                sniffer.send_signal(signal.SIGSTOP)
                stopped = True
            elif now > STOPPED_S + 2:
                sniffer.send_signal(signal.SIGCONT)
            wait = began + number * SIZE * BYTE_S - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            fed += os.write(master, build(1, 0x90, number.to_bytes(8, "big")))
        _end(sniffer)
        heard = sum(len(packet.data) for packet in read_capture(path))
    result.rows.append((f"960 B/s, stopped for {STOPPED_S:g} s", str(fed), "0.00", str(fed - heard), "", ""))
    result.goals.append(Goal("lost, stopped", abs(fed - heard), 0))
    return result
