# SPDX-License-Identifier: GPL-2.0-or-later
"""TCP: the secrets of the line, addresses, all other traffic; checksums right again, nothing but that changed."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.tools.dalytools.made import a5
from tests.tools.dalytools.redact import planted_network as made
from tests.tools.dalytools.redact.planted import CODE, left, texts
from tests.tools.dalytools.redact.planted_network import (
    LAPTOP,
    LAPTOP_6,
    LAPTOP_MAC,
    SERVER,
    SERVER_6,
    SERVER_MAC,
    capture,
    ethernet,
    internet,
    ipv4,
    ipv6,
    segments,
    tcp,
    to_laptop,
    to_server,
)

from dalycapture.reader import read_capture
from dalyref.options import Options
from dalytools.cli import main
from dalytools.redact.copy import redact

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

ADDRESSES = (LAPTOP, SERVER, LAPTOP_MAC, SERVER_MAC, LAPTOP_6, SERVER_6)
ONE, TWO = bytes((192, 0, 2, 1)), bytes((192, 0, 2, 2))
SHOUT = b"XXXXXXX"


def redacted(folder: Path, packets: Sequence[bytes], link_type: int = 1) -> list[bytes]:
    before, after = folder / "in.pcapng", folder / "out.pcapng"
    capture(before, packets, link_type=link_type)
    redact(str(before), str(after), Options(), frozenset())
    return [packet.data for packet in read_capture(after)]


def test_nothing_is_left(tmp_path: Path) -> None:
    old = list(segments())
    new = redacted(tmp_path, old)
    assert [len(packet) for packet in old] == [len(packet) for packet in new]
    assert len(left((tmp_path / "in.pcapng").read_bytes())) > 50
    data = (tmp_path / "out.pcapng").read_bytes()
    assert left(data) == []
    assert not [address for address in ADDRESSES if address in data]
    for packet in new:
        if packet[12:14] == b"\x08\0" and len(packet) >= 54:
            assert internet(packet[14:34]) == 0
            if packet[23] == 6 and packet[20] & 0x3F == 0:
                end = 14 + int.from_bytes(packet[16:18])
                assert internet(packet[26:34] + (end - 34).to_bytes(4) + b"\0\0\0\6" + packet[34:end]) == 0


def test_check_finds_nothing_new(tmp_path: Path) -> None:
    """Segments late, again and overlapping; none is lost, for what is behind a gap the two readings differ about."""
    tmp_path.chmod(0o755)
    before, after = capture(tmp_path / "in.pcapng", list(segments())[:-2]), tmp_path / "out.pcapng"
    assert main(["redact", str(before), "-w", str(after)]) == 0
    after.chmod(0o644)
    words = ["--tcp-ports", str(made.PORT), "--fail-on", "note"]
    assert main(["check", *words, "--baseline", str(before), str(after)]) == 0


def test_a_frame_over_two_segments(tmp_path: Path) -> None:
    """The same but for seven letters and the addresses: all of both packets by hand."""
    code, new = texts(0x57, b"ABCDEFG")[0], a5(1, 0x57, b"\1XXXXXXX")
    out = redacted(tmp_path, [to_laptop(10, code[:6]), to_laptop(16, code[6:])])
    macs = [bytes.fromhex(text) for text in ("020000000002", "020000000001")]
    assert out == [
        ethernet(macs[0], macs[1], ipv4(ONE, TWO, tcp(ONE, TWO, (made.PORT, 50123), at, part)))
        for at, part in ((10, new[:6]), (16, new[6:]))
    ]


def test_late_and_again(tmp_path: Path) -> None:
    """The second half first; the first half again, which nobody reads: blanked."""
    code, new = texts(0x57, b"ABCDEFG")[0], a5(1, 0x57, b"\1XXXXXXX")
    ask = a5(0x40, 0x57)
    packets = [to_laptop(10, ask), to_laptop(29, code[6:]), to_laptop(23, code[:6]), to_laptop(23, code[:6])]
    out = [packet[54:] for packet in redacted(tmp_path, packets)]
    assert out == [ask, new[6:], new[:6], bytes(6)]


def test_behind_a_gap(tmp_path: Path) -> None:
    """What is lost stays lost; what comes behind it is read for itself."""
    pack = a5(1, 0x90, bytes.fromhex("0210000075300329"))
    out = redacted(tmp_path, [to_laptop(10, pack), to_laptop(500, texts(0x57, b"ABCDEFG")[0]), to_laptop(513, pack)])
    assert [packet[54:] for packet in out] == [pack, a5(1, 0x57, b"\1" + SHOUT), pack]


def test_gaps_of_several_connections(tmp_path: Path) -> None:
    """Some are given up at the end only, after others went on: bytes go back where they came from."""
    code = texts(0x57, b"ABCDEFG")[0]
    packets = [to_laptop(at, code[:8], port=port) for port in (1, 2) for at in (10, 900, 700, 500, 18)]
    packets += [to_laptop(508, code[8:], port=1), to_laptop(26, code[:3], port=2)]
    redacted(tmp_path, packets)
    assert left((tmp_path / "out.pcapng").read_bytes()) == []
    assert b"BCD" not in (tmp_path / "out.pcapng").read_bytes()


def test_cut_off_by_the_snap_length(tmp_path: Path) -> None:
    """The first frame is whole, of the second three bytes are there: blanked. The checksum can't be known: 0."""
    pack, code = a5(1, 0x90, bytes.fromhex("0210000075300329")), texts(0x57, b"ABCDEFG")[0]
    whole = to_laptop(10, pack + code)
    out = redacted(tmp_path, [whole[: 54 + 13 + 8], to_laptop(36, pack)])
    assert out[0][54:] == pack + code[:4] + bytes(4)
    assert out[0][50:52] == b"\0\0"
    assert out[1][54:] == pack


