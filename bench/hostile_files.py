# SPDX-License-Identifier: GPL-2.0-or-later
"""Files that go looking for trouble: captures and logs of every kind that is read, damaged; and garbage.

whole       samples of the repository; simulated buses on every wire; classic pcap, btsnoop, candump, text logs
mutations   bits, bytes cut out, doubled or put in, lengths blown up, two files spliced, control characters
garbage     random bytes, raw and as packets; text that is nearly a log; one endless line; a bomb of gzip
"""

from __future__ import annotations

import gzip
import random
import re
import struct
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalycapture.reader import read_capture
from dalytools.simulator.capture_file import write_capture
from dalytools.simulator.scenario_file import ready_made

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).resolve().parents[1]
EPOCH_NS = 1_700_000_000_000_000_000
LARGEST = 20_000
"""Of a whole file, bytes: many small files find more than few large ones."""
_WIRES = {"uart": "clean-all-dialects", "can": "clean-16s", "ble": "clean-16s", "tcp": "clean-16s"}
_EXTREMES = (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFFC, 0x00100000, 28, 12)
_STEERING = b"\x1b]0;pwned\x07\x1b[2J\x00\x9b31m<script>alert(1)</script>\r\n"
_LOGS = (
    "12:00:00.{n:03d} {way} {hex}\n",
    "[{n}] {way}: {hex}\n",
    "[12:00:{n:02d}][D][uart_debug:114]: {arrow} {colons}\n",
    "{n:08x}: {pairs}  ................\n",
    "{n:08x}  {hex}  |................|\n",
    "2024-01-02 12:00:00,{n:03d} DEBUG -- {n} {compact}\n",
    "27.11.2023 12:00:00.{n:03d} [{way}] - {hex}\n",
    "[12:00:00.{n:03d}]{glyph}{hex}\n",
    "0.{n:06d},0x{first},,\n",
    "{n}-{n} UART: RX bits: {first}\n",
    'A\t12:00:00.{n:03d}\t"(0x) {dashes}" received\n',
)


def whole(folder: Path) -> dict[str, bytes]:
    """Make one small good file of each kind; name: its bytes."""
    files = {path.name: path.read_bytes()[:LARGEST] for path in sorted(ROOT.glob("pcap_samples/*.pcap*"))}
    for wire, name in _WIRES.items():
        path = folder / f"{wire}.pcapng"
        write_capture(ready_made()[name], path, wire=wire, seconds=8)
        files[path.name] = path.read_bytes()[:LARGEST]
        if wire == "can":
            files["can.log"] = _candump(path)
        if wire == "ble":
            files["ble.btsnoop"] = _btsnoop(path)
    frames = [packet.data for packet in read_capture(folder / "uart.pcapng") if packet.data][:60]
    for number, line in enumerate(_LOGS):
        files[f"{number}.txt"] = "".join(_line(line, at, frame) for at, frame in enumerate(frames)).encode()
    files["raw.bin"] = b"".join(frames)
    files["zipped.pcapng.gz"] = gzip.compress(files["uart.pcapng"])
    return files


def _line(line: str, at: int, frame: bytes) -> str:
    way, arrow, glyph = (("TX", ">>>", "发→◇"), ("RX", "<<<", "收←◆"))[at % 2]
    text = frame.hex(" ").upper()
    return line.format(
        n=at,
        way=way,
        arrow=arrow,
        glyph=glyph,
        hex=text,
        compact=frame.hex(),
        colons=text.replace(" ", ":"),
        dashes=text.replace(" ", "-"),
        pairs=frame.hex(" ", -2),
        first=text[:2],
    )


def _candump(path: Path) -> bytes:
    lines = [
        f"({packet.time_ns // 10**9}.{packet.time_ns // 1000 % 10**6:06d}) can0 "
        f"{int.from_bytes(packet.data[:4]) & 0x1FFFFFFF:08X}#{packet.data[8:].hex().upper()}\n"
        for packet in read_capture(path)
    ]
    return "".join(lines).encode()[:LARGEST]


def _btsnoop(path: Path) -> bytes:
    out = [b"btsnoop\0" + struct.pack(">II", 1, 1002)]
    for packet in read_capture(path):
        data = packet.data[4:]
        stamp = packet.time_ns // 1000 + 0x00DCDDB30F2F8000
        out.append(struct.pack(">IIIIq", len(data), len(data), packet.data[3] & 1, 0, stamp) + data)
    return b"".join(out)[:LARGEST]


def mutated(r: random.Random, files: dict[str, bytes]) -> tuple[str, bytes]:
    """Take one of the files and damage it, a few times; return its name's ending, and its bytes."""
    name = r.choice(sorted(files))
    data = bytearray(files[name])
    for _ in range(r.choice((1, 1, 2, 5, 20))):
        if data:
            _mutate(r, data, files)
    return name.partition(".")[2], bytes(data)


