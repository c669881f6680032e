# SPDX-License-Identifier: GPL-2.0-or-later
"""Made traffic that goes looking for trouble: everything docs/records.md has a rule for, near the rules' borders.

Not a bus that could be (the simulator does that), but one that both readings must agree on: all addresses, IDs that
answer in bursts with numbers going everywhere, requests that come again just inside and just outside the limits, Modbus
of both dialects, other makers' frames, payloads full of A5 and 08, damage of every kind, packets cut anywhere, several
interfaces, taps with a direction, events. Deterministic by seed.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

CHARACTER_NS = 10 * 1_000_000_000 // 9600
EPOCH_NS = 1_700_000_000_000_000_000

ADDRESSES = (0x40, 0x40, 0x40, 0x41, 0x4F, 0x80, 0x20, 0x50, 0xFF, 0x01, 0x01, 0x01, 0x02, 0x03, 0x10, 0x11, 0x00)
IDS = (*range(0x90, 0x99), 0x95, 0x95, 0x95, 0x96, 0x96, 0x94, 0x98, 0x57, 0x62, 0xD8, 0xD9, 0x21, 0x00, 0xA5, 0x08)
BYTES = (
    0xA5,
    0xA5,
    0x08,
    0x08,
    0x01,
    0x40,
    0x90,
    0x95,
    0xD2,
    0x03,
    0x51,
    0x81,
    0x06,
    0x10,
    0x83,
    0x0A,
    0x02,
    0x00,
    0xFF,
)
# Milliseconds of quiet between items: a rule of docs/records.md lies near most of them.
QUIET_MS = (0, 0, 0, 1, 5, 14, 37, 37, 37, 60, 98, 102, 140, 230, 248, 252, 300, 490, 515, 700, 960, 1010, 1300)
RARELY_MS = (4000, 9900, 9990, 10010)


@dataclass(frozen=True)
class Made:
    """One packet: interface, direction (0 none, 1 inbound, 2 outbound), time, bytes (none: an event)."""

    interface: int
    direction: int
    time_ns: int
    data: bytes


DESCRIPTIONS = ("dalyshark bus=one", "dalyshark bus=one second tap", "dalyshark", "dalyshark bus=two, 9600")


def a5(address: int, data_id: int, data: bytes) -> bytes:
    head = bytes((0xA5, address, data_id, 8)) + data
    return head + bytes((sum(head) & 0xFF,))


def with_crc(body: bytes) -> bytes:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return body + crc.to_bytes(2, "little")


def with_crc8(body: bytes) -> bytes:
    crc = 0
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 7) & 0xFF if crc & 0x80 else crc << 1 & 0xFF
    return body + bytes((crc,))


def _pylontech(carried: bytes) -> bytes:
    text = b"20024600%04X" % (2 * len(carried)) + carried.hex().upper().encode()
    return b"~%b%04X\r" % (text, -sum(text) & 0xFFFF)


def _jbd(first: int, second: int, carried: bytes) -> bytes:
    body = bytes((second, len(carried))) + carried
    return bytes((0xDD, first)) + body + (-sum(body) & 0xFFFF).to_bytes(2) + b"w"


class Traffic:
    """An endless bus of trouble."""

    def __init__(self, seed: int) -> None:
        self.r = random.Random(seed)
        self.sent: list[bytes] = [a5(0x40, 0x90, bytes(8))]

    def _payload(self) -> bytes:
        r = self.r
        style = r.random()
        if style < 0.35:
            return bytes(r.choice(BYTES) for _ in range(8))
        if style < 0.5:
            return bytes(8)
        return r.randbytes(8)

    def _frame(self) -> bytes:
        r = self.r
        address, data_id = r.choice(ADDRESSES), r.choice(IDS)
        data = bytearray(self._payload())
        if address < 0x20 and data_id == 0x94 and r.random() < 0.7:
            data[0:2] = bytes((r.choice((0, 1, 4, 5, 8, 14, 16, 47, 48, 49)), r.choice((0, 1, 2, 7, 8, 21, 22))))
        return a5(address, data_id, bytes(data))

    def _request(self) -> bytes:
        r = self.r
        if r.random() < 0.3:
            return r.choice(self.sent[-6:])
        frame = a5(r.choice((0x40, 0x40, 0x41, 0x80)), r.choice((0x90, 0x95, 0x95, 0x96, 0x98)), bytes(8))
        self.sent.append(frame)
        del self.sent[:-12]
        return frame

    def _burst(self) -> list[bytes]:
        r = self.r
        address, data_id = r.choice((1, 1, 2)), r.choice((0x95, 0x95, 0x95, 0x96, 0x57))
        first = r.choice((1, 1, 1, 0, 0, 3, 14))
        numbers = list(range(first, first + r.choice((1, 2, 3, 5, 6, 16, 17))))
        trouble = r.random()
        if trouble < 0.1:
            numbers.insert(r.randrange(len(numbers) + 1), r.choice((0, 1, 2, 16, 17, 255)))
        elif trouble < 0.2:
            del numbers[r.randrange(len(numbers))]
        elif trouble < 0.3:
            at = r.randrange(len(numbers))
            numbers.insert(at, numbers[at])
        frames: list[bytes] = []
        for number in numbers:
            cells = b"".join(r.randrange(2500, 3700).to_bytes(2, "big") for _ in range(3))
            frames.append(a5(address, data_id, bytes((number & 0xFF,)) + cells + bytes((r.choice(BYTES),))))
        return frames

    def _from_0(self) -> list[bytes]:
        """A board that counts its frames from 0, asked again: damage or something else stands where number 0 was."""
        r = self.r
        address, data_id, count = r.choice((1, 1, 2)), r.choice((0x95, 0x95, 0x96, 0x57)), r.choice((1, 2, 5, 16))
        asked = [a5(0x3F + address, data_id, bytes(8))] if r.random() < 0.7 else []
        known, again = (
            [a5(address, data_id, bytes((number,)) + r.randbytes(7)) for number in range(count)] for _ in range(2)
        )
        lost = r.choice((1, 1, 1, 2, count))
        between = r.choice((b"", b"", b"", again[0], self._others(), a5(address, data_id, b"\xff" + bytes(7))))
        following = again[lost:] or [a5(address, data_id, bytes((r.choice((1, 2, 3, 15, 16, 17)),)) + bytes(7))]
        damaged = [self._damaged(frame) for frame in again[:lost]]
        return [*r.choice((known, known, [])), *asked, *damaged, between, *following]

    def _texts(self) -> list[bytes]:
        r = self.r
        data_id = r.choice((0x55, 0x56, 0x57, 0x62, 0x63, 0x6A))
        letters = r.choice((b"DL-BMS-R32-01E", b"A b\xe9\x00c\x00\xff   ", b"\x00\xff\x20", r.randbytes(20), b"z" * 35))
        first = r.choice((1, 1, 1, 0))
        frames = [
            a5(1, data_id, bytes((first + at // 7,)) + letters[at : at + 7].ljust(7, b"\0"))
            for at in range(0, len(letters), 7)
        ]
        if r.random() < 0.2:
            del frames[r.randrange(len(frames))]
        return frames

    def _pack(self) -> list[bytes]:
        """A board that tells the same story twice, give or take what the tolerances allow, and a little more."""
        r = self.r
        board, count, sensors = r.choice((1, 1, 2)), r.choice((4, 8, 16)), r.choice((1, 2, 8))
        cells = [r.choice((3300, 3310, 3330, 0 if r.random() < 0.05 else 3300)) for _ in range(count)]
        heat = [r.choice((0, 0xFF, 60, 61, 62, 63, 64)) for _ in range(sensors)]

        def near(value: int, *steps: int) -> int:
            return max(0, value + r.choice((0, 0, *steps, *(-step for step in steps))))

        high, low = near(max(cells), 19, 20, 21), near(min(cells), 19, 20, 21)
        total = near(sum(cells), sum(cells) // 100, sum(cells) // 100 + 100, 400) // 100
        numbers = r.choice((1, count, count + 1)), r.choice((1, count, count + 1))
        extremes = high.to_bytes(2, "big") + bytes((numbers[0],)) + low.to_bytes(2, "big") + bytes((numbers[1], 0, 0))
        warm, cold = near(max(heat), 2, 3) & 0xFF, near(min(heat), 2, 3) & 0xFF
        parts = [
            [a5(board, 0x94, bytes((count, sensors, r.choice((0, 1)), 0, 0, 0, 9, 0)))],
            [a5(board, 0x90, total.to_bytes(2, "big") + bytes((0, 0, 0x75, 0x30, 2, 0)))],
            [a5(board, 0x91, extremes)],
            [a5(board, 0x92, bytes((warm, r.choice((1, sensors + 1)), cold, 1)) + bytes(4))],
            [a5(board, 0x93, bytes((r.choice((0, 1, 2)), r.choice((0, 1)), r.choice((0, 1, 2)), 1, 0, 0, 1, 0)))],
            [
                a5(
                    board,
                    0x95,
                    bytes((n + 1,)) + b"".join((cells + [3333] * 3)[i].to_bytes(2, "big") for i in group) + b"2",
                )
                for n, group in enumerate(range(k, k + 3) for k in range(0, count, 3))
            ][: r.choice((None, None, None, -1))],
            [
                a5(board, 0x96, bytes((n + 1, *heat[7 * n : 7 * n + 7])).ljust(8, b"\0"))
                for n in range((sensors + 6) // 7)
            ],
            [a5(board, 0x98, bytes((r.choice((0, 1, 2, 3)), 0, 0, 0, 0, 0, r.choice((0, 0x10, 0x80)), 0)))],
        ]
        r.shuffle(parts)
        return [
            frame
            for part in parts[: r.choice((2, 4, 8, 8))]
            for frame in ([a5(0x3F + board, part[0][2], bytes(8))] if r.random() < 0.6 else []) + part
        ]

    def _write(self) -> list[bytes]:
        r = self.r
        data_id = r.choice((0xD9, 0xDA, 0x21, 0x00, 0x10, 0x19, 0x1F, 0x2A, 0x2B, 0x0F))
        data = bytes((r.choice((0, 1, 2)),)) + r.choice((bytes(7), r.randbytes(7)))
        answer = r.choice((data, data, bytes((1 - data[0] % 2,)) + data[1:], bytes((data[0],)) + bytes(7)))
        asked = a5(r.choice((0x40, 0x80, 0x41)), data_id, data)
        replies = [a5(r.choice((1, 1, 2)), data_id, answer)] * r.choice((0, 1, 1, 1, 2))
        return [asked] * r.choice((1, 1, 2)) + replies

    def _modbus(self) -> bytes:
        r = self.r
        board = r.choice((1, 1, 2, 16))
        style = r.randrange(9)
        asks = r.choice((0xD2, 0x80 + board))
        answers = r.choice((0xD2, 0x50 + board))
        two = bytes((r.choice((0, 0, 1)), r.randrange(256)))
        count = r.choice((1, 2, 3, 62, 126))
        match style:
            case 0:
                return with_crc(bytes((asks, 3)) + two + count.to_bytes(2, "big"))
            case 1:
                return with_crc(bytes((answers, 3, 2 * count)) + bytes(r.choice(BYTES) for _ in range(2 * count)))
            case 2:
                return with_crc(bytes((r.choice((asks, answers)), 6)) + two + r.randbytes(2))
            case 3:
                return with_crc(bytes((asks, 16)) + two + count.to_bytes(2, "big") + r.randbytes(2 * count))
            case 4:
                head = bytes((asks, 16)) + two + count.to_bytes(2, "big") + bytes((2 * count,))
                return with_crc(head + r.randbytes(2 * count))
            case 5:
                return with_crc(bytes((answers, 16)) + two + count.to_bytes(2, "big"))
            case 6:
                return with_crc(bytes((answers, r.choice((0x83, 0x86, 0x90)), r.randrange(1, 5))))
            case 7:
                return with_crc(bytes((r.choice((0x81, 0x51)), r.choice((0x83, 3, 4)), 1)) + two)
            case _:
                return with_crc(bytes((asks, 3)) + two + b"\x00\x01") + b"\x00"  # a zero more checks again

    def _others(self) -> bytes:
        r = self.r
        style = r.randrange(7)
        address = r.choice((1, 2, 17, 0xF7))
        match style:
            case 0:
                return with_crc(bytes((address, 3, 0, r.randrange(256), 0, 2)))
            case 1:
                return with_crc(bytes((address, r.choice((3, 4)), 4)) + bytes(r.choice(BYTES) for _ in range(4)))
            case 2:
                return with_crc(bytes((address, 6, 0, 1, 0, 5))) * r.choice((1, 2))
            case 3:
                return with_crc8(bytes((0x0A, r.randrange(1, 23), 2)) + r.randbytes(2))
            case 4:
                return b"".join(_pylontech(bytes(r.choice(BYTES) for _ in range(n))) for n in (0, r.randrange(9)))
            case 5:
                return _jbd(0xA5, 3, b"") + _jbd(
                    r.choice((3, 0xA5)), 0, bytes(r.choice(BYTES) for _ in range(r.randrange(30)))
                )
            case _:
                return bytes((0x0A, r.randrange(1, 24), r.choice((2, 4, 3))))

    def _damaged(self, data: bytes) -> bytes:
        r = self.r
        bad = bytearray(data)
        at = r.randrange(len(bad))
        match r.randrange(5):
            case 0:
                bad[at] ^= 1 << r.randrange(8)
            case 1:
                del bad[at]
            case 2:
                bad.insert(at, r.choice(BYTES))
            case 3:
                del bad[at:]
            case _:
                del bad[:at]
        return bytes(bad)

    def _item(self) -> bytes:
        r = self.r
        style = r.random()
        if style < 0.25:
            return self._request()
        if style < 0.5:
            return self._frame()
        if style < 0.6:
            return b"".join(self._burst())
        if style < 0.68:
            return b"".join(r.choice((self._texts, self._pack, self._pack, self._write, self._from_0))())
        if style < 0.78:
            return self._modbus()
        if style < 0.86:
            return self._others()
        if style < 0.95:
            return bytes(r.choice(BYTES) for _ in range(r.choice((1, 2, 4, 5, 13, 30))))
        return r.randbytes(r.choice((1, 7, 40, 300)))

    def packets(self) -> Iterator[Made]:
        """Yield packets for ever, in the order of a file."""
        r = self.r
        now = EPOCH_NS
        while True:
            data = self._item()
            if data and r.random() < 0.12:
                data = self._damaged(data)
            now += r.choice(RARELY_MS if r.random() < 0.02 else QUIET_MS) * 1_000_000 + r.randrange(900_000)
            interface = r.choice((0, 0, 0, 0, 1, 2, 3))
            direction = r.choice((1, 2)) if interface == 1 else 0
            if r.random() < 0.01:
                yield Made(interface, direction, now, b"")
            style = r.random()
            at = 0
            while at < len(data):
                if style < 0.55:  # a frame's length at a time: bursts come frame by frame
                    size = 13 if data[0] == 0xA5 else len(data)
                elif style < 0.8:
                    size = len(data)
                else:
                    size = r.choice((1, 2, 3, 7, 12, 14, 20, 64))
                piece = data[at : at + size]
                yield Made(interface, direction, now, piece)
                at += len(piece)
                now += len(piece) * CHARACTER_NS
                if style >= 0.95 and r.random() < 0.3:
                    now += r.choice((100, 240, 260)) * 1_000_000
                    if r.random() < 0.3:  # somebody else speaks in between
                        yield Made(2, 0, now, self._request())