@pytest.mark.parametrize("wrong_by", [0, 1, 0x1234])
def test_checksums_that_were_wrong_stay_so(wrong_by: int, tmp_path: Path) -> None:
    """Wrong, but not by as much: that would tell of what was blanked. One that was not calculated stays 0."""
    packet = bytearray(to_laptop(10, texts(0x57, b"ABCDEFG")[0]))
    there = int.from_bytes(packet[50:52]) ^ wrong_by
    packet[50:52] = there.to_bytes(2)
    (new,) = redacted(tmp_path, [bytes(packet)])
    right = internet(new[26:34] + (len(new) - 34).to_bytes(4) + b"\0\0\0\6" + new[34:50] + b"\0\0" + new[52:])
    assert int.from_bytes(new[50:52]) == right ^ (0x5555 if wrong_by else 0)
    packet[50:52] = b"\0\0"
    (new,) = redacted(tmp_path, [bytes(packet)])
    assert new[50:52] == b"\0\0"


def test_options_and_trailers(tmp_path: Path) -> None:
    """A segment size stays, a cookie does not; nor does what stands behind the packet."""
    plain = b"\2\4\5\xb4\1\1\x08\x0a" + bytes(range(8))
    options = plain + b"\x22\x0asecretly\1\1"
    packet = ethernet(LAPTOP_MAC, SERVER_MAC, ipv4(LAPTOP, SERVER, tcp(LAPTOP, SERVER, (1, 2), 9, options=options)))
    (new,) = redacted(tmp_path, [packet + b"trailer"])
    assert new[54 : 54 + len(options)] == plain + b"\1" * 12
    assert new[len(packet) :] == bytes(7)


@pytest.mark.parametrize("link_type", [1, 101, 113, 228, 276, 0])
@pytest.mark.parametrize("version", [4, 6])
def test_link_types(link_type: int, version: int, tmp_path: Path) -> None:
    """IPv4 and IPv6 in what people capture with: the frame is found in each, the addresses go."""
    source, destination = (LAPTOP, SERVER) if version == 4 else (LAPTOP_6, SERVER_6)
    segment = tcp(source, destination, (50123, made.PORT), 1, texts(0x57, b"ABCDEFG")[0])
    ip = ipv4(source, destination, segment) if version == 4 else ipv6(source, destination, segment)
    kind = 0x0800 if version == 4 else 0x86DD
    heads = {
        1: SERVER_MAC + LAPTOP_MAC + b"\x81\0\0\7" + kind.to_bytes(2),
        113: struct.pack(">HHH8sH", 0, 1, 6, LAPTOP_MAC, kind),
        276: struct.pack(">HHIHBB8s", kind, 0, 2, 1, 0, 6, LAPTOP_MAC),
        0: b"\2\0\0\0" if version == 4 else b"\x1c\0\0\0",
    }
    packet = heads.get(link_type, b"") + ip
    (new,) = redacted(tmp_path, [packet], link_type)
    assert new[-13:] == a5(1, 0x57, b"\1" + SHOUT)
    assert not [address for address in ADDRESSES if address in new]


def test_a_new_connection_with_the_same_ends(tmp_path: Path) -> None:
    """Sequence numbers begin anew with a SYN: the second code is read as the first was."""
    code = texts(0x57, b"ABCDEFG")[0]
    packets = [
        to_server(99, flags=made.SYN),
        to_server(100, code),
        to_server(5, flags=made.SYN),
        to_server(6, code),
    ]
    assert [packet[54:] for packet in redacted(tmp_path, packets)][1::2] == [a5(1, 0x57, b"\1" + SHOUT)] * 2


CODES = b"".join([a5(0x40, 0x57), *texts(0x57, CODE)] * 3)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(
            st.sampled_from((to_server, to_laptop)),
            st.sampled_from((1, 2)),
            st.integers(0, len(CODES)),
            st.integers(0, 40),
            st.sampled_from((made.PUSH | made.ACK, made.SYN, made.RST | made.ACK)),
        ),
        min_size=1,
        max_size=30,
    )
)
def test_segments_in_any_order(tmp_path: Path, pieces: list[tuple[Callable[..., bytes], int, int, int, int]]) -> None:
    """Any pieces of two connections, late, lost, again, overlapping: no five characters of the code are left."""
    packets = [side(100 + at, CODES[at : at + size], flags=flags, port=port) for side, port, at, size, flags in pieces]
    new = redacted(tmp_path, packets)
    assert [len(packet) for packet in packets] == [len(packet) for packet in new]
    assert left((tmp_path / "out.pcapng").read_bytes()) == []


@pytest.mark.parametrize("length", range(0, 70, 3))
def test_packets_cut_off_anywhere(length: int, tmp_path: Path) -> None:
    packets = [packet[:length] for packet in (to_server(1, CODE * 3), *made.others())]
    new = redacted(tmp_path, packets)
    assert [len(packet) for packet in packets] == [len(packet) for packet in new]
    data = (tmp_path / "out.pcapng").read_bytes()
    assert left(data) == []
    assert not [address for address in ADDRESSES if address in data]
