# SPDX-License-Identifier: GPL-2.0-or-later
"""A capture full of secrets, in every place and byte order that the dialects use; and the search for what is left."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import EPOCH_NS, a5
from tests.traffic import with_crc

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

CODE = b"QK7ZP4WX9JH2LM5NVBTG"
SERIAL = b"8F3Y-RTC6-WD1S-0U7E-AXPB"
PASSWORD = b"73vQ9k"
NAME = b"Windmill@Elm-Row"
MAKER = b"Jos.Packbuilder"
IMEI = b"867530912345671"
PLACE = b"\x03\x1f\x8e\x5d\x00\xc7\x4a\x91"
BORN = bytes((23, 11, 29))
CLOCK = bytes((26, 10, 17, 21, 43, 58))
OTHER_CLOCK = bytes((26, 10, 17, 21, 43, 59))
UNKNOWN = b"zK4!uT0p"

SECRETS = (CODE, SERIAL, PASSWORD, NAME, MAKER, IMEI, PLACE, CLOCK, OTHER_CLOCK, UNKNOWN)


def texts(data_id: int, text: bytes, address: int = 1) -> list[bytes]:
    """Give the frames of a text, seven characters each, numbered from 1."""
    return [
        a5(address, data_id, bytes((1 + at // 7,)) + text[at : at + 7].ljust(7, b"\0")) for at in range(0, len(text), 7)
    ]


def swapped(data: bytes) -> bytes:
    """Swap the bytes of each pair."""
    data = data.ljust(len(data) + len(data) % 2, b"\0")
    return b"".join(data[at : at + 2][::-1] for at in range(0, len(data), 2))


def read(address: int, start: int, count: int) -> bytes:
    return with_crc(bytes((address, 3)) + start.to_bytes(2) + count.to_bytes(2))


def reply(address: int, data: bytes) -> bytes:
    return with_crc(bytes((address, 3, len(data))) + data)


def write_many(address: int, start: int, data: bytes, *, counted: bool = False) -> bytes:
    head = bytes((address, 16)) + start.to_bytes(2) + (len(data) // 2).to_bytes(2)
    return with_crc(head + (bytes((len(data),)) if counted else b"") + data)


def wrote(address: int, start: int, count: int) -> bytes:
    return with_crc(bytes((address, 16)) + start.to_bytes(2) + count.to_bytes(2))


def exchanges() -> list[list[bytes]]:
    """Give what goes over a serial line: each is a request and its answers."""
    day = bytes((1, 2, *BORN, 0x0E, 0x10, 5))
    words = CODE.ljust(32, b"\0")
    bad = bytearray(texts(0x57, CODE)[1])
    bad[-1] ^= 0x10
    return [
        # A5: every text, dates, a position that nobody knows of, writes of all of these
        [a5(0x40, 0x90), a5(1, 0x90, bytes.fromhex("0210000075300329"))],
        [a5(0x40, 0x57), *texts(0x57, CODE)],
        [a5(0x40, 0x91), a5(1, 0x91, bytes.fromhex("0cf8030cee07") + CODE[-2:])],  # stale: the end of the code
        [a5(0x40, 0x6A), *texts(0x6A, SERIAL)],
        [a5(0x40, 0x56), *texts(0x56, NAME)],
        [a5(0x40, 0x55), *texts(0x55, MAKER)],
        [a5(0x40, 0x53), a5(1, 0x53, day)],
        [a5(0x40, 0x61), a5(1, 0x61, CLOCK + b"\0\0")],
        [a5(0x40, 0x58), a5(1, 0x58, BORN)],
        [a5(0x40, 0x6B), a5(1, 0x6B, UNKNOWN)],
        [a5(0x40, 0x9F), a5(1, 0x9F, PLACE)],
        [a5(0x40, 0x21, CLOCK + b"\x03\x20"), a5(1, 0x21, b"\x01" + CLOCK[1:])],
        [a5(0x40, 0x13, day), a5(1, 0x13, day)],
        *[[a5(0x40, frame[2] - 0x40, frame[4:12]), a5(1, 0x17, frame[4:12])] for frame in texts(0x57, CODE)],
        *[[a5(0x40, 0x2A, frame[4:12])] for frame in texts(0x6A, SERIAL)],
        [a5(0x40, 0x63), *texts(0x63, b"HW-" + SERIAL)],  # a copy where a version should be
        # D2: texts in order and reversed, password, dates, IMEI; writes with and without a byte count
        [read(0xD2, 0xA9, 32), reply(0xD2, CODE[::-1].ljust(16, b"\0")[:16] + b"H1".ljust(16, b"\0") + words)],
        [read(0xD2, 0xB9, 5), reply(0xD2, CODE[:10])],
        [read(0xD2, 0xC9, 5), reply(0xD2, PASSWORD + BORN + b"\0")],
        [read(0xD2, 0xD4, 3), reply(0xD2, CLOCK)],
        [read(0xD2, 0x57, 16), reply(0xD2, IMEI.ljust(16, b"\0") + PLACE * 2)],
        [read(0xD2, 0x2D00, 8), reply(0xD2, swapped(SERIAL[:16]))],
        [write_many(0xD2, 0xC9, PASSWORD), wrote(0xD2, 0xC9, 3)],
        [write_many(0xD2, 0xB9, words, counted=True), wrote(0xD2, 0xB9, 16)],
        [write_many(0xD2, 0xD4, CLOCK), wrote(0xD2, 0xD4, 3)],
        *[[frame, frame] for at in (0, 2, 4) for frame in [one(0xD2, 0xC9 + at // 2, PASSWORD[at : at + 2])]],
        # 81
        [read(0x81, 0x18D, 28), reply(0x51, SERIAL + words)],
        [read(0x81, 0x123, 8), reply(0x51, CLOCK + PASSWORD + BORN + b"\0")],
        [read(0x81, 0x61, 3), reply(0x51, OTHER_CLOCK)],
        [write_many(0x81, 0x126, PASSWORD), wrote(0x51, 0x126, 3)],
        [write_many(0x81, 0x400, IMEI + b"\0"), wrote(0x51, 0x400, 8)],
        # an answer to an unknown request, and one too late for its own while another of its length waits
        [reply(0x51, SERIAL)],
        [read(0xD2, 0, 16), reply(0xD2, words)],
        # damaged, cut off, junk, others' frames
        [bytes(bad), texts(0x57, CODE)[0][:9], a5(0x40, 0x90)],
        [SERIAL, a5(0x40, 0x90)],
        [reply(0xD2, words)[:20], a5(0x40, 0x90)],
        [with_crc(bytes((7, 3, 24)) + SERIAL), with_crc(bytes((7, 6, 0, 1)) + PASSWORD[:2]), a5(0x40, 0x90)],
        [with_crc(bytes((7, 16, 0, 1, 0, 3, 6)) + PASSWORD), a5(0x40, 0x90)],
    ]


def one(address: int, register: int, value: bytes) -> bytes:
    return with_crc(bytes((address, 6)) + register.to_bytes(2) + value)


def block(kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12)


AROUND = (
    block(4, struct.pack("<HH", 1, 5 + len(NAME)) + b"\x0a\0\0\1" + NAME + bytes(8)),  # name resolution
    block(10, struct.pack("<II", 0x544C534B, len(SERIAL)) + SERIAL),  # decryption secrets
    block(0xBAD, struct.pack("<I", 32473) + SERIAL),  # custom
    block(0x40000BAD, struct.pack("<I", 32473) + CODE),
)


def capture(path: Path, *, cut: Sequence[int] = (13,), direction: bool = False) -> Path:
    """Write it all: frames 15 ms apart, exchanges two seconds; packets cut in turn after so many bytes.

    Secrets stand also in names, descriptions, hardware, comments, and blocks that are no packets.
    """
    with open_writer(path, application=f"sniffer of {MAKER.decode()}") as writer:
        writer.origin = f"goes on from /home/{NAME.decode()}/{CODE.decode()}.pcapng"
        name = f"/dev/serial/by-id/usb-FTDI_{SERIAL.decode()}-if00"
        writer.add_interface(
            Interface(name, f"dalyshark bus={NAME.decode()} 9600 8N1 {name}; adapter {CODE.decode()}", 147, 9600, "A5X")
        )
        writer.add_interface(Interface(name, f"dalyshark bus={NAME.decode()} {name}", 147, 9600, SERIAL.decode()))
        writer.write_packet(EPOCH_NS, b"", comment=f"port lost: {name} went away")
        writer.write_packet(EPOCH_NS + 1, b"", comment=f"user mark 1: {NAME.decode()}")
        number = 0
        for second, pieces in enumerate(exchanges(), 1):
            at_ns = EPOCH_NS + second * 2_000_000_000
            for piece in pieces:
                at = 0
                while at < len(piece):
                    part = piece[at : at + cut[number % len(cut)]]
                    number += 1
                    asks = piece is pieces[0]
                    writer.write_packet(
                        at_ns + at * 1_041_667,
                        part,
                        interface=int(direction and asks),
                        flags=(2 if asks else 1) if direction else 0,
                        comment=CODE.decode() if number % 50 == 0 else "",
                        dropped=int(number == 77),
                    )
                    at += len(part)
                at_ns += len(piece) * 1_041_667 + 15_000_000
    with path.open("ab") as file:
        for each in AROUND:
            file.write(each)
    return path


def left(data: bytes) -> list[str]:
    """Return what is left of the secrets in a file: any five bytes of each, in all orders, and as hex text."""
    found: list[str] = []
    for secret in SECRETS:
        for shape in {order for start in (secret, secret[1:]) for order in (start, start[::-1], swapped(start))}:
            for at in range(len(shape) - 4):
                part = shape[at : at + 5]
                found += [f"{secret!r}: {part!r}" for each in forms(part) if each in data]
    for date in (BORN, CLOCK[:3]):
        bcd = bytes(int(str(number), 16) for number in date)
        found += [f"date {each!r}" for whole in (date, bcd) for each in (whole, whole[::-1]) if each in data]
    return found


def forms(part: bytes) -> tuple[bytes, ...]:
    return part, part.hex().encode(), part.hex().upper().encode()


def write_serial(path: Path, pieces: Sequence[bytes], *, apart_ms: int = 40, link_type: int = 147) -> Path:
    """Write packets of a serial line, so far apart."""
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("made", "dalyshark bus=main", link_type))
        for number, piece in enumerate(pieces):
            writer.write_packet(EPOCH_NS + number * apart_ms * 1_000_000, piece)
    path.chmod(0o644)
    return path