def _mutate(r: random.Random, data: bytearray, files: dict[str, bytes]) -> None:
    at = r.randrange(len(data))
    size = r.choice((1, 2, 4, 16, 200))
    match r.randrange(10):
        case 0 | 1:
            data[at] ^= 1 << r.randrange(8)
        case 2:
            del data[at : at + size]
        case 3:
            data[at:at] = r.randbytes(size)
        case 4:
            data[at:at] = data[at : at + size] * r.choice((1, 3))
        case 5:
            place = at & ~3
            data[place : place + 4] = r.choice(_EXTREMES).to_bytes(4, r.choice(("little", "big")))
        case 6:
            other = files[r.choice(sorted(files))]
            start = r.randrange(len(other) + 1)
            data[at:at] = other[start : start + r.choice((20, 500))]
        case 7:
            data[at:at] = _STEERING
        case 8:
            del data[at:]
        case _:
            data[at : at + size] = bytes((r.choice((0, 0xFF, 0x0A, 0xA5)),)) * size


def garbage(size: int) -> dict[str, Callable[[Path], None]]:
    """Return files of about `size` bytes that are nothing; name: what writes it."""
    return {
        "random.bin": lambda path: _pieces(path, _random(size)),
        "random-packets.pcapng": lambda path: _packets(path, size, lambda r: r.randbytes(r.choice((1, 13, 60, 1000)))),
        "nearly-frames.pcapng": lambda path: _packets(path, size // 4, _nearly),
        "can.pcapng": lambda path: _packets(path, size // 4, _can, 227),
        "random.txt": lambda path: _pieces(path, _text(size, rb"[^\x20-\x7e\n]")),
        "hex.txt": lambda path: _pieces(path, (piece.hex(" ", 1).encode() + b"\n" for piece in _random(size // 3))),
        "one-line.txt": lambda path: _pieces(path, (piece.hex().encode() for piece in _random(size // 2))),
        "bomb.pcapng.gz": lambda path: _bomb(path, 10 * size),
        "interfaces.pcapng": lambda path: _interfaces(path, size // 100),
    }


def _pieces(path: Path, pieces: Iterator[bytes]) -> None:
    with path.open("wb") as out:
        out.writelines(pieces)


def _random(size: int) -> Iterator[bytes]:
    r = random.Random(1)
    for _ in range(max(1, size // 50_000)):
        yield r.randbytes(50_000)


def _text(size: int, unwanted: bytes) -> Iterator[bytes]:
    for piece in _random(size):
        yield re.sub(unwanted, b" ", piece)


def _packets(path: Path, size: int, make: Callable[[random.Random], bytes], link_type: int = 147) -> None:
    r = random.Random(2)
    now, done = EPOCH_NS, 0
    with open_writer(path) as writer:
        writer.add_interface(Interface("garbage", "dalyshark bus=garbage", link_type))
        while done < size:
            data = make(r)
            now += r.choice((0, 1, 14, 260, 1100)) * 1_000_000
            writer.write_packet(now, data)
            done += len(data) + 40


def _nearly(r: random.Random) -> bytes:
    """Return a good frame of any address and ID, or Modbus that nearly is one."""
    if r.random() < 0.8:
        head = bytes((0xA5, r.randrange(256), r.randrange(256), 8)) + r.randbytes(8)
        return head + bytes((sum(head) & 0xFF,))
    return bytes((r.choice((0xD2, 0x81, 0x51)), r.choice((3, 6, 0x10, 0x83)))) + r.randbytes(r.choice((4, 6, 30)))


def _can(r: random.Random) -> bytes:
    """Return a CAN frame near Daly's identifiers."""
    identifier = r.choice((0x18900140, 0x18954001, 0x0400FF80, 0x04000001, 0x351)) ^ (1 << r.randrange(29))
    flags = r.choice((0x80000000, 0x80000000, 0, 0x20000000, 0xC0000000))
    data = r.randbytes(r.randrange(9))
    return (identifier | flags).to_bytes(4) + bytes((len(data), 0, 0, 0)) + data


def _bomb(path: Path, size: int) -> None:
    """Write a capture of one block of zeros, packed a thousand to one."""
    head = struct.pack("<IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    with gzip.open(path, "wb") as out:
        out.write(head + struct.pack("<IIHHII", 1, 20, 147, 0, 0, 20))
        for _ in range(size // 1_000_000):
            out.write(bytes(1_000_000))


def _interfaces(path: Path, count: int) -> None:
    """Write a capture with very many interfaces, each with a packet: buses and streams without end."""
    with open_writer(path) as writer:
        for number in range(count):
            writer.add_interface(Interface(f"i{number}", f"dalyshark bus={number}"))
            writer.write_packet(EPOCH_NS + number, b"\xa5\x40\x90\x08" + bytes(8) + b"\x7d", interface=number)
