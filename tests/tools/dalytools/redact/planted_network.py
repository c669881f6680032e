# SPDX-License-Identifier: GPL-2.0-or-later
"""The planted exchanges through a serial server, and other traffic of the same network. Checksums by RFC 1071."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import EPOCH_NS
from tests.tools.dalytools.redact.planted import CODE, NAME, PASSWORD, SERIAL, exchanges

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

LAPTOP_MAC, SERVER_MAC = bytes.fromhex("3c22fb71d5e9"), bytes.fromhex("c44f33a86b1d")
LAPTOP, SERVER = bytes((172, 23, 171, 94)), bytes((172, 23, 171, 201))
LAPTOP_6, SERVER_6 = (
    bytes.fromhex("2a0104f91c17b3d23e22fbfffe71d5e9"),
    bytes.fromhex("fe80000000000000c64f33fffea86b1d"),
)
SYN, PUSH, ACK, RST = 2, 8, 16, 4
PORT = 8899


def internet(data: bytes) -> int:
    total = sum(data[0::2]) * 256 + sum(data[1::2])
    while total > 0xFFFF:
        total = (total >> 16) + (total & 0xFFFF)
    return 0xFFFF - total


def ipv4(source: bytes, destination: bytes, content: bytes, *, protocol: int = 6, fragment: int = 0x4000) -> bytes:
    head = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(content), 7, fragment, 64, protocol, 0) + source + destination
    return head[:10] + internet(head).to_bytes(2) + head[12:] + content


def ipv6(source: bytes, destination: bytes, content: bytes, *, following: int = 6) -> bytes:
    return struct.pack(">IHBB", 6 << 28, len(content), following, 64) + source + destination + content


def tcp(
    source: bytes,
    destination: bytes,
    ports: tuple[int, int],
    sequence: int,
    data: bytes = b"",
    *,
    flags: int = PUSH | ACK,
    options: bytes = b"",
) -> bytes:
    """Give a segment with its checksum."""
    options = options.ljust(len(options) + -len(options) % 4, b"\0")
    offset = (20 + len(options)) // 4 << 4
    head = struct.pack(">HHIIBBHHH", *ports, sequence % (1 << 32), 1, offset, flags, 512, 0, 0) + options
    pseudo = source + destination + struct.pack(">IBBBB", len(head) + len(data), 0, 0, 0, 6)
    return head[:16] + internet(pseudo + head + data).to_bytes(2) + head[18:] + data


def ethernet(source: bytes, destination: bytes, content: bytes, *, kind: int = 0x0800) -> bytes:
    return destination + source + kind.to_bytes(2) + content


def to_server(sequence: int, data: bytes = b"", *, flags: int = PUSH | ACK, port: int = PORT) -> bytes:
    return ethernet(
        LAPTOP_MAC, SERVER_MAC, ipv4(LAPTOP, SERVER, tcp(LAPTOP, SERVER, (50123, port), sequence, data, flags=flags))
    )


def to_laptop(sequence: int, data: bytes = b"", *, flags: int = PUSH | ACK, port: int = PORT) -> bytes:
    return ethernet(
        SERVER_MAC, LAPTOP_MAC, ipv4(SERVER, LAPTOP, tcp(SERVER, LAPTOP, (port, 50123), sequence, data, flags=flags))
    )


def others() -> list[bytes]:
    """Give what else is on the network."""
    page = b"GET /" + CODE + b" HTTP/1.1\r\nAuthorization: Basic " + SERIAL + b"\r\nCookie: " + PASSWORD + b"\r\n\r\n"
    asked = b"\x12\x34\1\0\0\1\0\0\0\0\0\0" + bytes((len(NAME),)) + NAME + b"\0\0\1\0\1"
    udp = struct.pack(">HHHH", 5353, 53, 8 + len(asked), 0) + asked
    arp = b"\0\1\x08\0\6\4\0\1" + LAPTOP_MAC + LAPTOP + bytes(6) + SERVER
    cookie = b"\x22\x0a" + CODE[:8]
    return [
        ethernet(LAPTOP_MAC, b"\xff" * 6, arp.ljust(46, b"\0"), kind=0x0806),
        ethernet(LAPTOP_MAC, SERVER_MAC, ipv4(LAPTOP, SERVER, udp, protocol=17)),
        to_server(777, page, port=80),
        ethernet(LAPTOP_MAC, SERVER_MAC, ipv4(LAPTOP, SERVER, SERIAL, fragment=0x2000)),
        ethernet(LAPTOP_MAC, SERVER_MAC, ipv4(LAPTOP, SERVER, tcp(LAPTOP, SERVER, (1, 2), 5)) + NAME),  # a trailer
        ethernet(
            LAPTOP_MAC,
            SERVER_MAC,
            ipv4(LAPTOP, SERVER, tcp(LAPTOP, SERVER, (3, 4), 5, b"", flags=SYN, options=b"\2\4\5\xb4" + cookie)),
        ),
        ethernet(LAPTOP_MAC, SERVER_MAC, NAME * 4, kind=0x88CC),
        NAME[:9],
        ethernet(LAPTOP_MAC, SERVER_MAC, ipv6(LAPTOP_6, SERVER_6, NAME, following=58), kind=0x86DD),
    ]


def segments() -> Iterator[bytes]:
    """Give the exchanges in segments: some come again, some late, one is reset."""
    mine, theirs = (1 << 32) - 100, 5000  # numbers go around their end
    yield to_server(mine - 1, flags=SYN)
    yield to_laptop(theirs - 1, flags=SYN | ACK)
    for number, pieces in enumerate(exchanges()):
        yield to_server(mine, pieces[0])
        if number % 5 == 0:
            yield to_server(mine, pieces[0])  # sent again
        mine += len(pieces[0])
        answer = b"".join(pieces[1:])
        parts = [(theirs + at, answer[at : at + 17]) for at in range(0, len(answer), 17)]
        theirs += len(answer)
        if number % 3 == 0:
            parts.reverse()
        if number % 7 == 6:
            parts = [(at - 5, b"*****" + part) for at, part in parts]  # overlaps what is known
        for at, part in parts:
            yield to_laptop(at, part)
        if number == 4:
            yield from others()
    yield to_laptop(theirs + 1000, CODE)  # what comes before it is lost
    yield to_laptop(theirs, SERIAL, flags=RST)


def capture(path: Path, packets: Iterable[bytes], *, link_type: int = 1) -> Path:
    """Write packets, 100 ms apart."""
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("eth0", NAME.decode(), link_type))
        for number, packet in enumerate(packets):
            writer.write_packet(EPOCH_NS + number * 100_000_000, packet)
    path.chmod(0o644)
    return path
